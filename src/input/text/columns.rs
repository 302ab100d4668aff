//! What the columns of a text mean and what parts them, as the options say or as the first lines show.

use std::cmp::Reverse;
use std::path::Path;

use memchr::{memchr, memchr2};

use crate::input::text::number::Number;
use crate::input::text::options::TextOptions;
use crate::{Error, Result};

/// What stands between two columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Delimiter {
    /// One character, with or without spaces around it.
    Byte(u8),
    /// Any run of spaces and tabs.
    Blank,
}

/// What is tried, in this order: a comma may stand beside spaces, and a tab within them.
const CANDIDATES: [Delimiter; 4] =
    [Delimiter::Byte(b';'), Delimiter::Byte(b'\t'), Delimiter::Byte(b','), Delimiter::Blank];

impl Delimiter {
    fn from_option(delimiter: char) -> Result<Delimiter> {
        match delimiter {
            ' ' => Ok(Delimiter::Blank),
            '\t' => Ok(Delimiter::Byte(b'\t')),
            ',' | ';' | '|' | ':' | '/' | '!' | '&' | '*' | '~' | '^' | '%' | '$' | '@' | '_' => {
                Ok(Delimiter::Byte(delimiter as u8))
            }
            _ => Err(Error::Config(format!(
                "[input.csv] delimiter = {delimiter:?} cannot part numbers; use a comma, a semicolon, a tab or a space"
            ))),
        }
    }

    /// The bytes of the column at the start of `line`, spaces and quotes taken off, and the rest of the line after the
    /// delimiter, if there is any.
    pub(crate) fn split<'a>(&self, line: &'a [u8]) -> (&'a [u8], Option<&'a [u8]>) {
        let line = if *self == Delimiter::Blank { line.trim_ascii_start() } else { line };
        let quoted = quoted_length(line.trim_ascii_start())
            .map_or(0, |length| length + line.len() - line.trim_ascii_start().len());
        let after = &line[quoted..];
        let (end, rest) = match self {
            Delimiter::Byte(byte) => match memchr(*byte, after) {
                Some(at) => (quoted + at, Some(&after[at + 1..])),
                None => (line.len(), None),
            },
            Delimiter::Blank => match memchr2(b' ', b'\t', after) {
                Some(at) => {
                    let rest = after[at..].trim_ascii_start();
                    (quoted + at, (!rest.is_empty()).then_some(rest))
                }
                None => (line.len(), None),
            },
        };
        (unquoted(line[..end].trim_ascii()), rest)
    }

    /// All columns of `line`.
    pub(crate) fn fields<'a>(&self, line: &'a [u8]) -> Vec<&'a [u8]> {
        let mut fields = Vec::new();
        let mut rest = Some(line);
        while let Some(line) = rest {
            let (field, after) = self.split(line);
            fields.push(field);
            rest = after;
        }
        fields
    }
}

/// The length of the quoted text that `line` begins with.
fn quoted_length(line: &[u8]) -> Option<usize> {
    let quote = *line.first().filter(|byte| matches!(byte, b'"' | b'\''))?;
    memchr(quote, &line[1..]).map(|at| at + 2)
}

fn unquoted(field: &[u8]) -> &[u8] {
    match field {
        [b'"', inner @ .., b'"'] | [b'\'', inner @ .., b'\''] => inner.trim_ascii(),
        _ => field,
    }
}

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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

fn role(name: &[u8]) -> ColumnRole {
    let name = String::from_utf8_lossy(name).trim().to_lowercase();
    NAMES.iter().find(|(names, _)| names.contains(&name.as_str())).map_or(ColumnRole::Skipped, |&(_, role)| role)
}

/// How the lines of a text are to be read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Columns {
    /// What parts the columns of a row.
    pub(crate) delimiter: Delimiter,
    /// What each column holds, up to the last that is used.
    pub(crate) roles: Vec<ColumnRole>,
    /// What lines to be skipped begin with.
    comments: Vec<Vec<u8>>,
}

/// The lines at the start of a text, and what to do with them.
pub(crate) struct DetectedColumns {
    pub(crate) columns: Columns,
    /// Whether the first line that is neither blank nor a comment is no row.
    pub(crate) header: bool,
    pub(crate) warnings: Vec<String>,
}

impl Columns {
    /// Finds out how the text in `path` is laid out, the first lines of which are `lines`.
    pub(crate) fn detect(path: &Path, lines: &[&[u8]], options: &TextOptions) -> Result<DetectedColumns> {
        let comments = comments(options)?;
        let rows: Vec<&[u8]> = lines.iter().copied().filter(|line| !skipped(line, &comments)).collect();
        let Some((&first, after)) = rows.split_first() else {
            return Err(Error::input(path, "has no line with numbers in it"));
        };
        let candidates = match options.delimiter {
            Some(delimiter) => vec![Delimiter::from_option(delimiter)?],
            None => CANDIDATES.to_vec(),
        };
        let header = options.header.unwrap_or_else(|| !candidates.iter().any(|d| numbers(*d, first) >= 3));
        let mut warnings = Vec::new();
        let named = header && options.columns.is_none() && !is_count(first);
        if header && is_count(first) {
            warnings.push("the first line holds one number, taken for the number of points and skipped".to_string());
        }
        let roles = match &options.columns {
            Some(names) => roles(names.iter().map(|name| name.as_bytes()))
                .map_err(|what| Error::Config(format!("[input.csv] columns {what}")))?,
            None if named => header_roles(&candidates_for_header(&candidates), first)
                .map_err(|what| Error::input(path, format!("the first line, {}, {what}", shown(first))))?,
            None => vec![ColumnRole::Coordinate(0), ColumnRole::Coordinate(1), ColumnRole::Coordinate(2)],
        };
        let delimiter = row_delimiter(&candidates, &roles, if header { after } else { &rows });
        let unnamed = !named && options.columns.is_none();
        if unnamed && rows.last().is_some_and(|row| delimiter.fields(row).len() > 3) {
            let what =
                "no line names the columns: the first three are taken for x, y and z; say otherwise with `columns`";
            warnings.push(format!("{what} under [input.csv]"));
        }
        Ok(DetectedColumns { columns: Columns { delimiter, roles, comments }, header, warnings })
    }

