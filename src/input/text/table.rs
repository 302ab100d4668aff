//! A text after the first pass over it; its rows are decoded as records.

use std::ops::Range;

use rayon::prelude::*;
use rust_decimal::Decimal;
use serde::{Deserialize, Serialize};

use crate::input::file::random_access::RandomAccessFile;
use crate::input::points::axis::{AXIS_NAMES, Axis};
use crate::input::points::filter::PointFilter;
use crate::input::text::columns::{Columns, comments};
use crate::input::text::cut_off::{self, Ending};
use crate::input::text::granularity::Granularity;
use crate::input::text::lines::{LONGEST, TextLine, for_each_line, is_skipped, shown, without_return};
use crate::input::text::noise;
use crate::input::text::number::{MOST_DECIMALS, Number, POWERS};
use crate::input::text::options::TextOptions;
use crate::input::text::outliers::{are_rare, middle_box, plausible_box};
use crate::input::text::role::ColumnRole;
use crate::input::text::row::RowReader;
use crate::input::text::row_box::RowBox;
use crate::input::text::row_choice::{RowChoice, is_within};
use crate::input::text::survey::{Findings, Survey, Wanted};
use crate::{Error, Result, Warnings, interrupt};

/// The number of bytes of a chunk.
const CHUNK: u64 = 2 << 20;

/// The number of chunks that show where most rows lie.
const SAMPLED_CHUNKS: u64 = 16;

/// The number of bytes at the start of a text that show how it is laid out. If all of them are comments, more are looked at.
const SAMPLE: u64 = 1 << 17;

/// The most bytes of comments before the first row.
const MOST_COMMENTS: u64 = 1 << 26;

/// If all x and y are smaller, the decimals that are kept do not tell them apart.
const TINY: f64 = 1e-12;

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
    /// The number of malformed rows. Rows that [`TextTable::leave_out_outliers`] found are not among them.
    malformed: u64,
    /// The least x, y, z of all rows; 0 if there is no row that can be read.
    pub(crate) min: [f64; 3],
    /// The greatest x, y, z; likewise.
    pub(crate) max: [f64; 3],
    /// Whether the coordinates are degrees, by the names of their columns.
    pub(crate) degrees: bool,
    /// What the rows hold that the job wants.
    wanted: WantedRows,
    /// What they hold without outliers, if these are left out.
    without_outliers: Option<WantedRows>,
    /// The first chunk with outliers: the message about one of them says what to do.
    first_outlier_in: Option<usize>,
    /// The bounds that the job wants. They hold for the numbers in the text, before these are rounded to a lattice.
    bounds: Option<[f64; 4]>,
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
        let single = found.are_single();
        let needed = if single { found.decimals_from_single } else { found.decimals };
        let decimals: [u8; 3] = std::array::from_fn(|axis| fitting(needed[axis], farthest(axis)));
        let grid = if single { [0, 1].map(|axis| Granularity::of_decimals(decimals[axis])) } else { found.grid };
        WantedRows { rows: found.rows, bounds, decimals, grid }
    }
}

/// The numbers of the first row and the first line of a chunk. Rows count from 0 and lines from 1, as editors count them.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct ChunkStart {
    row: u64,
    line: u64,
}

