//! The lines before the first row: titles, the names of columns, units, the number of points.

use crate::input::text::delimiter::{CANDIDATES, Delimiter};
use crate::input::text::lines::{is_skipped, shown};
use crate::input::text::names::{NamedColumns, NamesError, named_columns};

/// What is wrong with a line that should name the columns.
#[derive(Debug, thiserror::Error)]
pub(crate) enum HeaderLineError {
    #[error(
        "has neither three numbers nor names of columns; numbers have a point before their decimals, and a comma, a semicolon, \
         a tab or spaces between them"
    )]
    NoNames,
    #[error("{0}; name the columns with `columns` under [input.csv]")]
    Names(#[from] NamesError),
}

/// The lines before the first row.
pub(crate) struct Header {
    /// How many of the lines that are neither blank nor a comment come before the first row.
    pub(crate) lines: usize,
    /// What the columns are called; an error if a line should say it and does not.
    pub(crate) names: Option<Result<NamedColumns, String>>,
    /// Whether one of the lines holds the number of points.
    pub(crate) count: bool,
}

/// Returns what the lines before the first row say. `rows` are the first lines that are neither blank nor a comment. `named` tells
/// whether the user names the columns, and `wanted` whether there is a header; without it, the rows decide.
pub(crate) fn find(rows: &[&[u8]], candidates: &[Delimiter], wanted: Option<bool>, named: bool) -> Header {
    let is_row = |line: &&&[u8]| candidates.iter().any(|delimiter| delimiter.numbers(line) >= 3);
    let before = rows.iter().take_while(|line| !is_row(line)).count();
    let before = match wanted {
        Some(false) => 0,
        Some(true) => before.max(1),
        None => before,
    };
    if before == 0 {
        return Header { lines: 0, names: None, count: false };
    }
    // Without any row, the first line is what the message is about.
    let lines = if before == rows.len() { &rows[..1] } else { &rows[..before] };
    let found = lines.iter().enumerate().rev().find_map(|(at, line)| Some((at, header_names(candidates, line).ok()?)));
    // After the names there may be units. A line with a number in it is a row that is broken.
    let is_about_rows = |line: &&&[u8]| candidates.iter().all(|delimiter| delimiter.numbers(line) == 0);
    let after = |at: usize| at + 1 + lines[at + 1..].iter().take_while(is_about_rows).count();
    match found {
        Some((at, names)) => Header { lines: after(at), names: Some(Ok(names)), count: false },
        None if named => Header { lines: after(0), names: None, count: is_count(lines[0]) },
        None if is_count(lines[0]) => Header { lines: 1, names: None, count: true },
        None => {
            let error = header_names(candidates, lines[0]).err().map(|error| error.to_string()).unwrap_or_default();
            Header { lines: 1, names: Some(Err(format!("the first line, {}, {error}", shown(lines[0])))), count: false }
        }
    }
}

/// Returns the names in the last comment before the first row that names as many columns as `row` has.
pub(crate) fn names_in_comments(
    lines: &[&[u8]],
    comments: &[String],
    candidates: &[Delimiter],
    row: &[u8],
) -> Option<NamedColumns> {
    let starts = lines.iter().filter(|line| !line.trim_ascii().is_empty() && is_skipped(line, comments));
    let named = |line: &&[u8]| {
        let line = line.trim_ascii_start();
        let comment = comments.iter().find(|comment| line.starts_with(comment.as_bytes()))?;
        let text = &line[comment.len()..];
        let marks = text.iter().take_while(|byte| matches!(byte, b'#' | b'/')).count();
        let names = header_names(candidates, text[marks..].trim_ascii()).ok()?;
        let fits = |delimiter: &Delimiter| delimiter.numbers(row) >= 3 && delimiter.fields(row).len() == names.count;
        candidates.iter().any(fits).then_some(names)
    };
    starts.rev().find_map(named)
}

/// Returns the delimiter that the line `sep=;` names, which Excel reads and writes before a table.
pub(crate) fn separator_line(line: &[u8]) -> Option<char> {
    let text = std::str::from_utf8(line).ok()?.trim_start_matches('"').trim_end_matches(['"', ' ']);
    let (name, separator) = text.split_at_checked(4)?;
    let mut characters = separator.chars();
    let separator = characters.next().filter(|_| characters.next().is_none())?;
    name.eq_ignore_ascii_case("sep=").then_some(separator)
}

/// Returns whether `line` is one whole number. Some formats have a line with the number of points before the points.
fn is_count(line: &[u8]) -> bool {
    let line = line.trim_ascii();
    !line.is_empty() && line.iter().all(u8::is_ascii_digit)
}

/// Returns what `line` names under the first delimiter that gives x, y and z, or what is wrong under the delimiter that gives most
/// columns. All delimiters are tried, the `candidates` for the rows first: a header may use another one.
fn header_names(candidates: &[Delimiter], line: &[u8]) -> Result<NamedColumns, HeaderLineError> {
    if !line.iter().any(|byte| byte.is_ascii_alphabetic()) {
        return Err(HeaderLineError::NoNames);
    }
    let others = CANDIDATES.iter().filter(|other| !candidates.contains(other));
    let candidates: Vec<Delimiter> = candidates.iter().chain(others).copied().collect();
    let split = |delimiter: &Delimiter| named_columns(delimiter.fields(line).into_iter());
    if let Some(found) = candidates.iter().find_map(|delimiter| split(delimiter).ok()) {
        return Ok(found);
    }
    let most = candidates.iter().max_by_key(|delimiter| delimiter.fields(line).len());
    Ok(split(most.unwrap_or(&Delimiter::Blank))?)
}
