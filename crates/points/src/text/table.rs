//! A text after the first pass over it; its rows are decoded as records.

use crate::point_format::PointFormat;
use crate::points::chunk_request::ChunkRequest;
use std::ops::Range;

use rayon::prelude::*;
use rust_decimal::Decimal;
use serde::{Deserialize, Serialize};

use crate::file::random_access::RandomAccessFile;
use crate::points::axis::Axis;
use crate::points::extremes::{Extremes, SharedHeight};
use crate::points::kept_heights::KeptHeights;
use crate::points::nodata::left_out;
use crate::points::record_sink::RecordSink;
use crate::points::returns::KeptReturns;
use crate::text::columns::Columns;
use crate::text::cut_off;
use crate::text::cut_off::Ending;
use crate::text::degrees;
use crate::text::granularity::Granularity;
use crate::text::layout::{Layout, detect};
use crate::text::lines::{LONGEST, TextLine, bytes_around, for_each_line, shown};
use crate::text::lines_between::TextStart;
use crate::text::nodata_rows::NodataRows;
use crate::text::noise_warning::noise_warning;
use crate::text::number::{MOST_DECIMALS, POWERS};
use crate::text::options::TextOptions;
use crate::text::outliers::{Middle, Outliers, plausible_box, sampled_places};
use crate::text::role::ColumnRole;
use crate::text::row::RowReader;
use crate::text::row_box::RowBox;
use crate::text::row_choice::{RowChoice, is_within};
use crate::text::stated_count::count_warning;
use crate::text::survey::{Findings, Survey, Wanted};
use crs::unit::Unit;
use sys::{Error, Result, Warnings, interrupt};

/// The number of bytes of a chunk.
const CHUNK: u64 = 2 << 20;

/// The number of chunks that show where most rows lie.
const SAMPLED_CHUNKS: u64 = 16;

/// If all x and y are smaller, the decimals that are kept do not tell them apart.
const TINY: f64 = 1e-12;

/// No place on Earth is higher or deeper, in metres.
const HIGHEST: f64 = 12_000.0;

/// A text after the first pass over it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct TextTable {
    columns: Columns,
    /// The bytes of the rows, from the first row to the end of the last row that is whole.
    rows: Range<u64>,
    chunks: Vec<ChunkStart>,
    /// What is wrong with the line after the rows, if the file was cut off in it.
    cut: Option<(u64, String)>,
    /// The number of rows, including malformed rows.
    pub(crate) records: u64,
    /// The number of rows that the first line promises and the text does not hold.
    pub(crate) missing: u64,
    /// The number of malformed rows. Rows that [`TextTable::leave_out_outliers`] found are not among them.
    malformed: u64,
    /// The least x, y, z of all rows; 0 if there is no row that can be read.
    pub(crate) min: [f64; 3],
    /// The greatest x, y, z; likewise.
    pub(crate) max: [f64; 3],
    /// The unit of x and y, by the names of their columns.
    pub(crate) unit: Unit,
    /// The length of the unit of z, by the name of its column.
    pub(crate) unit_z: Option<f64>,
    /// What the rows hold that the job wants.
    wanted: WantedRows,
    /// What they hold without outliers, if these are left out.
    without_outliers: Option<WantedRows>,
    /// The outliers, if they are left out.
    outliers: Outliers,
    /// The first chunk with outliers: the message about one of them says what to do.
    first_outlier_in: Option<usize>,
    /// Where the other rows lie, and what to do about the outliers.
    #[serde(default)]
    remedy: String,
    /// The heights that stand for nodata.
    nodata: NodataRows,
    /// The lowest and the highest heights, without those that stand for nodata, and the numbers of their lines.
    heights_of_lines: Extremes,
    /// The bounds that the job wants. They hold for the numbers in the text, before these are rounded to a lattice.
    bounds: Option<[f64; 4]>,
    /// The heights that the job wants, likewise.
    #[serde(default)]
    heights: Option<KeptHeights>,
}

/// What the lattice has to hold.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct WantedRows {
    rows: u64,
    bounds: Option<RowBox>,
    decimals: [u8; 3],
    grid: [Granularity; 2],
}

