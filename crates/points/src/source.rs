//! A point cloud file that has been opened: what it says, and how to decode its points chunk by chunk.

use std::ops::Range;
use std::path::{Path, PathBuf};

use rust_decimal::Decimal;
use serde::{Deserialize, Serialize};

use crate::decoded_chunks::DecodedChunks;
use crate::ept::name::is_ept;
use crate::ept::points::EptPoints;
use crate::file::random_access::RandomAccessFile;
use crate::las::laz::CompressedPoints;
use crate::las::uncompressed::UncompressedPoints;
use crate::measured::{MeasuredPoints, PlausiblePoints};
use crate::other_formats::refuse_other_formats;
use crate::point_format::PointFormat;
use crate::points::axis::Axis;
use crate::points::chunk_request::ChunkRequest;
use crate::points::counts::PointCounts;
use crate::points::filter::PointFilter;
use crate::points::kept_heights::RawHeights;
use crate::points::nodata_sink::NodataSink;
use crate::points::point::Point;
use crate::points::raw_bounds::RawBounds;
use crate::points::record_sink::RecordSink;
use crate::points::rules::PointRules;
use crate::points::transformed_sink::TransformedSink;
use crate::samples::{FileSamples, fingerprint_of};
use crate::source_transform::SourceTransform;
use crate::text::options::TextOptions;
use crate::text::outliers::Outliers;
use crate::text::row_choice::RowChoice;
use crate::text::table::TextTable;
use crs::system::Crs;
use crs::unit::Unit;
use sys::{Error, Result, Warnings};

mod crs_origin;
mod ept;
mod geocentric;
mod las;
mod likely;
mod nodata;
mod text;
mod transformed;

/// How a file holds its points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FileFormat {
    /// Uncompressed LAS.
    Las,
    /// Compressed LAS, including COPC.
    Laz,
    /// A table of numbers as text.
    Text,
    /// An octree of many files (Entwine Point Tiles).
    Ept,
}

impl FileFormat {
    /// Returns its name for readers.
    pub fn name(self) -> &'static str {
        match self {
            FileFormat::Las => "LAS",
            FileFormat::Laz => "LAZ",
            FileFormat::Text => "text",
            FileFormat::Ept => "EPT",
        }
    }

    /// Tells whether it is a table as text. Then its rows alone tell the bounds of the points, and its columns what they have.
    pub fn is_text(self) -> bool {
        match self {
            FileFormat::Text => true,
            FileFormat::Las | FileFormat::Laz | FileFormat::Ept => false,
        }
    }
}

/// A point cloud file that has been opened. What it says about its points is a claim of the file; only [`Source::decode`] tells
/// the truth.
///
/// A source can be written down and read back, in JSON without loss: it holds no open file, its decimals are written as text, and
/// none of its floating-point numbers is infinite or NaN.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Source {
    /// The file, or the public name of one of another machine.
    #[serde(with = "sys::path_text")]
    pub path: PathBuf,
    /// Its size in bytes when it was opened. Decoding fails if the size changes later.
    pub size: u64,
    /// How it holds its points.
    pub format: FileFormat,
    /// LAS version, major and minor; `None` for text.
    pub version: Option<[u8; 2]>,
    /// LAS point format, 0 to 10; `None` for text.
    pub point_format: Option<u8>,
    /// The number of records, including the records missing from a truncated file.
    pub records: u64,
    /// The number of records that are known to be missing. Decoding counts them as malformed.
    pub missing: u64,
    /// Least x, y, z: of all points for text, as the header claims for LAS (often wrong). Finite.
    pub min: [f64; 3],
    /// Greatest x, y, z; likewise.
    pub max: [f64; 3],
    /// What raw integers mean in x, y, z.
    pub axes: [Axis; 3],
    /// A step in x and a step in y that divide every coordinate, counted from the axis' offset: the largest such step for text,
    /// the scale for LAS.
    pub grid: [Decimal; 2],
    /// Whether points have a colour.
    pub has_rgb: bool,
    /// Whether points have a classification.
    pub has_class: bool,
    /// Whether points say which return of its pulse they are. A text in which that is not wanted does not.
    pub has_returns: bool,
    /// Whether points have an intensity. A text in which none is wanted has none.
    pub has_intensity: bool,
    /// The coordinate reference system.
    pub crs: Crs,
    /// The unit of lengths in a false record of a geocentric system, if it states one: that of the plane where nothing else states a unit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    unit_of_false_record: Option<Unit>,
    /// The number of points by return, from the first on, as a LAS header claims it; empty for text.
    pub by_return: Vec<u64>,
    /// What the user should know about the file.
    pub warnings: Warnings,
    /// The way of its points into another system; `axes`, `grid`, `min`, `max` and `crs` then are those after it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    transform: Option<Box<SourceTransform>>,
    /// The raw heights of a LAS or LAZ file that stand for nodata.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    nodata: Vec<i64>,
    /// The raw heights that the job keeps of a LAS or LAZ file; `None`: all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    kept_heights: Option<RawHeights>,
    /// Where the points of a binary file lie, if they had to be looked at.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    measured: Option<Box<MeasuredPoints>>,
    /// Whether no point of the file is wanted, by its header, so that none is read.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    is_left_aside: bool,
    points: PointData,
}

