//! A last line without its line end: whether it was cut off inside its last number.

use std::ops::Range;

use crate::Result;
use crate::input::file::random_access::RandomAccessFile;
use crate::input::text::columns::Columns;
use crate::input::text::lines::{shown, without_return};
use crate::input::text::row::RowReader;

/// The number of bytes at the end of a text with whose lines the last one is compared.
const TAIL: u64 = 1 << 17;

/// With fewer other rows, a last number that is shorter than theirs may be short by chance.
const LEAST_ROWS: usize = 8;

/// A last line that was cut off.
pub(crate) struct CutLine {
    /// The position of its first byte.
    pub(crate) at: u64,
    /// A sentence about it.
    pub(crate) what: String,
}

/// The form of a row: how many columns it has, and how many characters the last of them has after its point.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct RowEnd {
    columns: usize,
    after_point: usize,
}

impl RowEnd {
    fn of(columns: &Columns, line: &[u8]) -> RowEnd {
        let fields = columns.delimiter.fields(line);
        let last = fields.last().copied().unwrap_or_default();
        let point = last.iter().position(|byte| *byte == b'.');
        RowEnd { columns: fields.len(), after_point: point.map_or(0, |point| last.len() - point - 1) }
    }
}

/// Returns the last of the lines in `rows` if it has no line end, and fewer columns or fewer decimals than all before it.
pub(crate) fn find(file: &RandomAccessFile, columns: &Columns, rows: &Range<u64>) -> Result<Option<CutLine>> {
    let from = rows.start.max(rows.end.saturating_sub(TAIL));
    let tail = file.bytes(from..rows.end)?;
    let Some(feed) = tail.iter().rposition(|byte| *byte == b'\n') else { return Ok(None) };
    let last = &tail[feed + 1..];
    if columns.skips(last) || last.ends_with(b"\r") {
        return Ok(None);
    }
    let mut reader = RowReader::new(columns, true);
    // The tail may begin inside a line.
    let whole = tail[..feed].split(|byte| *byte == b'\n').skip((from > rows.start) as usize);
    let ends: Vec<RowEnd> = whole
        .map(without_return)
        .filter(|line| !columns.skips(line) && reader.read(line).is_ok())
        .map(|line| RowEnd::of(columns, line))
        .collect();
    let (Some(least), own) = (ends.iter().min(), RowEnd::of(columns, last)) else { return Ok(None) };
    let decimals = ends.iter().map(|end| end.after_point).min().unwrap_or(0);
    let less = if own.columns < least.columns {
        format!("only {} of {} columns", own.columns, least.columns)
    } else if own.columns == least.columns && own.after_point < decimals {
        format!("fewer decimals in its last column than all before it, {} and not {decimals}", own.after_point)
    } else {
        return Ok(None);
    };
    let what = format!(
        "{} has no line end and {less}: the file seems to be cut off there. Copy it again, or end the line if it is whole",
        shown(last)
    );
    Ok((ends.len() >= LEAST_ROWS).then(|| CutLine { at: from + feed as u64 + 1, what }))
}