impl WantedRows {
    fn new(found: &Findings) -> WantedRows {
        let bounds = found.bounds.some();
        let farthest = |axis: usize| bounds.map_or(0.0, |bounds| bounds.farthest(axis));
        let single: [bool; 3] = std::array::from_fn(|axis| found.are_single(axis));
        let needed = |axis: usize| if single[axis] { found.decimals_from_single[axis] } else { found.decimals[axis] };
        let decimals: [u8; 3] = std::array::from_fn(|axis| fitting(needed(axis), farthest(axis)));
        let grid = |axis: usize| if single[axis] { Granularity::of_decimals(decimals[axis]) } else { found.grid[axis] };
        let grid = [grid(0), grid(1)];
        WantedRows { rows: found.rows, bounds, decimals, grid }
    }
}

/// A row that lies far from the middle of all.
#[derive(Clone, Debug)]
pub(crate) struct FarRow {
    /// How far, on the axis on which it is farthest.
    pub(crate) distance: f64,
    /// The number of its line, from 1.
    pub(crate) line: u64,
    /// The line, in quotes.
    pub(crate) text: String,
}

/// The numbers of the first row and the first line of a chunk. Rows count from 0 and lines from 1, as editors count them.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct ChunkStart {
    row: u64,
    line: u64,
}

impl TextTable {
    /// Reads all of `file` once, on the threads of the current rayon pool. Only the rows of `choice` have a say about the axes.
    pub(crate) fn scan(
        file: &RandomAccessFile,
        options: &TextOptions,
        choice: &RowChoice,
        warnings: &mut Warnings,
    ) -> Result<TextTable> {
        let Layout { mut columns, first, promised, named_degrees, units, start } =
            detect(file, options, choice, warnings)?;
        let mut rows = first.at..file.size();
        let cut = match cut_off::find(file, &columns, &rows)? {
            Ending::CutOff(cut) => Some(cut),
            Ending::Doubtful(warning) => {
                warnings.push(warning);
                None
            }
            Ending::Whole => None,
        };
        rows.end = cut.as_ref().map_or(rows.end, |cut| cut.at);
        let mut nodata = columns.nodata.clone();
        let mut surveys =
            survey(file, &columns, &rows, Wanted { choice, nodata: &nodata, within: None }, Some(&start))?;
        let mut all = Survey::of_all(&surveys);
        let between = std::mem::take(&mut all.between);
        if let Some((index, what)) = between.other_header {
            return Err(Error::input(file.path(), format!("line {}: {what}", first.line + index)));
        }
        let found = all.nodata(&choice.nodata);
        if nodata.add(&found) {
            surveys = survey(file, &columns, &rows, Wanted { choice, nodata: &nodata, within: None }, None)?;
            all = Survey::of_all(&surveys);
        }
        let on_line = |height: &SharedHeight| SharedHeight { first: first.line + height.first, ..*height };
        warnings.extend(found.heights.iter().map(|height| left_out(&on_line(height), "line")));
        let heights_of_lines = all.heights.after(first.line);
        warnings.extend(all.named_heights.after(first.line).next_to(&heights_of_lines, "line"));
        let chunks = starts_of_chunks(&surveys, first.line);
        let bounds = all.bounds();
        if all.rows > all.without_height && bounds.is_none() {
            warnings.push("no line has numbers in the columns of x, y and z; fix: [input.csv] columns");
        }
        refuse_tiny(file, &all.wanted)?;
        columns.unit_colors = all.colors.are_from_0_to_1();
        warnings.extend(all.colors.warning("colours"));
        columns.unit_intensity = all.intensities.are_from_0_to_1();
        warnings.extend(all.intensities.warning("intensities"));
        let noisy_chunk = surveys.iter().position(|survey| survey.wanted.noisy > 0);
        let noisy = noisy_chunk.map(|chunk| chunk_range(&rows, chunk as u64));
        warnings.extend(noise_warning(file, &columns, &all.wanted, rows.start, noisy)?);
        let cut = cut.map(|cut| (first.line + all.lines, cut.what));
        let RowBox { min, max } = bounds.unwrap_or(RowBox { min: [0.0; 3], max: [0.0; 3] });
        let malformed = all.malformed + cut.is_some() as u64;
        let records = all.rows + cut.is_some() as u64;
        let is_unclear = start.is_guessed() && !choice.has_unit;
        warnings.extend(all.wanted.bounds.some().filter(|_| is_unclear).and_then(|rows| no_heights(&rows)));
        warnings.extend(count_warning(&[start.counts, between.counts].concat(), records));
        let wanted = WantedRows::new(&all.wanted);
        let mut table = TextTable {
            columns,
            rows,
            chunks,
            cut,
            records,
            missing: missing_rows(promised, records, warnings),
            malformed,
            min,
            max,
            unit: units.horizontal,
            unit_z: units.vertical,
            wanted,
            without_outliers: None,
            outliers: Outliers::default(),
            first_outlier_in: None,
            remedy: String::new(),
            nodata,
            heights_of_lines,
            bounds: choice.bounds,
            heights: choice.heights,
        };
        let (is_open, rows) = (units.horizontal == Unit::Unknown, table.wanted.bounds);
        if let (true, false, Some(rows)) = (is_open && !choice.is_transformed, named_degrees, rows) {
            warnings.extend(degrees::warning(&rows, &table.wanted.decimals));
        }
        if named_degrees && is_open && bounds.is_some() {
            if table.has_degrees(file, choice)? {
                table.unit = Unit::Degree;
            } else {
                warnings.push(format!(
                    "its columns are named longitude and latitude, but are not degrees (x {} to {}, y {} to {}): they are treated as \
                     lengths; fix: convert them to decimal degrees first",
                    min[0], max[0], min[1], max[1]
                ));
            }
        }
        Ok(table)
    }

