//! What the columns of a text mean, as the options say or as the first lines show.

use std::cmp::Reverse;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::input::text::delimiter::{CANDIDATES, Delimiter};
use crate::input::text::number::Number;
use crate::input::text::options::TextOptions;
use crate::{Error, Result, Warnings};

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum ColumnRole {
    /// x, y or z.
    Coordinate(usize),
    /// Red, green or blue.
    Color(usize),
    /// The classification.
    Class,
    /// Nothing of use.
    Skipped,
}

/// The names that people give to columns.
const NAMES: [(&[&str], ColumnRole); 7] = [
    (&["x", "easting", "east", "lon", "long", "longitude"], ColumnRole::Coordinate(0)),
    (&["y", "northing", "north", "lat", "latitude"], ColumnRole::Coordinate(1)),
    (&["z", "elevation", "elev", "height", "altitude", "alt"], ColumnRole::Coordinate(2)),
    (&["r", "red"], ColumnRole::Color(0)),
    (&["g", "green"], ColumnRole::Color(1)),
    (&["b", "blue"], ColumnRole::Color(2)),
    (&["class", "classification"], ColumnRole::Class),
];

/// What is wrong with the names of columns.
#[derive(Debug, thiserror::Error)]
enum NamesError {
    #[error("names {count} columns {name}")]
    Repeated { count: usize, name: &'static str },
    #[error("names no column {0}")]
    Missing(&'static str),
}

/// What is wrong with a line that should name the columns.
#[derive(Debug, thiserror::Error)]
enum HeaderLineError {
    #[error(
        "has neither three numbers nor names of columns; numbers have a point before their decimals, and a comma, a semicolon, \
         a tab or spaces between them"
    )]
    NoNames,
    #[error("{0}; name the columns with `columns` under [input.csv]")]
    Names(#[from] NamesError),
}

/// How the lines of a text are to be read.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Columns {
    /// What separates the columns of a row.
    pub(crate) delimiter: Delimiter,
    /// What each column holds, up to the last column that is used.
    pub(crate) roles: Vec<ColumnRole>,
    /// Lines that begin with one of these are skipped.
    comments: Vec<String>,
}

/// What the lines at the start of a text show.
pub(crate) struct DetectedColumns {
    pub(crate) columns: Columns,
    /// Whether the first line that is neither blank nor a comment is no row.
    pub(crate) header: bool,
}

