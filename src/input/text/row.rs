//! One line of a text as a record.

use crate::input::points::axis::AXIS_NAMES;
use crate::input::points::record::PointRecord;
use crate::input::text::columns::{ColumnRole, Columns, shown};
use crate::input::text::delimiter::Delimiter;
use crate::input::text::number::Number;

/// Why a line cannot be used. Columns count from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RowError {
    /// The line ends before this column.
    Missing { column: usize },
    /// The column holds something else than `expected`.
    Unexpected { column: usize, expected: &'static str },
}

impl RowError {
    /// Returns a sentence about `line`, for people.
    pub(crate) fn describe(&self, columns: &Columns, line: &[u8]) -> String {
        let (RowError::Missing { column } | RowError::Unexpected { column, .. }) = *self;
        let name = match columns.roles[column] {
            ColumnRole::Coordinate(axis) => AXIS_NAMES[axis],
            ColumnRole::Color(channel) => ["red", "green", "blue"][channel],
            ColumnRole::Class | ColumnRole::Skipped => "class",
        };
        let place = format!("column {} ({name})", column + 1);
        match self {
            RowError::Missing { .. } => format!("{place} is missing in {}", shown(line)),
            RowError::Unexpected { expected, .. } => {
                let field = columns.delimiter.fields(line).get(column).copied().unwrap_or_default();
                format!("{place} is {}, not {expected}", shown(field))
            }
        }
    }
}

/// Reads rows and keeps the numbers of the last one.
pub(crate) struct RowReader<'a> {
    columns: &'a Columns,
    /// x, y and z.
    pub(crate) numbers: [Number; 3],
    rgb: [u16; 3],
    class: u8,
}

impl<'a> RowReader<'a> {
    /// Returns a reader of rows with these columns.
    pub(crate) fn new(columns: &'a Columns) -> RowReader<'a> {
        RowReader { columns, numbers: [Number::default(); 3], rgb: [0; 3], class: 0 }
    }

    /// Reads the columns of `line` that are used.
    #[inline]
    pub(crate) fn read(&mut self, line: &[u8]) -> Result<(), RowError> {
        let delimiter = self.columns.delimiter;
        let mut rest = Some(line);
        for (column, &role) in self.columns.roles.iter().enumerate() {
            let line = rest.ok_or(RowError::Missing { column })?;
            if role == ColumnRole::Skipped {
                rest = delimiter.split(line).1;
                continue;
            }
            let unexpected = |expected| RowError::Unexpected { column, expected };
            let (number, after) = take_number(delimiter, line).ok_or(unexpected("a number"))?;
            rest = after;
            match role {
                ColumnRole::Coordinate(axis) => self.numbers[axis] = number,
                ColumnRole::Color(channel) => {
                    self.rgb[channel] = whole(number).ok_or(unexpected("a whole number from 0 to 65535"))?;
                }
                ColumnRole::Class => self.class = whole(number).ok_or(unexpected("a whole number from 0 to 255"))?,
                ColumnRole::Skipped => {}
            }
        }
        Ok(())
    }

    /// Returns the last row in steps of `10^-decimals` on each axis.
    #[inline]
    pub(crate) fn record(&self, decimals: &[u8; 3]) -> Result<PointRecord, RowError> {
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
        RowError::Unexpected { column, expected: "a number of a usable size" }
    }
}

/// Returns the number in the column at the start of `line`, and the rest of the line after the delimiter.
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

/// Returns `number` as an integer; `None` if it has decimals or does not fit.
fn whole<T: TryFrom<i64>>(number: Number) -> Option<T> {
    let number = number.shortest();
    if number.decimals == 0 && !number.rounded { T::try_from(number.mantissa).ok() } else { None }
}