    /// Whether `line` is blank or a comment.
    #[inline]
    pub(crate) fn skips(&self, line: &[u8]) -> bool {
        skipped(line, &self.comments)
    }

    /// Whether a column holds what `wanted` says.
    pub(crate) fn have(&self, wanted: ColumnRole) -> bool {
        self.roles.contains(&wanted)
    }
}

const NOT_A_ROW: &str = "has neither three numbers nor names of columns; numbers have a point before their decimals, and a \
                         comma, a semicolon, a tab or spaces between them";

const ADVICE: &str = "name the columns with `columns` under [input.csv]";

fn comments(options: &TextOptions) -> Result<Vec<Vec<u8>>> {
    match &options.comment {
        Some(comment) if comment.is_empty() => Ok(Vec::new()),
        Some(comment) if comment.starts_with(|c: char| c.is_ascii_digit()) => Err(Error::Config(format!(
            "[input.csv] comment = {comment:?} would skip rows; it cannot begin with a digit"
        ))),
        Some(comment) => Ok(vec![comment.as_bytes().to_vec()]),
        None => Ok(vec![b"#".to_vec(), b"//".to_vec()]),
    }
}

#[inline]
fn skipped(line: &[u8], comments: &[Vec<u8>]) -> bool {
    // Most rows begin with a digit, and no comment does.
    if line.first().is_some_and(u8::is_ascii_digit) {
        return false;
    }
    let line = line.trim_ascii_start();
    line.is_empty() || comments.iter().any(|comment| line.starts_with(comment))
}

/// The number of columns of `line` that are numbers.
fn numbers(delimiter: Delimiter, line: &[u8]) -> usize {
    delimiter.fields(line).iter().filter(|field| is_number(field)).count()
}

fn is_number(field: &[u8]) -> bool {
    std::str::from_utf8(field).is_ok_and(|text| text.parse::<f64>().is_ok())
}

/// Whether `line` is one whole number, as some formats have it before the points.
fn is_count(line: &[u8]) -> bool {
    let line = line.trim_ascii();
    !line.is_empty() && line.iter().all(u8::is_ascii_digit)
}

/// Names may be parted by something else than the rows.
fn candidates_for_header(candidates: &[Delimiter]) -> Vec<Delimiter> {
    let others = CANDIDATES.iter().filter(|other| !candidates.contains(other));
    candidates.iter().chain(others).copied().collect()
}

/// The roles under the first delimiter that gives x, y and z, or what is wrong under the one that gives most columns.
fn header_roles(candidates: &[Delimiter], line: &[u8]) -> std::result::Result<Vec<ColumnRole>, String> {
    if !line.iter().any(|byte| byte.is_ascii_alphabetic()) {
        return Err(NOT_A_ROW.to_string());
    }
    let split = |delimiter: &Delimiter| roles(delimiter.fields(line).into_iter());
    if let Some(found) = candidates.iter().find_map(|delimiter| split(delimiter).ok()) {
        return Ok(found);
    }
    let most = candidates.iter().max_by_key(|delimiter| delimiter.fields(line).len());
    most.map_or(Err("cannot be read".to_string()), split).map_err(|what| format!("{what}; {ADVICE}"))
}

fn roles<'a>(names: impl Iterator<Item = &'a [u8]>) -> std::result::Result<Vec<ColumnRole>, String> {
    let mut roles: Vec<ColumnRole> = names.map(role).collect();
    for (names, role) in NAMES {
        let count = roles.iter().filter(|other| **other == role).count();
        if count > 1 {
            return Err(format!("names {count} columns {}", names[0]));
        }
        if count == 0 && matches!(role, ColumnRole::Coordinate(_)) {
            return Err(format!("names no column {}", names[0]));
        }
    }
    drop_partial_color(&mut roles);
    let used = roles.iter().rposition(|role| *role != ColumnRole::Skipped).map_or(0, |last| last + 1);
    roles.truncate(used);
    Ok(roles)
}

/// Colours count only where all three are there.
fn drop_partial_color(roles: &mut [ColumnRole]) {
    if !(0..3).all(|channel| roles.contains(&ColumnRole::Color(channel))) {
        for role in roles.iter_mut().filter(|role| matches!(role, ColumnRole::Color(_))) {
            *role = ColumnRole::Skipped;
        }
    }
}

/// The delimiter under which most rows have numbers as x, y and z; the first of those that are as good.
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

/// The start of `text` in quotes, for a message.
pub(crate) fn shown(text: &[u8]) -> String {
    const MOST: usize = 60;
    let text = String::from_utf8_lossy(&text[..text.len().min(4 * MOST)]).into_owned();
    let short: String = text.chars().take(MOST).collect();
    let dots = if short.len() < text.len() { "..." } else { "" };
    format!("{short:?}{dots}")
}
