//! What the columns of a text mean, as the options say or as the first lines show.

use std::cmp::Reverse;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::input::text::decimal_comma::{self, CommaUse, Names};
use crate::input::text::delimiter::{CANDIDATES, Delimiter};
use crate::input::text::header::{self, names_in_comments, separator_line};
use crate::input::text::lines::is_skipped;
use crate::input::text::names::{NamedColumns, named_columns, truncate};
use crate::input::text::number::Number;
use crate::input::text::options::TextOptions;
use crate::input::text::role::ColumnRole;
use crate::{Error, Result, Warnings};

/// The columns of a text that nothing names.
const COORDINATES: [ColumnRole; 3] = [ColumnRole::Coordinate(0), ColumnRole::Coordinate(1), ColumnRole::Coordinate(2)];

const DECIMAL_COMMA: &str = "has commas both between columns and before decimals, as in 565000,25,5933000,50: all its columns are whole \
                             numbers; write it again with points before decimals or with semicolons between columns, or name its \
                             columns with `columns` under [input.csv]";

const UNCLEAR_COMMA: &str = "has only whole numbers with commas between them, more than three in a row, and no names: the commas may also \
                             stand before decimals, as in 565000,25,5933000,50; if they do not, name its columns with `columns` under \
                             [input.csv], for example [\"x\", \"y\", \"z\", \"class\"], and if they do, write it again with points before \
                             decimals or with semicolons between columns";

/// How the lines of a text are to be read.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Columns {
    /// What separates the columns of a row.
    pub(crate) delimiter: Delimiter,
    /// What each column holds, up to the last column that is used.
    pub(crate) roles: Vec<ColumnRole>,
    /// How many columns the text itself names. A row with more is malformed.
    pub(crate) named: Option<usize>,
    /// Whether one of the first rows has. Without it, the first pass looks only at the columns that are used, for speed.
    pub(crate) has_surplus: bool,
    /// Whether colours are numbers from 0 to 1.
    pub(crate) unit_colors: bool,
    /// Lines that begin with one of these are skipped.
    comments: Vec<String>,
}

/// What the lines at the start of a text show.
pub(crate) struct DetectedColumns {
    pub(crate) columns: Columns,
    /// How many lines come before the rows: up to the last one of a header.
    pub(crate) header_lines: usize,
    /// Whether x and y are named as longitude and latitude.
    pub(crate) degrees: bool,
}

impl Columns {
    /// Finds out how the text in `path` is laid out; `lines` are its first lines. `colors` tells whether its colours are wanted.
    pub(crate) fn detect(
        path: &Path,
        lines: &[&[u8]],
        options: &TextOptions,
        colors: bool,
        warnings: &mut Warnings,
    ) -> Result<DetectedColumns> {
        let comments = comments(options)?;
        let mut rows: Vec<(usize, &[u8])> = lines.iter().copied().enumerate().collect();
        rows.retain(|(_, line)| !is_skipped(line, &comments));
        let Some(&(first_at, first)) = rows.first() else {
            return Err(Error::input(path, "has no line with numbers in it"));
        };
        let mut header_lines = 0;
        let mut given = options.delimiter;
        if let Some(separator) = separator_line(first).filter(|_| rows.len() > 1) {
            given = given.or(Some(separator));
            header_lines = first_at + 1;
            rows.remove(0);
        }
        let candidates = match given {
            Some(delimiter) => vec![Delimiter::from_option(delimiter)?],
            None => CANDIDATES.to_vec(),
        };
        let texts: Vec<&[u8]> = rows.iter().map(|(_, line)| *line).collect();
        let header = header::find(&texts, &candidates, options.header, options.columns.is_some());
        if header.count {
            warnings.push("the first line holds one number, taken for the number of points and skipped");
        }
        if let Some((at, _)) = header.lines.checked_sub(1).and_then(|last| rows.get(last)) {
            header_lines = at + 1;
        }
        let data = &texts[header.lines..];
        let commented = || {
            let row = data.first().filter(|_| options.header != Some(false))?;
            let end = rows.get(header.lines)?.0;
            names_in_comments(&lines[..end], &comments, &candidates, row)
        };
        let found = match (&options.columns, header.names) {
            (Some(names), _) => Some(named_by_user(names)?),
            (None, Some(names)) => Some(names.map_err(|what| Error::input(path, what))?),
            (None, None) => commented(),
        };
        let roles = used_roles(found.as_ref(), colors);
        let delimiter = row_delimiter(&candidates, &roles, data);
        if options.columns.is_none() {
            refuse_decimal_comma(path, delimiter, found.as_ref(), data)?;
        }
        let columns_of_last = texts.last().map_or(0, |row| delimiter.fields(row).len());
        warnings.extend(names_warning(found.as_ref(), columns_of_last));
        let named = found.as_ref().filter(|_| options.columns.is_none()).map(|found| found.count);
        let unit_colors = has_unit_colors(delimiter, &roles, data);
        let has_surplus = named.is_some_and(|named| data.iter().any(|row| delimiter.has_more_than(named, row)));
        let columns = Columns { delimiter, roles, named, has_surplus, unit_colors, comments };
        Ok(DetectedColumns { columns, header_lines, degrees: found.is_some_and(|found| found.degrees) })
    }