/// Where the points are in the file and how to decode them.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum PointData {
    Las(UncompressedPoints),
    Laz(CompressedPoints),
    Text(Box<TextTable>),
    Ept(Box<EptPoints>),
}

/// Asks the format of a [`PointData`].
macro_rules! ask {
    ($data:expr, $points:ident => $answer:expr) => {
        match $data {
            PointData::Las($points) => $answer,
            PointData::Laz($points) => $answer,
            PointData::Text($points) => $answer,
            PointData::Ept($points) => $answer,
        }
    };
}

impl PointFormat for PointData {
    fn chunk_count(&self) -> usize {
        ask!(self, points => points.chunk_count())
    }

    fn bytes_of(&self, chunk: usize, request: &ChunkRequest, size: u64) -> Vec<Range<u64>> {
        ask!(self, points => points.bytes_of(chunk, request, size))
    }

    fn decode(
        &self,
        file: &RandomAccessFile,
        chunk: usize,
        request: ChunkRequest,
        sink: &mut impl RecordSink,
    ) -> Result<()> {
        ask!(self, points => points.decode(file, chunk, request, sink))
    }

    fn has_index(&self) -> bool {
        ask!(self, points => points.has_index())
    }

    fn decoded_records(&self, chunk: usize, bounds: Option<&RawBounds>) -> Option<u64> {
        ask!(self, points => points.decoded_records(chunk, bounds))
    }
}

/// Opens the file at `path` and finds out what it holds. Reads the header of LAS or LAZ, or all of a text once, on the threads of
/// the current rayon pool.
///
/// # Errors
/// `Input` if the file is not a point cloud or is damaged beyond reading, `Io` if it cannot be read, `Config` if `text` is
/// contradictory.
pub fn open(path: &Path, text: &TextOptions) -> Result<Source> {
    open_chosen(path, text, &RowChoice::all())
}

/// As [`open()`], for a job that wants only the rows of `choice`: the others have no say about the axes and the grid of a text.
///
/// # Errors
/// As [`open()`].
pub fn open_chosen(path: &Path, text: &TextOptions, choice: &RowChoice) -> Result<Source> {
    let file = RandomAccessFile::open(path)?;
    if is_ept(path) {
        let mut source = Source::open_ept(&file, choice)?;
        source.warnings.extend(file.doubt().map(str::to_string));
        return Ok(source);
    }
    let mut start = [0; 256];
    let held = file.size().min(start.len() as u64) as usize;
    file.read_exact_at(&mut start[..held], 0)?;
    let start = &start[..held];
    let mut source = if start.starts_with(b"LASF") {
        Source::open_las(&file, choice)?
    } else {
        refuse_other_formats(path, start)?;
        Source::open_text(&file, text, choice)?
    };
    source.warnings.extend(file.doubt().map(str::to_string));
    Ok(source)
}