    /// Returns whether x and y can be degrees, in this order or the other. A few rows that are mistakes, and rows that the job does not
    /// want, say nothing about it.
    fn has_degrees(&self, file: &RandomAccessFile, choice: &RowChoice) -> Result<bool> {
        let Some(wanted) = self.wanted.bounds else { return Ok(false) };
        Ok(degrees::can_be(&wanted) || self.middle(file, choice)?.is_some_and(|middle| degrees::can_be(&middle.bounds)))
    }

    /// Returns where most rows lie; `None` if there are too few rows to tell.
    fn middle(&self, file: &RandomAccessFile, choice: &RowChoice) -> Result<Option<Middle>> {
        Ok(Middle::of(self.sampled_places(file, choice)?))
    }

    /// Returns the places of some of the rows that `choice` wants, in the units of the file.
    pub(crate) fn sampled_places(&self, file: &RandomAccessFile, choice: &RowChoice) -> Result<Vec<[f64; 3]>> {
        let chunks = self.chunk_count() as u64;
        let sampled: Vec<Range<u64>> = (0..SAMPLED_CHUNKS.min(chunks))
            .map(|index| chunk_range(&self.rows, index * chunks / SAMPLED_CHUNKS.min(chunks)))
            .collect();
        let wanted = Wanted { choice, nodata: &self.nodata, within: None };
        sampled_places(file, &self.columns, self.rows.start, &sampled, wanted)
    }

    /// Finds the rows that lie so far from all others that they are mistakes, if they are few, and leaves them out: decoding counts them
    /// as malformed. Returns how many there are. One of x and y is as long as so many `steps` of z.
    pub(crate) fn leave_out_outliers(
        &mut self,
        file: &RandomAccessFile,
        choice: &RowChoice,
        steps: f64,
    ) -> Result<Outliers> {
        let Some(bounds) = self.wanted.bounds else { return Ok(Outliers::default()) };
        let plausible = self.middle(file, choice)?.and_then(|middle| plausible_box(&middle.bounds, steps));
        let Some(within) = plausible.filter(|plausible| !plausible.holds_box(&bounds)) else {
            return Ok(Outliers::default());
        };
        let wanted = Wanted { choice, nodata: &self.nodata, within: Some(within) };
        let surveys = survey(file, &self.columns, &self.rows, wanted, None)?;
        let rest = Survey::of_all(&surveys);
        self.outliers = Outliers::of(&rest);
        self.without_outliers = (self.outliers.rows > 0).then(|| WantedRows::new(&rest.wanted));
        self.first_outlier_in = surveys.iter().position(|survey| survey.outliers > 0);
        Ok(self.outliers)
    }