    /// Returns whether `line` is blank or a comment.
    #[inline]
    pub(crate) fn skips(&self, line: &[u8]) -> bool {
        is_skipped(line, &self.comments)
    }

    /// Returns whether a column has the role `wanted`.
    pub(crate) fn have(&self, wanted: ColumnRole) -> bool {
        self.roles.contains(&wanted)
    }
}

fn named_by_user(names: &[String]) -> Result<NamedColumns> {
    named_columns(names.iter().map(|name| name.as_bytes()))
        .map_err(|error| Error::Config(format!("[input.csv] columns {error}")))
}

/// Returns what the columns hold that are used. Without names, the first three are x, y and z.
fn used_roles(found: Option<&NamedColumns>, colors: bool) -> Vec<ColumnRole> {
    let mut roles = found.map_or(COORDINATES.to_vec(), |found| found.roles.clone());
    if !colors {
        let is_color = |role: &&mut ColumnRole| matches!(role, ColumnRole::Color(_));
        roles.iter_mut().filter(is_color).for_each(|role| *role = ColumnRole::Skipped);
        truncate(&mut roles);
    }
    roles
}

fn names_warning(found: Option<&NamedColumns>, columns: usize) -> Option<String> {
    let warning = match found {
        None if columns > 3 => {
            "no line names the columns: the first three are taken for x, y and z; say otherwise with `columns` under [input.csv]"
        }
        Some(found) if found.feet => {
            "the names of the columns say feet, but not which: they count as metres unless [input] unit (\"foot\" or \"us-foot\") or a CRS says it"
        }
        _ => return None,
    };
    Some(warning.to_string())
}

fn refuse_decimal_comma(path: &Path, delimiter: Delimiter, found: Option<&NamedColumns>, rows: &[&[u8]]) -> Result<()> {
    let names = match found {
        None => Names::None,
        Some(found) if found.roles.starts_with(&COORDINATES) => Names::CoordinatesFirst,
        Some(_) => Names::Others,
    };
    match decimal_comma::second_use(delimiter, names, rows) {
        Some(CommaUse::Decimals) => Err(Error::input(path, DECIMAL_COMMA)),
        Some(CommaUse::Unclear) => Err(Error::input(path, UNCLEAR_COMMA)),
        None => Ok(()),
    }
}

/// Returns what begins the lines that are skipped.
pub(crate) fn comments(options: &TextOptions) -> Result<Vec<String>> {
    match &options.comment {
        Some(comment) if comment.is_empty() => Ok(Vec::new()),
        Some(comment) if comment.starts_with(|c: char| c.is_ascii_digit()) => Err(Error::Config(format!(
            "[input.csv] comment = {comment:?} would skip rows; it cannot begin with a digit"
        ))),
        Some(comment) => Ok(vec![comment.clone()]),
        None => Ok(vec!["#".to_string(), "//".to_string()]),
    }
}

/// Returns the delimiter under which most rows have numbers as x, y and z. Of several, the first candidate wins.
fn row_delimiter(candidates: &[Delimiter], roles: &[ColumnRole], rows: &[&[u8]]) -> Delimiter {
    let fits = |delimiter: Delimiter, row: &&[u8]| {
        let fields = delimiter.fields(row);
        let number = |(column, role): (usize, &ColumnRole)| {
            !matches!(role, ColumnRole::Coordinate(_))
                || fields.get(column).is_some_and(|field| Number::parse(field).is_some())
        };
        roles.iter().enumerate().all(number)
    };
    let fitting = |delimiter: &&Delimiter| rows.iter().filter(|row| fits(**delimiter, row)).count();
    candidates.iter().min_by_key(|delimiter| Reverse(fitting(delimiter))).copied().unwrap_or(Delimiter::Blank)
}

/// Returns whether the colours of these rows are numbers from 0 to 1, some of them with decimals.
fn has_unit_colors(delimiter: Delimiter, roles: &[ColumnRole], rows: &[&[u8]]) -> bool {
    let mut decimals = false;
    let has_colors = roles.iter().any(|role| matches!(role, ColumnRole::Color(_)));
    for row in rows.iter().filter(|_| has_colors) {
        let fields = delimiter.fields(row);
        for (field, role) in fields.iter().zip(roles) {
            let color = matches!(role, ColumnRole::Color(_)).then(|| Number::parse(field)).flatten();
            if let Some(color) = color {
                if !(0.0..=1.0).contains(&color.value()) {
                    return false;
                }
                decimals |= color.shortest().decimals > 0;
            }
        }
    }
    decimals
}