/// Returns whether these are the least and the greatest coordinates of something.
pub(crate) fn is_box<const N: usize>(min: [f64; N], max: [f64; N]) -> bool {
    min.iter().zip(&max).all(|(min, max)| min <= max)
}

impl Source {
    /// Returns the source of a file with these points, before anything is known of it but its axes: it claims no record, and its points may
    /// have anything but a colour.
    fn of(file: &RandomAccessFile, format: FileFormat, axes: [Axis; 3], points: PointData) -> Source {
        Source {
            path: file.path().to_path_buf(),
            size: file.size(),
            format,
            version: None,
            point_format: None,
            records: 0,
            missing: 0,
            min: [0.0; 3],
            max: [0.0; 3],
            grid: [axes[0].scale, axes[1].scale],
            axes,
            has_rgb: false,
            has_class: true,
            has_returns: true,
            has_intensity: true,
            crs: Crs::default(),
            unit_of_false_record: None,
            by_return: Vec::new(),
            warnings: Warnings::default(),
            transform: None,
            nodata: Vec::new(),
            kept_heights: None,
            measured: None,
            is_left_aside: false,
            points,
        }
    }

    /// Returns a source of binary points as `choice` wants it: without a false CRS, and without the heights that it leaves out.
    ///
    /// # Errors
    /// Those of [`Source::drop_false_geocentric_crs`] and [`Source::find_nodata`].
    fn with_choice(mut self, choice: &RowChoice) -> Result<Source> {
        self.drop_false_geocentric_crs(choice.is_crs_stated)?;
        self.keep_heights(choice);
        self.find_nodata(choice)?;
        Ok(self)
    }

    /// Returns the box of the points that the job wants, its least and its greatest x, y, z, if that is known without decoding: for
    /// text, and where all points have been looked at. Those that are left out as outliers are not in it.
    pub fn wanted_box(&self) -> Option<[[f64; 3]; 2]> {
        let PointData::Text(table) = &self.points else { return self.measured.as_ref()?.rest };
        match &self.transform {
            None => table.wanted_box(),
            Some(transform) => transform.around(table.wanted_box()?),
        }
    }

    /// Returns the least and the greatest x and y that the source claims; `None` for a header that gives no box.
    pub fn claimed_rectangle(&self) -> Option<[[f64; 2]; 2]> {
        let [min, max] = [self.min, self.max].map(|[x, y, _]| [x, y]);
        let has_box = is_box(min, max) && (self.records <= 1 || min != max);
        has_box.then_some([min, max])
    }

    /// Returns the number of records that decoding will count as malformed, as far as it is known without decoding.
    pub fn known_malformed(&self) -> u64 {
        match &self.points {
            PointData::Text(table) => table.malformed() + table.missing,
            _ if self.is_left_aside => 0,
            _ => self.missing + self.outliers(),
        }
    }

    /// Has no point of the file read: from now on it has no chunks. Its records still count.
    pub fn leave_aside(&mut self) {
        self.is_left_aside = true;
    }

    /// Returns what became of all records of a file that is left aside; `None` for any other file.
    pub fn counts_left_aside(&self) -> Option<PointCounts> {
        let (read, out_of_bounds, not_decoded) = (self.records, self.records, self.records);
        self.is_left_aside.then(|| PointCounts { read, out_of_bounds, not_decoded, ..PointCounts::default() })
    }

    /// Leaves out the rows of a text that lie so far from all others that they are mistakes, if they are few: decoding counts them as
    /// malformed, and they have no say about the axes and the grid. `choice` is that with which the source was opened. Returns how many
    /// there are; whether they are few, the caller decides, who knows the other files.
    ///
    /// # Errors
    /// `Io` if the file cannot be read.
    pub fn leave_out_outliers(&mut self, choice: &RowChoice) -> Result<Outliers> {
        let steps = self.steps_of_height();
        let PointData::Text(table) = &mut self.points else { return Ok(Outliers::default()) };
        let file = RandomAccessFile::reopen(&self.path, self.size)?;
        let found = table.leave_out_outliers(&file, choice, steps)?;
        let (axes, grid) = (table.axes(), table.grid());
        self.set_axes_of_text(axes, grid);
        Ok(found)
    }

