//! One line of a text as a record.

use crate::points::axis::AXIS_NAMES;
use crate::points::record::{NODATA, PointRecord};
use crate::points::returns::PulseReturn;
use crate::text::columns::Columns;
use crate::text::decimal_sign::{swapped, swapped_in_quotes};
use crate::text::delimiter::Delimiter;
use crate::text::lines::shown;
use crate::text::number::Number;
use crate::text::optional_columns::{RowBrightness, brightness_of, class_of};
use crate::text::role::ColumnRole;
use lattice::BEYOND;

/// What classes and returns are.
const WHOLE_NUMBER: &str = "a whole number from 0 to 255";

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
                ColumnRole::Class => "class",
                ColumnRole::Intensity => "intensity",
                ColumnRole::ReturnNumber => "return number",
                ColumnRole::Returns => "number of returns",
                ColumnRole::Skipped => return format!("column {}", column + 1),
            };
            format!("column {} ({name})", column + 1)
        };
        match *self {
            RowError::Missing { column } => {
                let is_count = line.trim_ascii().iter().all(u8::is_ascii_digit);
                let hint = if is_count {
                    ": it may be the number of points of another scan; split the file before such lines, so that the points of each scan are \
                     counted"
                } else {
                    ""
                };
                format!("{} is missing in {}{hint}", place(column), shown(line))
            }
            RowError::Unexpected { column, expected } => {
                let field = columns.delimiter.fields(line).get(column).copied().unwrap_or_default();
                if is_too_large(field) {
                    return format!(
                        "{} is {}, which is too large: at most 18 digits are read before the point",
                        place(column),
                        shown(field)
                    );
                }
                let hint = match columns.decimal_comma {
                    false if is_decimal_comma(field) => ": decimals have a point before them in this file, not a comma",
                    true if field.contains(&b'.') => ": decimals have a comma before them in this file, not a point",
                    _ => "",
                };
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

/// Returns whether `field` is a number, but too large to be read.
fn is_too_large(field: &[u8]) -> bool {
    let value = std::str::from_utf8(field).ok().and_then(|text| text.parse::<f64>().ok());
    let is_written_out = field.iter().any(u8::is_ascii_digit);
    is_written_out && value.is_some_and(|value| value.abs() >= 0.99e18)
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
    /// What the colours of the last row show.
    pub(crate) colors: RowBrightness,
    class: u8,
    pulse_return: PulseReturn,
    intensity: u16,
    /// What the intensity of the last row shows.
    pub(crate) brightness: RowBrightness,
    /// The height of the last row, if it is too large for a number.
    huge_height: f64,
    /// The last row with points before decimals, if the text has commas there.
    pointed: Vec<u8>,
}

impl<'a> RowReader<'a> {
    /// Returns a reader of rows with these columns.
    pub(crate) fn new(columns: &'a Columns) -> RowReader<'a> {
        let none = RowBrightness::default();
        RowReader {
            columns,
            numbers: [Number::default(); 3],
            rgb: [0; 3],
            colors: none,
            class: 0,
            pulse_return: PulseReturn::default(),
            intensity: 0,
            brightness: none,
            huge_height: 0.0,
            pointed: Vec::new(),
        }
    }

    /// Reads the columns of `line` that are used.
    #[inline]
    pub(crate) fn read(&mut self, line: &[u8]) -> Result<(), RowError> {
        if self.columns.decimal_comma { self.read_with_commas(line) } else { self.read_with_points(line) }
    }

    /// Reads a line with commas before decimals.
    #[cold]
    fn read_with_commas(&mut self, line: &[u8]) -> Result<(), RowError> {
        let mut pointed = std::mem::take(&mut self.pointed);
        pointed.clear();
        match self.columns.delimiter {
            Delimiter::Byte(b',') => pointed.extend(swapped_in_quotes(line)),
            _ => pointed.extend(line.iter().map(swapped)),
        }
        let read = self.read_with_points(&pointed);
        self.pointed = pointed;
        read
    }

    #[inline]
    fn read_with_points(&mut self, line: &[u8]) -> Result<(), RowError> {
        let delimiter = self.columns.delimiter;
        let mut rest = Some(line);
        self.colors = RowBrightness::default();
        self.brightness = RowBrightness::default();
        for (column, &role) in self.columns.roles.iter().enumerate() {
            let line = rest.ok_or(RowError::Missing { column })?;
            if role == ColumnRole::Skipped {
                rest = delimiter.split(line).1;
                continue;
            }
            let unexpected = |expected| RowError::Unexpected { column, expected };
            let (number, after) = match take_number(delimiter, line) {
                Some(taken) => taken,
                None => self.nothing(line, role).ok_or(unexpected("a number"))?,
            };
            rest = after;
            match role {
                ColumnRole::Coordinate(axis) => self.numbers[axis] = number,
                // A colour that is none is black, and no reason to lose the point.
                ColumnRole::Color(channel) => {
                    self.colors.see(&number);
                    self.rgb[channel] = brightness_of(number, self.columns.unit_colors).unwrap_or(0);
                }
                ColumnRole::Class => {
                    let class = class_of(number).or((!self.columns.strict_classes).then_some(0));
                    self.class = class.ok_or(unexpected(WHOLE_NUMBER))?;
                }
                ColumnRole::ReturnNumber => {
                    self.pulse_return.number = class_of(number).ok_or(unexpected(WHOLE_NUMBER))?;
                }
                ColumnRole::Returns => {
                    self.pulse_return.of = class_of(number).ok_or(unexpected(WHOLE_NUMBER))?;
                }
                ColumnRole::Intensity => {
                    self.brightness.see(&number);
                    self.intensity = brightness_of(number, self.columns.unit_intensity).unwrap_or(0);
                }
                ColumnRole::Skipped => {}
            }
        }
        match rest {
            Some(rest) if self.is_surplus(rest) => Err(RowError::Surplus),
            _ => Ok(()),
        }
    }

    /// Returns 0 for a colour, a class, an intensity or a return that is not there or need not be read, and the rest of the line after it;
    /// of a number for nodata that is too large for any height what stands for it.
    #[cold]
    fn nothing<'b>(&mut self, line: &'b [u8], role: ColumnRole) -> Option<(Number, Option<&'b [u8]>)> {
        let (field, rest) = self.columns.delimiter.split(line);
        if role == ColumnRole::Coordinate(2) && is_too_large(field) {
            self.huge_height = std::str::from_utf8(field).ok()?.parse().ok()?;
            return self
                .columns
                .nodata
                .has(self.huge_height)
                .then(|| (Number::too_large(self.huge_height < 0.0), rest));
        }
        let is_optional = match role {
            ColumnRole::Coordinate(_) => false,
            ColumnRole::Class => field.is_empty() || !self.columns.strict_classes,
            ColumnRole::ReturnNumber | ColumnRole::Returns => field.is_empty(),
            ColumnRole::Color(_) | ColumnRole::Intensity | ColumnRole::Skipped => true,
        };
        is_optional.then_some((Number::default(), rest))
    }

    /// Returns whether `rest`, the line after the columns that are used, has more columns than the header names.
    #[inline]
    fn is_surplus(&self, rest: &[u8]) -> bool {
        let Some(named) = self.columns.named else { return false };
        let unused = named.saturating_sub(self.columns.roles.len());
        self.columns.delimiter.has_more_than(unused, rest)
    }

    /// Returns the height of the last row, which may be too large for any.
    #[inline(always)]
    pub(crate) fn height(&self) -> f64 {
        if self.numbers[2].is_too_large() { self.huge_height } else { self.numbers[2].value() }
    }

    /// Returns the record of the last row, whose height stands for nodata, as [`RowReader::record`] does.
    #[cold]
    pub(crate) fn without_height(&self, decimals: &[u8; 3]) -> PointRecord {
        let record = self.record(decimals);
        let [x, y, _] = record.raw;
        PointRecord { raw: [x, y, NODATA], ..record }
    }

    /// Returns the class of the last row.
    pub(crate) fn class(&self) -> u8 {
        self.class
    }

    /// Returns the return of the last row.
    pub(crate) fn pulse_return(&self) -> PulseReturn {
        self.pulse_return
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
        let RowReader { rgb, intensity, class, pulse_return, .. } = *self;
        PointRecord { raw, rgb, intensity, class, withheld: false, pulse_return, rounded }
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
