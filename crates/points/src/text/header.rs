//! The lines before the first row: titles, the names of columns, units, the number of points.

use crate::text::delimiter::{CANDIDATES, Delimiter};
use crate::text::lines::shown;
use crate::text::names::{NamedColumns, NamesError, coordinates, named_columns};
use crate::text::role::ColumnRole;

/// The number of rows whose columns are compared with the names in a header.
pub(crate) const ROWS_FOR_NAMES: usize = 20;

/// What is wrong with a line that should name the columns.
#[derive(Debug, thiserror::Error)]
pub(crate) enum HeaderLineError {
    #[error(
        "has neither three numbers nor names of columns; numbers have a point before their decimals, and a comma, a semicolon, \
         a tab or spaces between them"
    )]
    NoNames,
    #[error("is not a point count as in PTS, which has only digits: correct it, or remove the line")]
    NoCount,
    #[error("is too large for a number of points: correct it, or remove the line")]
    LargeCount,
    #[error("{0}; name the columns with `columns` under [input.csv]")]
    Names(#[from] NamesError),
    #[error(
        "looks like names of {names} columns, and the rows have {rows}; name the columns with `columns` under [input.csv]"
    )]
    OtherCount { names: usize, rows: usize },
    #[error("{0}")]
    Units(String),
}

/// The lines before the first row.
pub(crate) struct Header {
    /// How many of the lines that are neither blank nor a comment come before the first row.
    pub(crate) lines: usize,
    /// What the columns are called; an error if a line should say it and does not.
    pub(crate) names: Option<Result<NamedColumns, String>>,
    /// The number of points, if the first of the lines holds it.
    pub(crate) count: Option<u64>,
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
        return Header { lines: 0, names: None, count: None };
    }
    // Without any row, the first line is what the message is about.
    let lines = if before == rows.len() { &rows[..1] } else { &rows[..before] };
    let data = &rows[before..];
    let names = |line: &[u8]| header_names(candidates, line, data);
    let found = lines.iter().enumerate().rev().find_map(|(at, line)| Some((at, names(line).ok()?)));
    // After the names there may be units. A line with a number in it is a row that is broken.
    let is_about_rows = |line: &&&[u8]| candidates.iter().all(|delimiter| delimiter.numbers(line) == 0);
    let after = |at: usize| at + 1 + lines[at + 1..].iter().take_while(is_about_rows).count();
    match found {
        Some((at, names)) => {
            let (before, after) = (&lines[at], after(at));
            let named = with_units(names, &lines[at + 1..after]);
            let named = named.map_err(|error| format!("the line of names, {}, {error}", shown(before)));
            let count = if at > 0 { count_in(lines[0]) } else { None };
            Header { lines: after, names: Some(named), count }
        }
        None if named => Header { lines: after(0), names: None, count: count_in(lines[0]) },
        None if count_in(lines[0]).is_some() => Header { lines: 1, names: None, count: count_in(lines[0]) },
        None => {
            let (what, line) = line_of_most_names(lines);
            let error = match line.trim_ascii() {
                line if !line.is_empty() && line.iter().all(u8::is_ascii_digit) => Some(HeaderLineError::LargeCount),
                line if is_like_count(line) => Some(HeaderLineError::NoCount),
                line => names(line).err(),
            };
            let error = error.map(|error| error.to_string()).unwrap_or_default();
            Header { lines: 1, names: Some(Err(format!("{what}, {}, {error}", shown(line)))), count: None }
        }
    }
}

/// Returns the line that names most of x, y and z, and what to call it. Titles and comments may stand before it.
fn line_of_most_names<'a>(lines: &[&'a [u8]]) -> (&'static str, &'a [u8]) {
    let named = |line: &[u8]| CANDIDATES.iter().map(|own| coordinates(without_mark(*own, line).1.into_iter())).max();
    // Of several, the first.
    let most = lines.iter().skip(1).rev().max_by_key(|line| named(line)).filter(|line| named(line) > named(lines[0]));
    match most {
        Some(line) if named(line) >= Some(2) => ("the line of names", line),
        _ => ("the first line", lines[0]),
    }
}