    /// Takes over what a look at all points of a binary file has shown. Decoding counts its outliers as malformed.
    pub fn set_measured(&mut self, measured: MeasuredPoints) {
        self.measured = Some(Box::new(measured));
    }

    /// Returns what a look at all points of a binary file has shown, if there was one.
    pub fn measured(&self) -> Option<&MeasuredPoints> {
        self.measured.as_deref()
    }

    /// Returns what tells those who read a binary file again which of its points are mistakes, if some are.
    pub fn plausible_points(&self) -> Option<PlausiblePoints> {
        let measured = self.measured.as_ref()?;
        Some(PlausiblePoints { content: measured.content.clone(), within: measured.plausible? })
    }

    /// Leaves out the points that a job left out as mistakes, if this is one of the files in `known`.
    ///
    /// # Errors
    /// `Io` if the file cannot be read.
    pub fn leave_out_known(&mut self, known: &[PlausiblePoints]) -> Result<()> {
        if known.is_empty() {
            return Ok(());
        }
        let content = fingerprint_of(vec![FileSamples::of(&self.path)?]);
        let found = known.iter().find(|known| known.content == content);
        let measured = |known: &PlausiblePoints| MeasuredPoints { plausible: Some(known.within), ..Default::default() };
        self.measured = found.map(|known| Box::new(measured(known)));
        Ok(())
    }

    /// Takes over where the others lie, and what to do about the outliers.
    pub fn set_remedy(&mut self, remedy: &str) {
        match (&mut self.points, &mut self.measured) {
            (PointData::Text(table), _) => table.set_remedy(remedy),
            (_, Some(measured)) => measured.remedy = remedy.into(),
            (_, None) => {}
        }
    }

    /// Returns the box of the points that the job wants, outliers included, as far as it is known without decoding.
    pub fn box_with_outliers(&self) -> Option<[[f64; 3]; 2]> {
        let PointData::Text(table) = &self.points else { return self.measured.as_ref()?.all };
        let own = table.box_with_outliers()?;
        self.transform.as_ref().map_or(Some(own), |transform| transform.around(own))
    }

    /// Returns the number of points that the job wants, outliers included; of a binary file that was not looked at, that of all records.
    pub fn wanted_rows(&self) -> u64 {
        match &self.points {
            PointData::Text(table) => table.wanted_rows(),
            _ => self.measured.as_ref().map_or(self.records, |measured| measured.points),
        }
    }

    /// Returns what messages call the record of this number: its line in a text, or else the number itself, from 0.
    ///
    /// # Errors
    /// `Io` if the file cannot be read.
    pub fn record_name(&self, number: u64) -> Result<String> {
        let PointData::Text(table) = &self.points else { return Ok(format!("point {number}")) };
        let file = RandomAccessFile::reopen(&self.path, self.size)?;
        Ok(format!("line {}", table.line_of(&file, number)?))
    }

    /// Returns how far the row of a text lies from the middle of all that lies farthest from it, and a description of it.
    ///
    /// # Errors
    /// `Io` if the file cannot be read.
    pub fn farthest_row(&self, choice: &RowChoice) -> Result<Option<(f64, String)>> {
        let PointData::Text(table) = &self.points else { return Ok(None) };
        let file = RandomAccessFile::reopen(&self.path, self.size)?;
        let place = |line: u64, text: &str| format!("{}: line {line}: {text}", self.path.display());
        Ok(table
            .farthest_row(&file, choice, self.steps_of_height())?
            .map(|row| (row.distance, place(row.line, &row.text))))
    }

    /// Returns the raw integers within these bounds in x and y: least x and y, greatest x and y, borders included. `None` for text, which
    /// compares the numbers that it holds, unless the job transforms them.
    pub fn raw_bounds(&self, bounds: [f64; 4]) -> Option<RawBounds> {
        let compares_itself = self.format.is_text() && self.transform.is_none();
        (!compares_itself).then(|| RawBounds::of(&self.axes, bounds))
    }

