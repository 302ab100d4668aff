//! Uncompressed point records, read block by block.

use std::ops::Range;

use crate::Result;
use crate::input::file::random_access::RandomAccessFile;
use crate::input::las::header::LasHeader;
use crate::input::las::layout::RecordLayout;
use crate::input::points::filter::PointFilter;
use crate::input::points::rules::PointRules;

/// UncompressedPoints of a chunk.
const PIECE: u64 = 50_000;

/// Bytes read at once, unless a single record is longer.
const BLOCK: usize = 1 << 18;

/// The point data of a LAS file.
#[derive(Clone, Debug)]
pub(crate) struct UncompressedPoints {
    layout: RecordLayout,
    points_at: u64,
    /// Whole records that the file holds.
    whole: u64,
    /// UncompressedPoints that the header promises and the file does not hold.
    pub(crate) missing: u64,
}

impl UncompressedPoints {
    /// The records of a file of `file_size` bytes.
    pub(crate) fn new(header: &LasHeader, file_size: u64) -> UncompressedPoints {
        let layout = RecordLayout::new(header.format, header.record_length);
        let extended = header.evlrs.0;
        let end = if header.evlrs.1 > 0 && extended > header.points_at { extended.min(file_size) } else { file_size };
        let room = (end - header.points_at) / layout.length as u64;
        let whole = header.records.min(room);
        UncompressedPoints { layout, points_at: header.points_at, whole, missing: header.records - whole }
    }

    /// The number of chunks; at least one where records are missing, to count them.
    pub(crate) fn chunks(&self) -> usize {
        (self.whole.div_ceil(PIECE) as usize).max((self.missing > 0) as usize)
    }

    fn range(&self, chunk: usize) -> Range<u64> {
        let first = chunk as u64 * PIECE;
        first..(first + PIECE).min(self.whole)
    }

    /// Sends the records of `chunk` through `filter`.
    pub(crate) fn decode(
        &self,
        file: &RandomAccessFile,
        chunk: usize,
        rules: &PointRules,
        filter: &mut PointFilter,
    ) -> Result<()> {
        let length = self.layout.length;
        let mut block = vec![0; (BLOCK / length).max(1) * length];
        let Range { start: mut number, end } = self.range(chunk);
        while number < end {
            let count = ((block.len() / length) as u64).min(end - number);
            let bytes = &mut block[..count as usize * length];
            file.read_exact_at(bytes, self.points_at + number * length as u64)?;
            push_records(&self.layout, bytes, number, rules, filter)?;
            number += count;
        }
        if chunk + 1 == self.chunks() && self.missing > 0 {
            let (whole, missing) = (self.whole, self.missing);
            filter.malformed(missing, || {
                format!(
                    "the header promises {} points, but the file ends after {whole} whole ones, so {missing} are missing; \
                     copy it again, or allow the loss",
                    whole + missing
                )
            });
        }
        Ok(())
    }
}

/// Sends whole records, the first of which has `number`, through `filter`.
pub(crate) fn push_records(
    layout: &RecordLayout,
    bytes: &[u8],
    number: u64,
    rules: &PointRules,
    filter: &mut PointFilter,
) -> Result<()> {
    for (number, bytes) in (number..).zip(bytes.chunks_exact(layout.length)) {
        filter.push(number, &layout.record(bytes, rules.rgb), || format!("point {number}"))?;
    }
    Ok(())
}
