//! A last line without its line end: whether it was cut off inside its last number.

use std::ops::Range;

use crate::file::random_access::RandomAccessFile;
use crate::text::columns::Columns;
use crate::text::lines::{shown, without_return};
use crate::text::row::RowReader;
use sys::Result;

/// The number of bytes at the end of a text with whose lines the last one is compared.
const TAIL: u64 = 1 << 17;

/// With fewer other rows, a last number that is shorter than theirs may be short by chance.
const LEAST_ROWS: usize = 8;

/// What the end of a text shows.
pub(crate) enum Ending {
    /// Nothing is wrong.
    Whole,
    /// The last line may be cut off; a sentence about it.
    Doubtful(String),
    /// The last line is cut off.
    CutOff(CutLine),
}

/// A last line that was cut off.
pub(crate) struct CutLine {
    /// The position of its first byte.
    pub(crate) at: u64,
    /// A sentence about it.
    pub(crate) what: String,
}

/// The form of a row: how many columns it has, how many characters the last of them has after its point, and how many it has.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct RowEnd {
    columns: usize,
    after_point: usize,
    characters: usize,
}

impl RowEnd {
    fn of(columns: &Columns, line: &[u8]) -> RowEnd {
        let fields = columns.delimiter.fields(line);
        let last = fields.last().copied().unwrap_or_default();
        let point = last.iter().position(|byte| *byte == columns.decimal_sign());
        RowEnd {
            columns: fields.len(),
            after_point: point.map_or(0, |point| last.len() - point - 1),
            characters: last.len(),
        }
    }
}

/// Looks at the last of the lines in `rows`. It is cut off if it has no line end, and fewer columns or fewer decimals than all before it.
/// If it has fewer digits it may be.
pub(crate) fn find(file: &RandomAccessFile, columns: &Columns, rows: &Range<u64>) -> Result<Ending> {
    let from = rows.start.max(rows.end.saturating_sub(TAIL));
    let tail = file.bytes(from..rows.end)?;
    let Some(feed) = tail.iter().rposition(|byte| *byte == b'\n') else { return Ok(Ending::Whole) };
    let last = &tail[feed + 1..];
    if columns.skips(last) || last.ends_with(b"\r") {
        return Ok(Ending::Whole);
    }
    let mut reader = RowReader::new(columns);
    // The tail may begin inside a line.
    let whole = tail[..feed].split(|byte| *byte == b'\n').skip((from > rows.start) as usize);
    let ends: Vec<RowEnd> = whole
        .map(without_return)
        .filter(|line| !columns.skips(line) && reader.read(line).is_ok())
        .map(|line| RowEnd::of(columns, line))
        .collect();
    let (Some(least), own) = (ends.iter().map(|end| end.columns).min(), RowEnd::of(columns, last)) else {
        return Ok(Ending::Whole);
    };
    if ends.len() < LEAST_ROWS || own.columns > least {
        return Ok(Ending::Whole);
    }
    let least_of = |part: fn(&RowEnd) -> usize| ends.iter().map(part).min().unwrap_or(0);
    let (decimals, characters) = (least_of(|end| end.after_point), least_of(|end| end.characters));
    let (is_sure, less) = if own.columns < least {
        (true, format!("only {} of {least} columns", own.columns))
    } else if own.after_point < decimals {
        let own = own.after_point;
        (true, format!("fewer decimals in its last column than all before it, {own} and not {decimals}"))
    } else if own.characters < characters && decimals == 0 {
        (false, "fewer digits in its last column than all before it".to_string())
    } else {
        return Ok(Ending::Whole);
    };
    let last = shown(last);
    if !is_sure {
        return Ok(Ending::Doubtful(format!(
            "the last line, {last}, has no line end and {less}: the file may be cut off; fix: copy the file again"
        )));
    }
    let what = format!(
        "{last} has no line end and {less}: the file seems to be cut off there. Copy it again, or end the line if it is whole"
    );
    Ok(Ending::CutOff(CutLine { at: from + feed as u64 + 1, what }))
}
