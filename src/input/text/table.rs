//! A text that has been gone through once, and its rows as records.

use std::ops::Range;

use rayon::prelude::*;
use rust_decimal::Decimal;

use crate::input::file::random_access::RandomAccessFile;
use crate::input::points::axis::Axis;
use crate::input::points::filter::PointFilter;
use crate::input::points::record::PointRecord;
use crate::input::text::columns::{ColumnRole, Columns, Delimiter, shown};
use crate::input::text::granularity::Granularity;
use crate::input::text::lines::{BLOCK, LONGEST, TextLine, for_each_line};
use crate::input::text::number::{MOST_DECIMALS, Number, POWERS};
use crate::input::text::options::TextOptions;
use crate::{Result, interrupt};

/// Bytes at the start of a text that show how it is laid out.
const SAMPLE: u64 = 1 << 17;

/// The text, after a first pass over all of it.
#[derive(Clone, Debug)]
pub(crate) struct TextTable {
    columns: Columns,
    /// Where the rows begin, and where the file ends.
    rows: Range<u64>,
    blocks: Vec<BlockStart>,
    /// Rows, malformed ones included.
    pub(crate) records: u64,
    /// Least x, y, z.
    pub(crate) min: [f64; 3],
    /// Greatest x, y, z.
    pub(crate) max: [f64; 3],
    decimals: [u8; 3],
    grid: [Granularity; 2],
}

/// Numbers of the first row and the first line of a block: rows from 0, lines as editors count them.
#[derive(Clone, Copy, Debug)]
struct BlockStart {
    row: u64,
    line: u64,
}

/// What the first pass finds in a block, or in all.
#[derive(Clone, Debug)]
struct Survey {
    lines: u64,
    rows: u64,
    min: [f64; 3],
    max: [f64; 3],
    decimals: [u8; 3],
    grid: [Granularity; 2],
}

impl TextTable {
    /// Goes through all of `file` on the threads of the current rayon pool; the texts are what the user should know.
    pub(crate) fn scan(file: &RandomAccessFile, options: &TextOptions) -> Result<(TextTable, Vec<String>)> {
        let (columns, start, first_line, mut warnings) = detect(file, options)?;
        let rows = start..file.size();
        let count = (rows.end - rows.start).div_ceil(BLOCK);
        let survey = |index| {
            interrupt::check()?;
            Survey::of_block(file, &columns, &rows, block_range(&rows, index))
        };
        let surveys: Vec<Survey> = (0..count).into_par_iter().map(survey).collect::<Result<_>>()?;
        let (mut blocks, mut all) = (Vec::with_capacity(surveys.len()), Survey::empty());
        for survey in &surveys {
            blocks.push(BlockStart { row: all.rows, line: first_line + all.lines });
            all.add(survey);
        }
        if all.rows > 0 && all.min[0] > all.max[0] {
            warnings.push("no line has numbers where x, y and z should be".to_string());
        }
        let [min, max] = if all.min[0] <= all.max[0] { [all.min, all.max] } else { [[0.0; 3]; 2] };
        let decimals = std::array::from_fn(|axis| fitting(all.decimals[axis], min[axis].abs().max(max[axis].abs())));
        Ok((TextTable { columns, rows, blocks, records: all.rows, min, max, decimals, grid: all.grid }, warnings))
    }

    /// Steps of the most decimals found, from 0.
    pub(crate) fn axes(&self) -> [Axis; 3] {
        self.decimals.map(|decimals| Axis { offset: Decimal::ZERO, scale: Decimal::new(1, decimals as u32) })
    }

    /// The largest step of which every x, and every y, is a whole multiple.
    pub(crate) fn grid(&self) -> [Decimal; 2] {
        [0, 1].map(|axis| self.grid[axis].value().unwrap_or(Decimal::ONE))
    }

    /// Whether rows have red, green and blue.
    pub(crate) fn has_rgb(&self) -> bool {
        self.columns.have(ColumnRole::Color(0))
    }

    /// Whether rows have a classification.
    pub(crate) fn has_class(&self) -> bool {
        self.columns.have(ColumnRole::Class)
    }

    /// The number of chunks.
    pub(crate) fn chunks(&self) -> usize {
        self.blocks.len()
    }