/// Returns these names with the units of the lines below them.
fn with_units(mut names: NamedColumns, below: &[&[u8]]) -> Result<NamedColumns, HeaderLineError> {
    for line in below {
        for delimiter in CANDIDATES {
            names.add_units(&delimiter.fields(line)).map_err(HeaderLineError::Units)?;
        }
    }
    names.units().map_err(HeaderLineError::Units)?;
    Ok(names)
}

/// Returns a sentence about a line among the first of these rows that is none, but names x, y and z: a title with numbers in it may stand
/// before it.
pub(crate) fn names_among_rows(rows: &[&[u8]], candidates: &[Delimiter]) -> Option<String> {
    let is_row = |line: &[u8]| candidates.iter().any(|delimiter| delimiter.numbers(line) >= 3);
    let has_names = |line: &&&[u8]| !is_row(line) && header_names(candidates, line, &[]).is_ok();
    rows.iter().take(ROWS_FOR_NAMES).find(has_names).map(|line| {
        format!(
            "the line {} names the columns, but a line with three numbers in it stands before it: remove what comes before the names, or \
             name the columns with `columns` under [input.csv]",
            shown(line)
        )
    })
}

/// Returns the delimiter that the line `sep=;` names, which Excel reads and writes before a table.
pub(crate) fn separator_line(line: &[u8]) -> Option<char> {
    let text = std::str::from_utf8(line).ok()?.trim_start_matches('"').trim_end_matches(['"', ' ']);
    let (name, separator) = text.split_at_checked(4)?;
    let mut characters = separator.chars();
    let separator = characters.next().filter(|_| characters.next().is_none())?;
    name.eq_ignore_ascii_case("sep=").then_some(separator)
}

/// Returns the whole number that `line` is. Some formats have a line with the number of points before the points.
fn count_in(line: &[u8]) -> Option<u64> {
    let line = line.trim_ascii();
    let digits = std::str::from_utf8(line).ok().filter(|line| line.bytes().all(|byte| byte.is_ascii_digit()));
    digits?.parse().ok()
}

/// Returns whether a line may be meant as a number of points: one number with signs between thousands, a sign or a word beside it.
fn is_like_count(line: &[u8]) -> bool {
    let text = String::from_utf8_lossy(line).to_lowercase();
    let is_beside = |c: char| !c.is_ascii_digit();
    let number = text.trim_matches(is_beside);
    let words = ["", "points", "pts", "count", "number of points"];
    let beside = text.replace(number, "");
    !number.is_empty()
        && words.contains(&beside.trim_matches(|c: char| !c.is_alphabetic()))
        && number
            .chars()
            .all(|c| c.is_ascii_digit() || matches!(c, '.' | ',' | ' ' | '\'' | '_' | '\u{a0}' | 'e' | '+'))
        && number
            .split(is_beside)
            .skip(1)
            .all(|group| group.len() == 3 || number.contains(['e']) || number.ends_with(".0"))
}

