//! A text after the first pass over it; its rows are decoded as records.

use std::ops::Range;

use rayon::prelude::*;
use rust_decimal::Decimal;
use serde::{Deserialize, Serialize};

use crate::input::file::random_access::RandomAccessFile;
use crate::input::points::axis::Axis;
use crate::input::points::filter::PointFilter;
use crate::input::text::columns::{ColumnRole, Columns};
use crate::input::text::granularity::Granularity;
use crate::input::text::lines::{LONGEST, TextLine, for_each_line};
use crate::input::text::number::{MOST_DECIMALS, POWERS};
use crate::input::text::options::TextOptions;
use crate::input::text::row::RowReader;
use crate::input::text::survey::Survey;
use crate::{Result, Warnings, interrupt};

/// The number of bytes of a chunk.
const CHUNK: u64 = 2 << 20;

/// The number of bytes at the start of a text that show how it is laid out.
const SAMPLE: u64 = 1 << 17;

/// A text after the first pass over it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct TextTable {
    columns: Columns,
    /// The bytes of the rows, from the first row to the end of the file.
    rows: Range<u64>,
    chunks: Vec<ChunkStart>,
    /// The number of rows, including malformed rows.
    pub(crate) records: u64,
    /// The least x, y, z; 0 if there is no row that can be read.
    pub(crate) min: [f64; 3],
    /// The greatest x, y, z; likewise.
    pub(crate) max: [f64; 3],
    decimals: [u8; 3],
    grid: [Granularity; 2],
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
    /// Reads all of `file` once, on the threads of the current rayon pool.
    pub(crate) fn scan(file: &RandomAccessFile, options: &TextOptions, warnings: &mut Warnings) -> Result<TextTable> {
        let (columns, first) = detect(file, options, warnings)?;
        let rows = first.at..file.size();
        let count = (rows.end - rows.start).div_ceil(CHUNK);
        let survey = |index| {
            interrupt::check()?;
            Survey::of_range(file, &columns, rows.start, chunk_range(&rows, index))
        };
        let surveys: Vec<Survey> = (0..count).into_par_iter().map(survey).collect::<Result<_>>()?;
        let (mut chunks, mut all) = (Vec::with_capacity(surveys.len()), Survey::empty());
        for survey in &surveys {
            chunks.push(ChunkStart { row: all.rows, line: first.line + all.lines });
            all.add(survey);
        }
        let is_readable = all.min[0] <= all.max[0];
        if all.rows > 0 && !is_readable {
            warnings.push("no line has numbers where x, y and z should be");
        }
        let [min, max] = if is_readable { [all.min, all.max] } else { [[0.0; 3]; 2] };
        let decimals = std::array::from_fn(|axis| fitting(all.decimals[axis], min[axis].abs().max(max[axis].abs())));
        Ok(TextTable { columns, rows, chunks, records: all.rows, min, max, decimals, grid: all.grid })
    }

    /// Returns the axes: steps of the most decimals found, counted from 0.
    pub(crate) fn axes(&self) -> [Axis; 3] {
        self.decimals.map(|decimals| Axis { offset: Decimal::ZERO, scale: Decimal::new(1, decimals as u32) })
    }

    /// Returns the largest step that divides every x, and the one that divides every y.
    pub(crate) fn grid(&self) -> [Decimal; 2] {
        [0, 1].map(|axis| self.grid[axis].value().unwrap_or(Decimal::ONE))
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
        let mut reader = RowReader::new(&self.columns);
        let range = chunk_range(&self.rows, chunk as u64);
        for_each_line(file, self.rows.start, range, |index, line| {
            let number = || first_line + index;
            match line {
                TextLine::Whole(line) if self.columns.skips(line) => return Ok(()),
                TextLine::Whole(line) => match reader.read(line).and_then(|()| reader.record(&self.decimals)) {
                    Ok(record) => filter.push(row, &record, || format!("line {}", number()))?,
                    Err(error) => {
                        filter.malformed(1, || format!("line {}: {}", number(), error.describe(&self.columns, line)));
                    }
                },
                TextLine::TooLong => filter.malformed(1, || format!("line {} has more than {LONGEST} bytes", number())),
            }
            row += 1;
            Ok(())
        })?;
        Ok(())
    }
}

fn chunk_range(rows: &Range<u64>, index: u64) -> Range<u64> {
    let start = rows.start + index * CHUNK;
    start..(start + CHUNK).min(rows.end)
}

/// Finds out how the text is laid out and where its rows begin.
fn detect(file: &RandomAccessFile, options: &TextOptions, warnings: &mut Warnings) -> Result<(Columns, FirstRow)> {
    let sample = file.bytes(0..file.size().min(SAMPLE))?;
    let mark = if sample.starts_with(&[0xef, 0xbb, 0xbf]) { 3 } else { 0 };
    let mut lines: Vec<&[u8]> = sample[mark..].split(|&byte| byte == b'\n').collect();
    if lines.len() > 1 && file.size() > SAMPLE {
        // The sample may end in the middle of the last line.
        lines.pop();
    }
    let plain: Vec<&[u8]> = lines.iter().map(|line| line.strip_suffix(b"\r").unwrap_or(line)).collect();
    let found = Columns::detect(file.path(), &plain, options, warnings)?;
    if !found.header {
        return Ok((found.columns, FirstRow { at: mark as u64, line: 1 }));
    }
    let header = plain.iter().position(|line| !found.columns.skips(line)).unwrap_or(0);
    let before: usize = lines[..=header].iter().map(|line| line.len() + 1).sum();
    let at = ((mark + before) as u64).min(file.size());
    Ok((found.columns, FirstRow { at, line: header as u64 + 2 }))
}

/// Returns the most decimals, up to `decimals`, that leave numbers up to `largest` within 18 digits.
fn fitting(decimals: u8, largest: f64) -> u8 {
    (0..=decimals.min(MOST_DECIMALS)).rev().find(|&d| largest * POWERS[d as usize] as f64 <= 1e18).unwrap_or(0)
}