impl Columns {
    /// Finds out how the text in `path` is laid out; `lines` are its first lines.
    pub(crate) fn detect(
        path: &Path,
        lines: &[&[u8]],
        options: &TextOptions,
        warnings: &mut Warnings,
    ) -> Result<DetectedColumns> {
        let comments = comments(options)?;
        let rows: Vec<&[u8]> = lines.iter().copied().filter(|line| !is_skipped(line, &comments)).collect();
        let Some((&first, after)) = rows.split_first() else {
            return Err(Error::input(path, "has no line with numbers in it"));
        };
        let candidates = match options.delimiter {
            Some(delimiter) => vec![Delimiter::from_option(delimiter)?],
            None => CANDIDATES.to_vec(),
        };
        let header = options.header.unwrap_or_else(|| !candidates.iter().any(|d| numbers(*d, first) >= 3));
        let named = header && options.columns.is_none() && !is_count(first);
        if header && is_count(first) {
            warnings.push("the first line holds one number, taken for the number of points and skipped");
        }
        let roles = match &options.columns {
            Some(names) => roles(names.iter().map(|name| name.as_bytes()))
                .map_err(|error| Error::Config(format!("[input.csv] columns {error}")))?,
            None if named => header_roles(&candidates, first)
                .map_err(|error| Error::input(path, format!("the first line, {}, {error}", shown(first))))?,
            None => vec![ColumnRole::Coordinate(0), ColumnRole::Coordinate(1), ColumnRole::Coordinate(2)],
        };
        let delimiter = row_delimiter(&candidates, &roles, if header { after } else { &rows });
        let unnamed = !named && options.columns.is_none();
        if unnamed && rows.last().is_some_and(|row| delimiter.fields(row).len() > 3) {
            warnings.push(
                "no line names the columns: the first three are taken for x, y and z; say otherwise with `columns` under \
                 [input.csv]",
            );
        }
        Ok(DetectedColumns { columns: Columns { delimiter, roles, comments }, header })
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

fn comments(options: &TextOptions) -> Result<Vec<String>> {
    match &options.comment {
        Some(comment) if comment.is_empty() => Ok(Vec::new()),
        Some(comment) if comment.starts_with(|c: char| c.is_ascii_digit()) => Err(Error::Config(format!(
            "[input.csv] comment = {comment:?} would skip rows; it cannot begin with a digit"
        ))),
        Some(comment) => Ok(vec![comment.clone()]),
        None => Ok(vec!["#".to_string(), "//".to_string()]),
    }
}

#[inline]
fn is_skipped(line: &[u8], comments: &[String]) -> bool {
    // Most rows begin with a digit, and no comment does.
    if line.first().is_some_and(u8::is_ascii_digit) {
        return false;
    }
    let line = line.trim_ascii_start();
    line.is_empty() || comments.iter().any(|comment| line.starts_with(comment.as_bytes()))
}

/// Returns the number of columns of `line` that are numbers.
fn numbers(delimiter: Delimiter, line: &[u8]) -> usize {
    delimiter.fields(line).iter().filter(|field| is_number(field)).count()
}

fn is_number(field: &[u8]) -> bool {
    std::str::from_utf8(field).is_ok_and(|text| text.parse::<f64>().is_ok())
}

/// Returns whether `line` is one whole number. Some formats have a line with the number of points before the points.
fn is_count(line: &[u8]) -> bool {
    let line = line.trim_ascii();
    !line.is_empty() && line.iter().all(u8::is_ascii_digit)
}

/// Returns the roles that `line` names under the first delimiter that gives x, y and z, or what is wrong under the delimiter that
/// gives most columns. All delimiters are tried, the `candidates` for the rows first: a header may use another one.
fn header_roles(candidates: &[Delimiter], line: &[u8]) -> std::result::Result<Vec<ColumnRole>, HeaderLineError> {
    if !line.iter().any(|byte| byte.is_ascii_alphabetic()) {
        return Err(HeaderLineError::NoNames);
    }
    let others = CANDIDATES.iter().filter(|other| !candidates.contains(other));
    let candidates: Vec<Delimiter> = candidates.iter().chain(others).copied().collect();
    let split = |delimiter: &Delimiter| roles(delimiter.fields(line).into_iter());
    if let Some(found) = candidates.iter().find_map(|delimiter| split(delimiter).ok()) {
        return Ok(found);
    }
    let most = candidates.iter().max_by_key(|delimiter| delimiter.fields(line).len());
    Ok(split(most.unwrap_or(&Delimiter::Blank))?)
}

fn roles<'a>(names: impl Iterator<Item = &'a [u8]>) -> std::result::Result<Vec<ColumnRole>, NamesError> {
    let mut roles: Vec<ColumnRole> = names.map(role).collect();
    for (names, role) in NAMES {
        let count = roles.iter().filter(|other| **other == role).count();
        if count > 1 {
            return Err(NamesError::Repeated { count, name: names[0] });
        }
        if count == 0 && matches!(role, ColumnRole::Coordinate(_)) {
            return Err(NamesError::Missing(names[0]));
        }
    }
    drop_partial_color(&mut roles);
    let used = roles.iter().rposition(|role| *role != ColumnRole::Skipped).map_or(0, |last| last + 1);
    roles.truncate(used);
    Ok(roles)
}

fn role(name: &[u8]) -> ColumnRole {
    let name = String::from_utf8_lossy(name).trim().to_lowercase();
    NAMES.iter().find(|(names, _)| names.contains(&name.as_str())).map_or(ColumnRole::Skipped, |&(_, role)| role)
}

/// Skips the columns of colours unless red, green and blue are all there.
fn drop_partial_color(roles: &mut [ColumnRole]) {
    if !(0..3).all(|channel| roles.contains(&ColumnRole::Color(channel))) {
        for role in roles.iter_mut().filter(|role| matches!(role, ColumnRole::Color(_))) {
            *role = ColumnRole::Skipped;
        }
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

/// Returns the start of `text` in quotes, for a message.
pub(crate) fn shown(text: &[u8]) -> String {
    const MOST: usize = 60;
    let text = String::from_utf8_lossy(&text[..text.len().min(4 * MOST)]).into_owned();
    let short: String = text.chars().take(MOST).collect();
    let dots = if short.len() < text.len() { "..." } else { "" };
    format!("{short:?}{dots}")
}