    /// Returns the raw integers within a rectangle, as [`Source::raw_bounds`] does, but of a text too: to whose own bounds they come on top.
    pub fn raw_rectangle(&self, rectangle: [f64; 4]) -> RawBounds {
        RawBounds::of(&self.axes, rectangle)
    }

    /// Returns the number of points that are left out as outliers.
    pub fn outliers(&self) -> u64 {
        match &self.points {
            PointData::Text(table) => table.outliers(),
            _ => self.measured.as_ref().map_or(0, |measured| measured.outliers.rows),
        }
    }

    /// Returns whether points are left out that are not rare in this file.
    pub fn has_frequent_outliers(&self) -> bool {
        match &self.points {
            PointData::Text(table) => table.has_frequent_outliers(),
            _ => self.measured.as_ref().is_some_and(|measured| measured.has_frequent_outliers()),
        }
    }

    /// Undoes [`Source::leave_out_outliers`] and [`Source::set_measured`].
    pub fn keep_outliers(&mut self) {
        self.measured = None;
        if let PointData::Text(table) = &mut self.points {
            table.keep_outliers();
            let (axes, grid) = (table.axes(), table.grid());
            self.set_axes_of_text(axes, grid);
        }
    }

    /// Returns whether the file has lost what says where its compressed points are, so that only decoding shows how many there are.
    pub fn has_lost_chunk_table(&self) -> bool {
        matches!(&self.points, PointData::Laz(points) if points.has_lost_table())
    }

    /// Returns the number of chunks: the parts of the source that can be decoded independently. Where the format allows, a chunk
    /// has about 50,000 records. A file without records has no chunk.
    ///
    /// For LAZ, a chunk of the source is one chunk of the file, or a run of several if those are small.
    pub fn chunks(&self) -> usize {
        if self.is_left_aside { 0 } else { self.points.chunk_count() }
    }

    /// Decodes chunk `chunk` (below [`Source::chunks`]) and hands the points that pass `rules` to `sink` in record order, at
    /// most 65,536 at a time. The point of record `i` of the source gets the order `rules.first_order + i`, or 0 if points are
    /// not numbered. Records that cannot be read are counted as malformed; the caller decides whether there are too many.
    ///
    /// # Errors
    /// `Io` or `Input` if the file cannot be read or has changed since it was opened, and the errors of `sink`.
    pub fn decode(
        &self,
        chunk: usize,
        rules: &PointRules,
        sink: &mut dyn FnMut(&[Point]) -> Result<()>,
    ) -> Result<PointCounts> {
        self.decode_start(chunk, u64::MAX, rules, sink)
    }

    /// As [`Source::decode`], but takes no more than the first `records` records that are decoded of the chunk, and of text about as many.
    ///
    /// # Errors
    /// As [`Source::decode`].
    pub fn decode_start(
        &self,
        chunk: usize,
        records: u64,
        rules: &PointRules,
        sink: &mut dyn FnMut(&[Point]) -> Result<()>,
    ) -> Result<PointCounts> {
        let bounds = rules.bounds.as_ref();
        self.filter(chunk, ChunkRequest { records, fields: rules.fields, bounds, left_out: false }, rules, sink)
    }

    /// Decodes exactly those records of a chunk that [`Source::decode`] leaves out because of the index of the file: if it is wrong, they
    /// may lie within the bounds.
    ///
    /// # Errors
    /// As [`Source::decode`].
    pub fn decode_left_out(
        &self,
        chunk: usize,
        rules: &PointRules,
        sink: &mut dyn FnMut(&[Point]) -> Result<()>,
    ) -> Result<PointCounts> {
        let (fields, bounds) = (rules.fields, rules.bounds.as_ref());
        self.filter(chunk, ChunkRequest { records: u64::MAX, fields, bounds, left_out: true }, rules, sink)
    }