    /// Returns whether rows are left out that are not rare in this file.
    pub(crate) fn has_frequent_outliers(&self) -> bool {
        self.outliers.rows > 0 && !self.outliers.are_rare(self.wanted.rows, false)
    }

    /// Undoes [`TextTable::leave_out_outliers`].
    pub(crate) fn keep_outliers(&mut self) {
        self.without_outliers = None;
        self.outliers = Outliers::default();
    }

    /// Returns the wanted row that lies farthest from the middle of all, and the line on which it stands; `None` if there are too few rows
    /// to tell. One of x and y is as long as so many `steps` of z.
    pub(crate) fn farthest_row(
        &self,
        file: &RandomAccessFile,
        choice: &RowChoice,
        steps: f64,
    ) -> Result<Option<FarRow>> {
        let Some(middle) = self.middle(file, choice)? else { return Ok(None) };
        let mut farthest: Option<FarRow> = None;
        for (chunk, start) in self.chunks.iter().enumerate() {
            interrupt::check()?;
            let mut reader = RowReader::new(&self.columns);
            let wanted = Wanted { choice, nodata: &self.nodata, within: self.held().bounds };
            for_each_line(file, self.rows.start, chunk_range(&self.rows, chunk as u64), |index, line| {
                if let TextLine::Whole(line) = line
                    && !self.columns.skips(line)
                    && reader.read(line).is_ok()
                    && wanted.has(&reader)
                {
                    let distance = middle.distance_to(&reader.numbers, steps);
                    if farthest.as_ref().is_none_or(|known| distance > known.distance) {
                        farthest = Some(FarRow { distance, line: start.line + index, text: shown(line) });
                    }
                }
                Ok(())
            })?;
        }
        Ok(farthest)
    }

    /// Returns the lowest and the highest heights, without those that stand for nodata.
    pub(crate) fn heights_of_lines(&self) -> &Extremes {
        &self.heights_of_lines
    }

    /// Returns the number of the line, from 1, on which a row stands. Rows count from 0; lines without one lie between them.
    pub(crate) fn line_of(&self, file: &RandomAccessFile, row: u64) -> Result<u64> {
        let chunk = self.chunks.partition_point(|start| start.row <= row).saturating_sub(1);
        let Some(&ChunkStart { row: mut next, line: first }) = self.chunks.get(chunk) else { return Ok(row) };
        let mut found = first;
        for_each_line(file, self.rows.start, chunk_range(&self.rows, chunk as u64), |index, line| {
            if !matches!(line, TextLine::Whole(line) if self.columns.skips(line)) {
                found = if next == row { first + index } else { found };
                next += 1;
            }
            Ok(())
        })?;
        Ok(found)
    }

    /// Returns the number of rows that the job wants, apart from those that are left out.
    pub(crate) fn wanted_rows(&self) -> u64 {
        self.wanted.rows
    }

    /// Returns the box of all rows that the job wants, outliers included.
    pub(crate) fn box_with_outliers(&self) -> Option<[[f64; 3]; 2]> {
        self.wanted.bounds.map(|bounds| [bounds.min, bounds.max])
    }

    /// Has the message about the first outlier say this as well.
    pub(crate) fn set_remedy(&mut self, remedy: &str) {
        self.remedy = remedy.into();
    }

    fn held(&self) -> &WantedRows {
        self.without_outliers.as_ref().unwrap_or(&self.wanted)
    }

    /// Returns the number of rows that are left out as outliers.
    pub(crate) fn outliers(&self) -> u64 {
        self.wanted.rows - self.held().rows
    }

    /// Returns the number of rows that decoding will count as malformed.
    pub(crate) fn malformed(&self) -> u64 {
        self.malformed + self.outliers()
    }

    /// Returns the box of the rows that the lattice has to hold; `None` if there is none.
    pub(crate) fn wanted_box(&self) -> Option<[[f64; 3]; 2]> {
        self.held().bounds.map(|bounds| [bounds.min, bounds.max])
    }

    /// Returns the axes: steps of the most decimals found, counted from 0.
    pub(crate) fn axes(&self) -> [Axis; 3] {
        self.held().decimals.map(|decimals| Axis { offset: Decimal::ZERO, scale: Decimal::new(1, decimals as u32) })
    }

