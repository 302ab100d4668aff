//! Where most points of a source lie, for choices that one stray point must not make.

use crate::file::random_access::RandomAccessFile;
use crate::points::chunk_request::ChunkRequest;
use crate::points::optional_fields::OptionalFields;
use crate::points::record::PointRecord;
use crate::points::record_sink::RecordSink;
use crate::points::returns::PulseReturn;
use crate::source::{PointData, Source};
use crate::text::outliers::{Middle, Outliers, plausible_box};
use crate::text::row_box::RowBox;
use crate::text::row_choice::RowChoice;
use sys::Result;

/// The most chunks of a sample.
const CHUNKS: usize = 16;

/// The most records of each of them.
const RECORDS: u64 = 4096;

impl Source {
    /// Returns the least and the greatest x and y of nine in ten points, by a sample, if what the source claims reaches far beyond because
    /// of a few points. The source must not be transformed.
    ///
    /// # Errors
    /// Those of reading.
    pub(crate) fn rectangle_of_most(&self) -> Result<Option<[[f64; 2]; 2]>> {
        let places = self.sampled_places()?;
        let count = places.len() as u64;
        let Some(middle) = Middle::of(places.clone()) else { return Ok(None) };
        let Some(plausible) = plausible_box(&middle.bounds, 1.0) else { return Ok(None) };
        let plane = |[x, y, _]: [f64; 3]| [x, y];
        let holds = |min: [f64; 3], max: [f64; 3]| plausible.holds_box(&RowBox { min, max });
        let rows = places.iter().filter(|place| !holds(**place, **place)).count() as u64;
        let are_rare = rows == 0 || Outliers { rows, places: rows }.are_rare(count, true);
        let is_stretched = !holds(flat(self.min), flat(self.max));
        Ok((is_stretched && are_rare).then(|| [plane(middle.bounds.min), plane(middle.bounds.max)]))
    }

    /// Returns x and y of some points, with 0 for z.
    fn sampled_places(&self) -> Result<Vec<[f64; 3]>> {
        if let PointData::Text(table) = &self.points {
            let file = RandomAccessFile::reopen(&self.path, self.size)?;
            let places = table.sampled_places(&file, &RowChoice::all())?;
            return Ok(places.into_iter().map(flat).collect());
        }
        let chunks = self.chunks();
        let count = chunks.min(CHUNKS);
        let mut sink = Places { source: self, found: Vec::new() };
        for index in 0..count {
            let request =
                ChunkRequest { records: RECORDS, fields: OptionalFields::default(), bounds: None, left_out: false };
            self.read_chunk((2 * index + 1) * chunks / (2 * count), request, &mut sink)?;
        }
        Ok(sink.found)
    }
}

/// Returns a place without its height: nothing here depends on heights.
fn flat([x, y, _]: [f64; 3]) -> [f64; 3] {
    [x, y, 0.0]
}

/// Takes the places of records.
struct Places<'a> {
    source: &'a Source,
    found: Vec<[f64; 3]>,
}

impl RecordSink for Places<'_> {
    fn push(&mut self, _: u64, record: &PointRecord, _: impl Fn() -> String) -> Result<()> {
        let [x, y] = [0, 1].map(|axis| self.source.axes[axis].value(record.raw[axis]));
        self.found.push([x, y, 0.0]);
        Ok(())
    }

    fn push_out_of_bounds(&mut self, _: u8) {}

    fn push_outlier(&mut self, _: u8, _: PulseReturn, _: impl FnOnce() -> String) {}

    fn malformed(&mut self, _: u64, _: impl FnOnce() -> String) {}

    fn not_decoded(&mut self, _: u64) {}

    fn misplaced(&mut self, _: u64) {}
}
