//! One line of a text as a record.

use crate::geometry::lattice::BEYOND;
use crate::input::points::axis::AXIS_NAMES;
use crate::input::points::record::PointRecord;
use crate::input::text::columns::Columns;
use crate::input::text::delimiter::Delimiter;
use crate::input::text::lines::shown;
use crate::input::text::number::Number;
use crate::input::text::role::ColumnRole;

/// Why a line cannot be used. Columns count from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RowError {
    /// The line ends before this column.
    Missing { column: usize },
    /// The column holds something else than `expected`.
    Unexpected { column: usize, expected: &'static str },
    /// The line has more columns than the header names.
    Surplus,
}

impl RowError {
    /// Returns a sentence about `line`, for people.
    pub(crate) fn describe(&self, columns: &Columns, line: &[u8]) -> String {
        let place = |column: usize| {
            let name = match columns.roles[column] {
                ColumnRole::Coordinate(axis) => AXIS_NAMES[axis],
                ColumnRole::Color(channel) => ["red", "green", "blue"][channel],
                ColumnRole::Class | ColumnRole::Skipped => "class",
            };
            format!("column {} ({name})", column + 1)
        };
        match *self {
            RowError::Missing { column } => format!("{} is missing in {}", place(column), shown(line)),
            RowError::Unexpected { column, expected } => {
                let field = columns.delimiter.fields(line).get(column).copied().unwrap_or_default();
                let hint =
                    if is_decimal_comma(field) { ": decimals have a point before them, not a comma" } else { "" };
                format!("{} is {}, not {expected}{hint}", place(column), shown(field))
            }
            RowError::Surplus => {
                let (named, found) = (columns.named.unwrap_or_default(), columns.delimiter.fields(line).len());
                format!(
                    "{} has {found} columns, but the header names {named}; decimals have a point and no comma before them, and \
                     text with the delimiter in it stands in quotes",
                    shown(line)
                )
            }
        }
    }
}

/// Returns whether `field` would be a number with a point in place of its comma.
fn is_decimal_comma(field: &[u8]) -> bool {
    let pointed: Vec<u8> = field.iter().map(|byte| if *byte == b',' { b'.' } else { *byte }).collect();
    pointed != field && Number::parse(&pointed).is_some()
}

/// Reads rows and keeps the numbers of the last one.
pub(crate) struct RowReader<'a> {
    columns: &'a Columns,
    /// x, y and z.
    pub(crate) numbers: [Number; 3],
    rgb: [u16; 3],
    class: u8,
    /// Whether to count the columns that are not used.
    thorough: bool,
}

impl<'a> RowReader<'a> {
    /// Returns a reader of rows with these columns. A thorough one counts the columns that are not used as well.
    pub(crate) fn new(columns: &'a Columns, thorough: bool) -> RowReader<'a> {
        RowReader { columns, numbers: [Number::default(); 3], rgb: [0; 3], class: 0, thorough }
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
            let (number, after) = match take_number(delimiter, line) {
                Some(taken) => taken,
                None => nothing(delimiter, line, role).ok_or(unexpected("a number"))?,
            };
            rest = after;
            match role {
                ColumnRole::Coordinate(axis) => self.numbers[axis] = number,
                ColumnRole::Color(channel) => {
                    let color = if self.columns.unit_colors { unit_color(number) } else { nearest_color(number) };
                    self.rgb[channel] = color.ok_or(unexpected("a whole number from 0 to 65535"))?;
                }
                ColumnRole::Class => self.class = whole(number).ok_or(unexpected("a whole number from 0 to 255"))?,
                ColumnRole::Skipped => {}
            }
        }
        match rest {
            Some(rest) if self.is_surplus(rest) => Err(RowError::Surplus),
            _ => Ok(()),
        }
    }

    /// Returns whether `rest`, the line after the columns that are used, has more columns than the header names.
    #[inline]
    fn is_surplus(&self, rest: &[u8]) -> bool {
        let Some(named) = self.columns.named else { return false };
        let unused = named.saturating_sub(self.columns.roles.len());
        (self.thorough || unused == 0) && self.columns.delimiter.has_more_than(unused, rest)
    }

    /// Returns the class of the last row.
    pub(crate) fn class(&self) -> u8 {
        self.class
    }

    /// Returns the last row in steps of `10^-decimals` on each axis.
    #[inline]
    pub(crate) fn record(&self, decimals: &[u8; 3]) -> PointRecord {
        let mut raw = [0; 3];
        let mut rounded = [false; 2];
        for axis in 0..3 {
            let (value, inexact) = self.numbers[axis].steps(decimals[axis]).unwrap_or((BEYOND, true));
            raw[axis] = value;
            rounded[axis / 2] |= inexact;
        }
        PointRecord { raw, rgb: self.rgb, class: self.class, withheld: false, rounded }
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

/// Returns 0 for a colour or a class that is not there, and the rest of the line after it.
#[cold]
fn nothing(delimiter: Delimiter, line: &[u8], role: ColumnRole) -> Option<(Number, Option<&[u8]>)> {
    let (field, rest) = delimiter.split(line);
    let optional = !matches!(role, ColumnRole::Coordinate(_));
    (optional && field.is_empty()).then_some((Number::default(), rest))
}

/// Returns the colour for a number from 0 to 1.
fn unit_color(number: Number) -> Option<u16> {
    Some((number.value().clamp(0.0, 1.0) * u16::MAX as f64).round() as u16)
}

/// Returns the colour nearest to `number`; `None` if no colour is that dark or bright.
fn nearest_color(number: Number) -> Option<u16> {
    let (nearest, _) = number.steps(0)?;
    u16::try_from(nearest).ok()
}

/// Returns `number` as an integer; `None` if it has decimals or does not fit.
fn whole<T: TryFrom<i64>>(number: Number) -> Option<T> {
    let number = number.shortest();
    if number.decimals == 0 && !number.rounded { T::try_from(number.mantissa).ok() } else { None }
}