    /// Sends the rows of `chunk` through `filter`.
    pub(crate) fn decode(&self, file: &RandomAccessFile, chunk: usize, filter: &mut PointFilter) -> Result<()> {
        let BlockStart { mut row, line: first_line } = self.blocks[chunk];
        let mut reader = RowReader::new(&self.columns);
        let range = block_range(&self.rows, chunk as u64);
        for_each_line(file, self.rows.start, range, |index, line| {
            let number = || first_line + index;
            match line {
                TextLine::Whole(line) if self.columns.skips(line) => return Ok(()),
                TextLine::Whole(line) => match reader.read(line).and_then(|()| reader.record(&self.decimals)) {
                    Ok(record) => filter.push(row, &record, || format!("line {}", number()))?,
                    Err(error) => {
                        filter.malformed(1, || format!("line {}: {}", number(), error.describe(&self.columns, line)))
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

fn block_range(rows: &Range<u64>, index: u64) -> Range<u64> {
    let start = rows.start + index * BLOCK;
    start..(start + BLOCK).min(rows.end)
}

/// The layout of the text, where its rows begin, the number of the line there, and warnings.
fn detect(file: &RandomAccessFile, options: &TextOptions) -> Result<(Columns, u64, u64, Vec<String>)> {
    let sample = file.bytes(0..file.size().min(SAMPLE))?;
    let mark = if sample.starts_with(&[0xef, 0xbb, 0xbf]) { 3 } else { 0 };
    let mut lines: Vec<&[u8]> = sample[mark..].split(|&byte| byte == b'\n').collect();
    if lines.len() > 1 && file.size() > SAMPLE {
        lines.pop();
    }
    let plain: Vec<&[u8]> = lines.iter().map(|line| line.strip_suffix(b"\r").unwrap_or(line)).collect();
    let found = Columns::detect(file.path(), &plain, options)?;
    if !found.header {
        return Ok((found.columns, mark as u64, 1, found.warnings));
    }
    let header = plain.iter().position(|line| !found.columns.skips(line)).unwrap_or(0);
    let before: usize = lines[..=header].iter().map(|line| line.len() + 1).sum();
    let start = ((mark + before) as u64).min(file.size());
    Ok((found.columns, start, header as u64 + 2, found.warnings))
}

/// As many of `decimals` as leave numbers of this size room in 18 digits.
fn fitting(decimals: u8, largest: f64) -> u8 {
    (0..=decimals.min(MOST_DECIMALS)).rev().find(|&d| largest * POWERS[d as usize] as f64 <= 1e18).unwrap_or(0)
}

impl Survey {
    fn empty() -> Survey {
        Survey {
            lines: 0,
            rows: 0,
            min: [f64::INFINITY; 3],
            max: [f64::NEG_INFINITY; 3],
            decimals: [0; 3],
            grid: Default::default(),
        }
    }

    fn of_block(file: &RandomAccessFile, columns: &Columns, rows: &Range<u64>, range: Range<u64>) -> Result<Survey> {
        let mut survey = Survey::empty();
        let mut reader = RowReader::new(columns);
        survey.lines = for_each_line(file, rows.start, range, |_, line| {
            match line {
                TextLine::Whole(line) if columns.skips(line) => return Ok(()),
                TextLine::Whole(line) if reader.read(line).is_ok() => survey.see(&reader.numbers),
                _ => {}
            }
            survey.rows += 1;
            Ok(())
        })?;
        Ok(survey)
    }

    #[inline]
    fn see(&mut self, numbers: &[Number; 3]) {
        for (axis, number) in numbers.iter().enumerate() {
            let value = number.value();
            self.min[axis] = self.min[axis].min(value);
            self.max[axis] = self.max[axis].max(value);
            if number.decimals > self.decimals[axis] {
                self.decimals[axis] = self.decimals[axis].max(number.shortest().decimals);
            }
        }
        for (grid, number) in self.grid.iter_mut().zip(numbers) {
            grid.see(number);
        }
    }

    fn add(&mut self, other: &Survey) {
        self.lines += other.lines;
        self.rows += other.rows;
        for axis in 0..3 {
            self.min[axis] = self.min[axis].min(other.min[axis]);
            self.max[axis] = self.max[axis].max(other.max[axis]);
            self.decimals[axis] = self.decimals[axis].max(other.decimals[axis]);
        }
        for (grid, other) in self.grid.iter_mut().zip(&other.grid) {
            grid.add(other);
        }
    }
}

/// Why a row cannot be used: the column, from 0, and what it should hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct RowError {
    column: usize,
    expected: &'static str,
}

impl RowError {
    fn describe(&self, columns: &Columns, line: &[u8]) -> String {
        let name = match columns.roles[self.column] {
            ColumnRole::Coordinate(axis) => ["x", "y", "z"][axis],
            ColumnRole::Color(channel) => ["red", "green", "blue"][channel],
            ColumnRole::Class | ColumnRole::Skipped => "class",
        };
        let place = format!("column {} ({name})", self.column + 1);
        match columns.delimiter.fields(line).get(self.column) {
            Some(field) => format!("{place} is {}, not {}", shown(field), self.expected),
            None => format!("{place} is missing in {}", shown(line)),
        }
    }
}

/// Takes rows apart.
struct RowReader<'a> {
    columns: &'a Columns,
    numbers: [Number; 3],
    rgb: [u16; 3],
    class: u8,
}

impl<'a> RowReader<'a> {
    fn new(columns: &'a Columns) -> RowReader<'a> {
        RowReader { columns, numbers: [Number::default(); 3], rgb: [0; 3], class: 0 }
    }

    /// Reads the columns of `line` that are used.
    #[inline]
    fn read(&mut self, line: &[u8]) -> std::result::Result<(), RowError> {
        let delimiter = self.columns.delimiter;
        let mut rest = Some(line);
        for (column, &role) in self.columns.roles.iter().enumerate() {
            let missing = RowError { column, expected: "there" };
            let line = rest.ok_or(missing)?;
            if role == ColumnRole::Skipped {
                rest = delimiter.split(line).1;
                continue;
            }
            let (number, after) = take_number(delimiter, line).ok_or(RowError { column, expected: "a number" })?;
            rest = after;
            match role {
                ColumnRole::Coordinate(axis) => self.numbers[axis] = number,
                ColumnRole::Color(channel) => {
                    let expected = "a whole number from 0 to 65535";
                    self.rgb[channel] = whole(number).ok_or(RowError { column, expected })?;
                }
                ColumnRole::Class => {
                    let expected = "a whole number from 0 to 255";
                    self.class = whole(number).ok_or(RowError { column, expected })?;
                }
                ColumnRole::Skipped => {}
            }
        }
        Ok(())
    }

    /// The row last read, in steps of `10^-decimals`.
    #[inline]
    fn record(&self, decimals: &[u8; 3]) -> std::result::Result<PointRecord, RowError> {
        let mut raw = [0; 3];
        let mut rounded = [false; 2];
        for axis in 0..3 {
            let steps = self.numbers[axis].steps(decimals[axis]);
            let (value, inexact) = steps.ok_or_else(|| self.too_large(axis))?;
            raw[axis] = value;
            rounded[axis / 2] |= inexact;
        }
        Ok(PointRecord { raw, rgb: self.rgb, class: self.class, withheld: false, rounded })
    }

    #[cold]
    fn too_large(&self, axis: usize) -> RowError {
        let column = self.columns.roles.iter().position(|role| *role == ColumnRole::Coordinate(axis)).unwrap_or(0);
        RowError { column, expected: "a number of a usable size" }
    }
}

/// The number in the column at the start of `line`, and the rest of the line after the delimiter.
#[inline]
fn take_number(delimiter: Delimiter, line: &[u8]) -> Option<(Number, Option<&[u8]>)> {
    let spaces = line.iter().take_while(|byte| **byte == b' ').count();
    let line = &line[spaces..];
    if let Some((number, length)) = Number::read(line) {
        match (line.get(length), delimiter) {
            (None, _) => return Some((number, None)),
            (Some(byte), Delimiter::Byte(wanted)) if *byte == wanted => {
                return Some((number, Some(&line[length + 1..])));
            }
            (Some(b' ' | b'\t'), Delimiter::Blank) => {
                let rest = line[length..].trim_ascii_start();
                return Some((number, (!rest.is_empty()).then_some(rest)));
            }
            _ => {}
        }
    }
    let (field, rest) = delimiter.split(line);
    Some((Number::parse(field)?, rest))
}

fn whole<T: TryFrom<i64>>(number: Number) -> Option<T> {
    let number = number.shortest();
    if number.decimals == 0 && !number.rounded { T::try_from(number.mantissa).ok() } else { None }
}