    /// Returns the largest step that divides every x, and the one that divides every y.
    pub(crate) fn grid(&self) -> [Decimal; 2] {
        [0, 1].map(|axis| self.held().grid[axis].value().unwrap_or(Decimal::ONE))
    }

    /// Returns whether rows have red, green and blue.
    pub(crate) fn has_rgb(&self) -> bool {
        self.columns.have(ColumnRole::Color(0))
    }

    /// Returns whether rows have an intensity that is wanted.
    pub(crate) fn has_intensity(&self) -> bool {
        self.columns.have(ColumnRole::Intensity)
    }

    /// Returns whether rows say their return, as far as these returns take it to know.
    pub(crate) fn has_returns(&self, wanted: KeptReturns) -> bool {
        let has_count = wanted != KeptReturns::Last || self.columns.have(ColumnRole::Returns);
        has_count && self.columns.have(ColumnRole::ReturnNumber)
    }

    /// Returns whether rows have a classification.
    pub(crate) fn has_class(&self) -> bool {
        self.columns.have(ColumnRole::Class)
    }

    /// Returns the bytes of a chunk in which about its first `records` rows begin: all of them, or as many as these take if all rows
    /// are as long.
    fn start_of(&self, chunk: usize, records: u64) -> Range<u64> {
        let Range { start, end } = chunk_range(&self.rows, chunk as u64);
        let next = self.chunks.get(chunk + 1).map_or(self.records, |next| next.row);
        let rows = next - self.chunks[chunk].row;
        let bytes = (end - start) as u128 * records.min(rows) as u128 / rows.max(1) as u128;
        if records < rows { start..start + bytes as u64 } else { start..end }
    }
}

impl PointFormat for TextTable {
    fn chunk_count(&self) -> usize {
        self.chunks.len()
    }

    fn bytes_of(&self, chunk: usize, request: &ChunkRequest, size: u64) -> Vec<Range<u64>> {
        let bytes = || bytes_around(self.rows.start, &chunk_range(&self.rows, chunk as u64), size);
        if request.needs_whole_chunk() { vec![bytes()] } else { Vec::new() }
    }

    /// Of a request for some records it sends about as many, from the first on.
    fn decode(
        &self,
        file: &RandomAccessFile,
        chunk: usize,
        request: ChunkRequest,
        filter: &mut impl RecordSink,
    ) -> Result<()> {
        if request.left_out {
            return Ok(());
        }
        let ChunkStart { mut row, line: first_line } = self.chunks[chunk];
        let WantedRows { bounds, ref decimals, .. } = *self.held();
        let within = bounds.filter(|_| self.without_outliers.is_some());
        let mut reader = RowReader::new(&self.columns);
        let is_outside = |reader: &RowReader| {
            self.bounds.is_some_and(|bounds| !is_within(bounds, &reader.numbers))
                || self.heights.is_some_and(|heights| !heights.hold(reader.height()))
        };
        let mut explained = self.first_outlier_in != Some(chunk);
        let whole = chunk_range(&self.rows, chunk as u64);
        let range = self.start_of(chunk, request.records);
        let is_whole = range == whole;
        for_each_line(file, self.rows.start, range, |index, line| {
            let number = || first_line + index;
            match line {
                TextLine::Whole(line) if self.columns.skips(line) => return Ok(()),
                TextLine::Whole(line) => match (reader.read(line), &within) {
                    (Ok(()), _) if is_outside(&reader) => filter.push_out_of_bounds(reader.class()),
                    (Ok(()), _) if self.nodata.has(reader.height()) => {
                        filter.push(row, &reader.without_height(decimals), || format!("line {}", number()))?;
                    }
                    (Ok(()), Some(within)) if !within.holds(&reader.numbers) => {
                        filter.push_outlier(reader.class(), reader.pulse_return(), || {
                            let what = if explained { "" } else { self.remedy.as_str() };
                            explained = true;
                            format!("line {}: {} lies far from all other rows{what}", number(), shown(line))
                        });
                    }
                    (Ok(()), _) => filter.push(row, &reader.record(decimals), || format!("line {}", number()))?,
                    (Err(error), _) => {
                        filter.malformed(1, || format!("line {}: {}", number(), error.describe(&self.columns, line)));
                    }
                },
                TextLine::TooLong => filter.malformed(1, || format!("line {} has more than {LONGEST} bytes", number())),
            }
            row += 1;
            Ok(())
        })?;
        if let Some((line, what)) = self.cut.as_ref().filter(|_| is_whole && chunk + 1 == self.chunks.len()) {
            filter.malformed(1, || format!("line {line}: {what}"));
        }
        if self.missing > 0 && is_whole && chunk + 1 == self.chunks.len() {
            filter
                .malformed(self.missing, || format!("{} rows are missing that the first line promises", self.missing));
        }
        Ok(())
    }
}