/// Where the rows of a text begin.
struct FirstRow {
    /// The position of its first byte.
    at: u64,
    /// The number of its line.
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
        let Layout { columns, first, named_degrees } = detect(file, options, choice.colors, warnings)?;
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
        let surveys = survey(file, &columns, &rows, Wanted { choice, within: None })?;
        let (mut chunks, mut all) = (Vec::with_capacity(surveys.len()), Survey::empty());
        for survey in &surveys {
            chunks.push(ChunkStart { row: all.rows, line: first.line + all.lines });
            all.add(survey);
        }
        let bounds = all.bounds();
        if all.rows > 0 && bounds.is_none() {
            warnings.push("no line has numbers where x, y and z should be");
        }
        refuse_tiny(file, &all.wanted)?;
        warnings.extend(noise_warning(&all.wanted));
        let cut = cut.map(|cut| (first.line + all.lines, cut.what));
        let RowBox { min, max } = bounds.unwrap_or(RowBox { min: [0.0; 3], max: [0.0; 3] });
        let malformed = all.malformed + cut.is_some() as u64;
        let records = all.rows + cut.is_some() as u64;
        let wanted = WantedRows::new(&all.wanted);
        let mut table = TextTable {
            columns,
            rows,
            chunks,
            cut,
            records,
            malformed,
            min,
            max,
            degrees: false,
            wanted,
            without_outliers: None,
            first_outlier_in: None,
            bounds: choice.bounds,
        };
        table.degrees = named_degrees && table.has_degrees(file, choice)?;
        Ok(table)
    }

    /// Returns whether x and y can be degrees. A few rows that are mistakes, and rows that the job does not want, say nothing about it.
    fn has_degrees(&self, file: &RandomAccessFile, choice: &RowChoice) -> Result<bool> {
        let Some(wanted) = self.wanted.bounds else { return Ok(false) };
        if wanted.farthest(0) <= 360.0 && wanted.farthest(1) <= 90.0 {
            return Ok(true);
        }
        let middle = self.middle(file, choice)?.unwrap_or(wanted);
        Ok(middle.farthest(0) <= 360.0 && middle.farthest(1) <= 90.0)
    }

    /// Returns the box in which most rows lie; `None` if there are too few rows to tell.
    fn middle(&self, file: &RandomAccessFile, choice: &RowChoice) -> Result<Option<RowBox>> {
        let chunks = self.chunk_count() as u64;
        let sampled: Vec<Range<u64>> = (0..SAMPLED_CHUNKS.min(chunks))
            .map(|index| chunk_range(&self.rows, index * chunks / SAMPLED_CHUNKS.min(chunks)))
            .collect();
        middle_box(file, &self.columns, self.rows.start, &sampled, Wanted { choice, within: None })
    }

    /// Finds the few rows that lie so far from all others that they are mistakes, and leaves them out: decoding counts them as
    /// malformed. `even_among_few` tells whether one row of a few may be one. Returns whether there are any.
    pub(crate) fn leave_out_outliers(
        &mut self,
        file: &RandomAccessFile,
        choice: &RowChoice,
        even_among_few: bool,
    ) -> Result<bool> {
        let Some(bounds) = self.wanted.bounds else { return Ok(false) };
        let plausible = self.middle(file, choice)?.and_then(|middle| plausible_box(&middle));
        let Some(within) = plausible.filter(|plausible| !plausible.holds_box(&bounds)) else { return Ok(false) };
        let surveys = survey(file, &self.columns, &self.rows, Wanted { choice, within: Some(within) })?;
        let mut rest = Survey::empty();
        surveys.iter().for_each(|survey| rest.add(survey));
        let left_out = are_rare(rest.outliers, self.wanted.rows, even_among_few);
        self.without_outliers = left_out.then(|| WantedRows::new(&rest.wanted));
        self.first_outlier_in = surveys.iter().position(|survey| survey.outliers > 0);
        Ok(left_out)
    }

    /// Returns whether a row is left out that would be kept without `even_among_few`.
    pub(crate) fn has_outlier_among_few(&self) -> bool {
        self.outliers() > 0 && !are_rare(self.outliers(), self.wanted.rows, false)
    }

    /// Undoes [`TextTable::leave_out_outliers`].
    pub(crate) fn keep_outliers(&mut self) {
        self.without_outliers = None;
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

    /// Returns whether rows have a classification.
    pub(crate) fn has_class(&self) -> bool {
        self.columns.have(ColumnRole::Class)
    }

    /// Returns the number of chunks.
    pub(crate) fn chunk_count(&self) -> usize {
        self.chunks.len()
    }

    /// Sends the rows of `chunk` through `filter`.
    pub(crate) fn decode(&self, file: &RandomAccessFile, chunk: usize, filter: &mut PointFilter) -> Result<()> {
        let ChunkStart { mut row, line: first_line } = self.chunks[chunk];
        let WantedRows { bounds, ref decimals, .. } = *self.held();
        let within = bounds.filter(|_| self.without_outliers.is_some());
        let mut reader = RowReader::new(&self.columns, true);
        let is_outside = |reader: &RowReader| self.bounds.is_some_and(|bounds| !is_within(bounds, &reader.numbers));
        let mut explained = self.first_outlier_in != Some(chunk);
        let range = chunk_range(&self.rows, chunk as u64);
        for_each_line(file, self.rows.start, range, |index, line| {
            let number = || first_line + index;
            match line {
                TextLine::Whole(line) if self.columns.skips(line) => return Ok(()),
                TextLine::Whole(line) => match (reader.read(line), &within) {
                    (Ok(()), _) if is_outside(&reader) => filter.push_out_of_bounds(reader.class()),
                    (Ok(()), Some(within)) if !within.holds(&reader.numbers) => {
                        filter.push_outlier(reader.class(), || {
                            let what = if explained { String::new() } else { far_from(within) };
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
        if let Some((line, what)) = self.cut.as_ref().filter(|_| chunk + 1 == self.chunks.len()) {
            filter.malformed(1, || format!("line {line}: {what}"));
        }
        Ok(())
    }
}

/// Returns what to say about the first outlier.
fn far_from(RowBox { min, max }: &RowBox) -> String {
    let axis = |axis: usize| format!("{} from {} to {}", AXIS_NAMES[axis], min[axis], max[axis]);
    format!(
        " ({}, {}, {}), and no lattice holds both at full precision: leave such rows out with [input] bounds or \
         max_malformed_fraction, or set resolution or resolution_z so coarse that they fit",
        axis(0),
        axis(1),
        axis(2)
    )
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
            "has no x or y beyond {TINY:e}, and more decimals than {MOST_DECIMALS} are not read: write it in a smaller unit, such as \
             micrometres"
        ),
    ))
}

/// Surveys all rows, chunk by chunk.
fn survey(file: &RandomAccessFile, columns: &Columns, rows: &Range<u64>, wanted: Wanted) -> Result<Vec<Survey>> {
    let count = (rows.end - rows.start).div_ceil(CHUNK);
    let survey = |index| {
        interrupt::check()?;
        Survey::of_range(file, columns, rows.start, chunk_range(rows, index), wanted)
    };
    (0..count).into_par_iter().map(survey).collect()
}

/// Returns a warning about numbers with digits that are noise.
fn noise_warning(found: &Findings) -> Option<String> {
    let text = |number: &Number| Decimal::new(number.mantissa, number.decimals.into());
    let first = found.noise?;
    let meant = noise::meaning(&first)?.number;
    Some(format!(
        "{} numbers have more digits than floating point holds, such as {}, which counts as {}",
        found.noisy,
        text(&first),
        text(&meant)
    ))
}

fn chunk_range(rows: &Range<u64>, index: u64) -> Range<u64> {
    let start = rows.start + index * CHUNK;
    start..(start + CHUNK).min(rows.end)
}

/// How a text is laid out.
struct Layout {
    columns: Columns,
    first: FirstRow,
    named_degrees: bool,
}

/// Finds out how the text is laid out and where its rows begin.
fn detect(file: &RandomAccessFile, options: &TextOptions, colors: bool, warnings: &mut Warnings) -> Result<Layout> {
    let sample = sample(file, &comments(options)?)?;
    let mark = mark_length(&sample);
    let mut lines: Vec<&[u8]> = sample[mark..].split(|&byte| byte == b'\n').collect();
    if lines.len() > 1 && file.size() > sample.len() as u64 {
        // The sample may end in the middle of the last line.
        lines.pop();
    }
    let plain: Vec<&[u8]> = lines.iter().copied().map(without_return).collect();
    let found = Columns::detect(file.path(), &plain, options, colors, warnings)?;
    let before: usize = lines[..found.header_lines].iter().map(|line| line.len() + 1).sum();
    let at = ((mark + before) as u64).min(file.size());
    let first = FirstRow { at, line: found.header_lines as u64 + 1 };
    Ok(Layout { columns: found.columns, first, named_degrees: found.degrees })
}

/// Returns the most decimals, up to `decimals`, that leave numbers up to `largest` within 18 digits.
fn fitting(decimals: u8, largest: f64) -> u8 {
    (0..=decimals.min(MOST_DECIMALS)).rev().find(|&d| largest * POWERS[d as usize] as f64 <= 1e18).unwrap_or(0)
}

/// Returns the length of the byte order mark that `text` begins with.
fn mark_length(text: &[u8]) -> usize {
    if text.starts_with(&[0xef, 0xbb, 0xbf]) { 3 } else { 0 }
}

/// Returns the start of a text: what comes before the first row, and some rows.
fn sample(file: &RandomAccessFile, comments: &[String]) -> Result<Vec<u8>> {
    let mut length = SAMPLE;
    loop {
        let sample = file.bytes(0..file.size().min(length))?;
        let lines = sample[mark_length(&sample)..].split(|&byte| byte == b'\n');
        let before = lines.take_while(|line| is_skipped(without_return(line), comments));
        let skipped: u64 = before.map(|line| line.len() as u64 + 1).sum();
        let wanted = skipped + SAMPLE;
        if wanted <= length || sample.len() as u64 == file.size() {
            return Ok(sample);
        }
        if length >= MOST_COMMENTS {
            let what = format!("has no line with numbers in its first {} MiB", MOST_COMMENTS >> 20);
            return Err(Error::input(file.path(), what));
        }
        // A line of comment may go on after the sample.
        length = wanted.max(length * 2);
    }
}