/// Returns what `line` names under the first delimiter that gives x, y and z and fits `rows`, or what is wrong under the delimiter that
/// gives most of x, y and z, and of several the one that gives as many columns as there are, or most. All delimiters are tried, the `candidates` for the rows first: a header may use another one.
pub(crate) fn header_names(
    candidates: &[Delimiter],
    line: &[u8],
    rows: &[&[u8]],
) -> Result<NamedColumns, HeaderLineError> {
    if !line.iter().any(|byte| byte.is_ascii_alphabetic()) {
        return Err(HeaderLineError::NoNames);
    }
    let others = CANDIDATES.iter().filter(|other| !candidates.contains(other));
    let all: Vec<Delimiter> = candidates.iter().chain(others).copied().collect();
    let split = |delimiter: &Delimiter| {
        let (mark, fields) = without_mark(*delimiter, line);
        named_columns(fields.into_iter()).map(|names| (mark, names))
    };
    let found: Vec<(Delimiter, bool, NamedColumns)> = all
        .iter()
        .filter_map(|delimiter| split(delimiter).ok().map(|(mark, names)| (*delimiter, mark, names)))
        .collect();
    let fits = |(delimiter, mark, names): &&(Delimiter, bool, NamedColumns)| {
        let may_be_name = *mark && has_width(names.count + 1, candidates, rows);
        !may_be_name && fits_rows(*delimiter, names, candidates, rows)
    };
    if let Some((_, _, names)) = found.iter().find(fits) {
        return Ok(names.clone());
    }
    if let Some((_, _, names)) = found.first() {
        let columns = |row: &&[u8]| candidates.iter().find(|d| d.numbers(row) >= 3).map(|d| columns_of(*d, row));
        let rows = rows.first().and_then(columns).unwrap_or(0);
        return Err(HeaderLineError::OtherCount { names: names.count, rows });
    }
    let most = all.iter().max_by_key(|delimiter| {
        let fields = delimiter.fields(line);
        let fits = rows.first().is_some_and(|row| columns_of(**delimiter, row) == fields.len());
        (coordinates(fields.iter().copied()), fits, fields.len())
    });
    Ok(split(most.unwrap_or(&Delimiter::Blank))?.1)
}

/// Returns the fields of a line of names without what may stand before them, as in `% x y z` or `Columns: x y z`, and whether that was a
/// mark, which may also be the name of a column.
fn without_mark(delimiter: Delimiter, line: &[u8]) -> (bool, Vec<&[u8]>) {
    let mut fields = delimiter.fields(line);
    let is_title = |field: &&[u8]| field.len() > 1 && field.ends_with(b":");
    let title = fields.iter().rposition(is_title).filter(|at| delimiter == Delimiter::Blank && at + 3 < fields.len());
    if let Some(last) = title {
        fields.drain(..=last);
    }
    let is_mark = fields.first().is_some_and(|first| !first.is_empty() && first.iter().all(u8::is_ascii_punctuation));
    if is_mark && fields.len() > 3 {
        fields.remove(0);
        return (true, fields);
    }
    (false, fields)
}

/// Returns whether rows have so many columns.
fn has_width(width: usize, candidates: &[Delimiter], rows: &[&[u8]]) -> bool {
    let rows = rows.iter().take(ROWS_FOR_NAMES);
    let mut readings = rows.flat_map(|row| candidates.iter().map(move |own| (*own, *row)));
    readings.any(|(own, row)| own.numbers(row) >= 3 && columns_of(own, row) == width)
}

/// Returns whether names that this delimiter parts can be those of the columns of `rows`: as many, or with the delimiter of the rows and
/// x, y and z among their columns. A title such as "My x y z file" names some by chance.
fn fits_rows(delimiter: Delimiter, names: &NamedColumns, candidates: &[Delimiter], rows: &[&[u8]]) -> bool {
    let is_coordinate = |role: &ColumnRole| matches!(role, ColumnRole::Coordinate(_));
    let needed = names.roles.iter().rposition(is_coordinate).map_or(0, |last| last + 1);
    let fits = |(own, row): (Delimiter, &[u8])| {
        let columns = columns_of(own, row);
        columns == names.count || (own == delimiter && columns >= needed)
    };
    let rows = rows.iter().take(ROWS_FOR_NAMES);
    let readings = rows.flat_map(|row| candidates.iter().map(move |own| (*own, *row)));
    let mut with_numbers = readings.filter(|(own, row)| own.numbers(row) >= 3).peekable();
    with_numbers.peek().is_none() || with_numbers.any(fits)
}

/// Returns the number of columns, without an empty last one.
pub(crate) fn columns_of(delimiter: Delimiter, row: &[u8]) -> usize {
    let fields = delimiter.fields(row);
    fields.len() - fields.last().is_some_and(|last| last.is_empty()) as usize
}