/// Fails if x and y are so small that they are not told apart by the decimals that are kept.
fn refuse_tiny(file: &RandomAccessFile, found: &Findings) -> Result<()> {
    let is_tiny = |bounds: RowBox| bounds.farthest(0) < TINY && bounds.farthest(1) < TINY;
    if found.noisy == 0 || !found.bounds.some().is_some_and(is_tiny) {
        return Ok(());
    }
    Err(Error::input(
        file.path(),
        format!(
            "has no x or y beyond {TINY:e}, and at most {MOST_DECIMALS} decimals are read: write it in a smaller unit, such as \
             micrometres"
        ),
    ))
}

/// Returns a warning if no number in a third column that nothing names is the height of a place on Earth in metres.
fn no_heights(rows: &RowBox) -> Option<String> {
    let (min, max) = (rows.min[2], rows.max[2]);
    (min > HIGHEST || max < -HIGHEST).then(|| {
        format!(
            "all heights are from {min} to {max}, too high for metres: without a header, columns 1, 2 and 3 are x, y and z; fix: \
             [input.csv] columns, or [input] unit"
        )
    })
}

/// Returns how many of the rows are missing that the first line promises.
fn missing_rows(promised: Option<u64>, rows: u64, warnings: &mut Warnings) -> u64 {
    // No job holds more, and no sum of so many files runs over.
    let promised = promised.map(|promised| promised.min(1 << 40));
    let Some(promised) = promised.filter(|promised| *promised != rows) else { return 0 };
    warnings.push(if promised > rows {
        format!("the first line gives {promised} points, but the file has only {rows}")
    } else {
        format!("the first line gives {promised} points, but the file has {rows}: all are read")
    });
    promised.saturating_sub(rows)
}

/// Returns where chunks begin, by their surveys. The first of their lines is line `first` of the file.
fn starts_of_chunks(surveys: &[Survey], first: u64) -> Vec<ChunkStart> {
    let mut next = ChunkStart { row: 0, line: first };
    let start = |survey: &Survey| {
        let after = ChunkStart { row: next.row + survey.rows, line: next.line + survey.lines };
        std::mem::replace(&mut next, after)
    };
    surveys.iter().map(start).collect()
}

/// Surveys all rows, chunk by chunk. Lines that are no rows are compared with `start`, if it is given.
fn survey(
    file: &RandomAccessFile,
    columns: &Columns,
    rows: &Range<u64>,
    wanted: Wanted,
    start: Option<&TextStart>,
) -> Result<Vec<Survey>> {
    let count = (rows.end - rows.start).div_ceil(CHUNK);
    let survey = |index| {
        interrupt::check()?;
        Survey::of_range(file, columns, rows.start, chunk_range(rows, index), wanted, start)
    };
    file.expect((0..count).map(|index| vec![bytes_around(rows.start, &chunk_range(rows, index), file.size())]));
    let surveys = (0..count).into_par_iter().map(survey).collect();
    file.expect(std::iter::empty());
    surveys
}

fn chunk_range(rows: &Range<u64>, index: u64) -> Range<u64> {
    let start = rows.start + index * CHUNK;
    start..(start + CHUNK).min(rows.end)
}

/// Returns the most decimals, up to `decimals`, that leave numbers up to `largest` within 18 digits.
fn fitting(decimals: u8, largest: f64) -> u8 {
    (0..=decimals.min(MOST_DECIMALS)).rev().find(|&d| largest * POWERS[d as usize] as f64 <= 1e18).unwrap_or(0)
}