    fn filter(
        &self,
        chunk: usize,
        request: ChunkRequest,
        rules: &PointRules,
        sink: &mut dyn FnMut(&[Point]) -> Result<()>,
    ) -> Result<PointCounts> {
        let mut filter = PointFilter::new(&self.path, &self.axes, rules, sink);
        if let Some(measured) = &self.measured
            && let Some(plausible) = measured.plausible
        {
            let remedy = if measured.first_in == Some(chunk) { measured.remedy.as_str() } else { "" };
            filter = filter.within(plausible, remedy);
        }
        self.read_chunk(chunk, request, &mut filter)?;
        filter.finish()
    }

    /// Returns the chunks of which something is decoded for these bounds, and the number of records that are decoded, missing ones aside.
    /// Without an index that is all.
    pub fn decoded_chunks(&self, bounds: Option<&RawBounds>) -> DecodedChunks {
        let bounds = self.own_bounds(bounds);
        if bounds.is_none() || !self.has_index() {
            let records = if self.is_left_aside { 0 } else { self.records - self.missing };
            return DecodedChunks::all(self.chunks(), records);
        }
        let records = |chunk: usize| self.points.decoded_records(chunk, bounds).unwrap_or(0);
        DecodedChunks::listed((0..self.chunks()).map(records))
    }

    /// Sends what is wanted of a chunk to `sink`; of a text about as many records.
    ///
    /// # Errors
    /// As [`Source::decode`].
    pub(crate) fn read_chunk(&self, chunk: usize, request: ChunkRequest, sink: &mut impl RecordSink) -> Result<()> {
        let Some(transform) = &self.transform else { return self.read_own_chunk(chunk, request, sink) };
        let of_records = transform.of_records(&self.axes).map_err(|why| Error::input(&self.path, why))?;
        let request = ChunkRequest { bounds: self.own_bounds(request.bounds), ..request };
        self.read_own_chunk(chunk, request, &mut TransformedSink::new(&of_records, sink))
    }

    /// Returns whether an index of the file tells where its points lie.
    pub fn has_index(&self) -> bool {
        self.points.has_index()
    }

    /// Returns the bounds for an index of the file: none if they are in another system than the file.
    pub(crate) fn own_bounds<'a>(&self, bounds: Option<&'a RawBounds>) -> Option<&'a RawBounds> {
        bounds.filter(|_| self.transform.as_ref().is_none_or(|transform| !transform.is_moved))
    }

    /// Returns the points of an EPT; `None` for a source in one file.
    pub(crate) fn ept(&self) -> Option<&EptPoints> {
        match &self.points {
            PointData::Ept(points) => Some(points),
            _ => None,
        }
    }

    /// Returns the bytes of a chunk that are best read at once for this request, in their order.
    pub(crate) fn bytes_of(&self, chunk: usize, request: &ChunkRequest) -> Vec<Range<u64>> {
        self.points.bytes_of(chunk, request, self.size)
    }

    /// As [`Source::read_chunk`], in the coordinates of the file.
    fn read_own_chunk(&self, chunk: usize, request: ChunkRequest, sink: &mut impl RecordSink) -> Result<()> {
        match (self.nodata.as_slice(), self.kept_heights) {
            ([], None) => self.read_chunk_of_file(chunk, request, sink),
            (nodata, kept) => self.read_chunk_of_file(chunk, request, &mut NodataSink { nodata, kept, inner: sink }),
        }
    }

    /// As [`Source::read_chunk`], as the file has the records.
    fn read_chunk_of_file(&self, chunk: usize, request: ChunkRequest, sink: &mut impl RecordSink) -> Result<()> {
        let file = RandomAccessFile::reopen(&self.path, self.size)?;
        if file.is_remote() {
            // What an index lists within bounds is read later, all of it, when a sample looks at its beginning.
            let records = if self.has_index() && request.bounds.is_some() { u64::MAX } else { request.records };
            file.hold(self.bytes_of(chunk, &ChunkRequest { records, ..request }).into_iter())?;
        }
        self.points.decode(&file, chunk, request, sink)
    }
}
