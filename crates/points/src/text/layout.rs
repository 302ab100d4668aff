//! The start of a text: how it is laid out, and where its rows begin.

use crate::file::random_access::RandomAccessFile;
use crate::text::columns::{Columns, comments};
use crate::text::lines::{is_skipped, without_return};
use crate::text::lines_between::TextStart;
use crate::text::options::TextOptions;
use crate::text::row_choice::RowChoice;
use crate::text::units::UnitsOfAxes;
use sys::{Error, Result, Warnings};

/// The number of bytes at the start of a text that show how it is laid out. If all of them are comments, more are looked at.
const SAMPLE: u64 = 1 << 17;

/// The most bytes of comments before the first row.
const MOST_COMMENTS: u64 = 1 << 26;

/// Where the rows of a text begin.
pub(crate) struct FirstRow {
    /// The position of its first byte.
    pub(crate) at: u64,
    /// The number of its line.
    pub(crate) line: u64,
}

/// How a text is laid out.
pub(crate) struct Layout {
    pub(crate) columns: Columns,
    pub(crate) first: FirstRow,
    /// The number of rows, if the first line holds it.
    pub(crate) promised: Option<u64>,
    pub(crate) named_degrees: bool,
    pub(crate) units: UnitsOfAxes,
    /// What lines among the rows are compared with.
    pub(crate) start: TextStart,
}

/// Finds out how the text is laid out and where its rows begin.
pub(crate) fn detect(
    file: &RandomAccessFile,
    options: &TextOptions,
    choice: &RowChoice,
    warnings: &mut Warnings,
) -> Result<Layout> {
    let sample = sample(file, &comments(options)?)?;
    refuse_old_line_ends(file, &sample)?;
    let mark = mark_length(&sample);
    let mut lines: Vec<&[u8]> = sample[mark..].split(|&byte| byte == b'\n').collect();
    if lines.len() > 1 && file.size() > sample.len() as u64 {
        // The sample may end in the middle of the last line.
        lines.pop();
    }
    let plain: Vec<&[u8]> = lines.iter().copied().map(without_return).collect();
    let found = Columns::detect(file.path(), &plain, options, choice, warnings)?;
    let before: usize = lines[..found.header_lines].iter().map(|line| line.len() + 1).sum();
    let at = ((mark + before) as u64).min(file.size());
    let first = FirstRow { at, line: found.header_lines as u64 + 1 };
    let promised = found.promised;
    let (columns, named_degrees) = (found.columns, found.degrees);
    Ok(Layout { columns, first, promised, named_degrees, units: found.units, start: found.start })
}

/// Fails if lines end with carriage returns alone.
fn refuse_old_line_ends(file: &RandomAccessFile, sample: &[u8]) -> Result<()> {
    let is_between_lines = sample.iter().position(|byte| *byte == b'\r').is_some_and(|at| at + 1 < sample.len());
    if !is_between_lines || sample.contains(&b'\n') {
        return Ok(());
    }
    let what = "has lines that end with a carriage return alone, as on old Macs: write it again with line feeds, for example with \
                `tr '\\r' '\\n' < old.txt > new.txt`";
    Err(Error::input(file.path(), what))
}

/// Returns the length of the byte order mark that `text` begins with.
fn mark_length(text: &[u8]) -> usize {
    if text.starts_with(&[0xef, 0xbb, 0xbf]) { 3 } else { 0 }
}

/// Returns the start of a text: what comes before the first row, and some rows.
fn sample(file: &RandomAccessFile, comments: &[String]) -> Result<Vec<u8>> {
    let mut length = SAMPLE;
    loop {
        let sample = file.bytes(0..file.size().min(length))?;
        let lines = sample[mark_length(&sample)..].split(|&byte| byte == b'\n');
        let before = lines.take_while(|line| is_skipped(without_return(line), comments));
        let skipped: u64 = before.map(|line| line.len() as u64 + 1).sum();
        let wanted = skipped + SAMPLE;
        if wanted <= length || sample.len() as u64 == file.size() {
            return Ok(sample);
        }
        if length >= MOST_COMMENTS {
            let what = format!("has no line with numbers in its first {} MiB", MOST_COMMENTS >> 20);
            return Err(Error::input(file.path(), what));
        }
        // A line of comment may go on after the sample.
        length = wanted.max(length * 2);
    }
}
