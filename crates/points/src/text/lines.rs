//! The lines of a chunk of text. A line belongs to the chunk in which it begins.

use std::ops::Range;

use memchr::memchr;

use crate::file::random_access::RandomAccessFile;
use crate::windows_1252::decoded;
use sys::Result;

/// The longest line that is read, in bytes.
pub(crate) const LONGEST: usize = 1 << 16;

/// A line without its line end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TextLine<'a> {
    /// The line's bytes.
    Whole(&'a [u8]),
    /// A line of more than [`LONGEST`] bytes.
    TooLong,
}

/// Calls `each` for every line that begins in `range`, with the line's number from 0. Lines begin at byte `first` of the file and
/// after each line feed. Returns the number of lines.
pub(crate) fn for_each_line(
    file: &RandomAccessFile,
    first: u64,
    range: Range<u64>,
    mut each: impl FnMut(u64, TextLine) -> Result<()>,
) -> Result<u64> {
    let begins_line = range.start == first;
    let Range { start: from, end: to } = bytes_around(first, &range, file.size());
    let text = file.bytes(from..to)?;
    let end = (range.end - from) as usize;
    let mut at = if begins_line { 0 } else { memchr(b'\n', &text).map_or(end, |feed| feed + 1) };
    let mut count = 0;
    while at < end {
        let feed = memchr(b'\n', &text[at..]);
        let length = feed.unwrap_or(text.len() - at);
        let cut = feed.is_none() && to < file.size();
        let line = if cut || length > LONGEST {
            TextLine::TooLong
        } else {
            TextLine::Whole(without_return(&text[at..at + length]))
        };
        each(count, line)?;
        count += 1;
        at += length + 1;
    }
    Ok(count)
}

/// Returns the bytes that [`for_each_line`] reads of a file of `size` bytes.
pub(crate) fn bytes_around(first: u64, range: &Range<u64>, size: u64) -> Range<u64> {
    range.start - (range.start != first) as u64..(range.end + LONGEST as u64).min(size)
}

/// Returns the line without the carriage return at its end.
pub(crate) fn without_return(line: &[u8]) -> &[u8] {
    line.strip_suffix(b"\r").unwrap_or(line)
}

/// Returns whether `line` is blank or begins with one of `comments`.
#[inline]
pub(crate) fn is_skipped(line: &[u8], comments: &[String]) -> bool {
    // Most rows begin with a digit, and no comment does.
    if line.first().is_some_and(u8::is_ascii_digit) {
        return false;
    }
    let line = line.trim_ascii_start();
    line.is_empty() || comments.iter().any(|comment| line.starts_with(comment.as_bytes()))
}

/// Returns the start of `text` in quotes, for a message.
pub(crate) fn shown(text: &[u8]) -> String {
    const MOST: usize = 60;
    let text = decoded(text);
    let short: String = text.chars().take(MOST).collect();
    let dots = if short.len() < text.len() { "..." } else { "" };
    format!("{short:?}{dots}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(text: &[u8], chunk: u64) -> Vec<Option<Vec<u8>>> {
        let path = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(path.path(), text).unwrap();
        let file = RandomAccessFile::open(path.path()).unwrap();
        let mut all = Vec::new();
        let mut start = 0;
        while start < file.size() {
            let range = start..(start + chunk).min(file.size());
            let collect = |_, line: TextLine| {
                all.push(if let TextLine::Whole(line) = line { Some(line.to_vec()) } else { None });
                Ok(())
            };
            for_each_line(&file, 0, range.clone(), collect).unwrap();
            start = range.end;
        }
        all
    }

    #[test]
    fn every_line_is_seen_once_for_every_size_of_chunks() {
        let text = b"one\r\n\ntwo\nthree is longer\n\n\nlast";
        let expected: Vec<_> =
            ["one", "", "two", "three is longer", "", "", "last"].map(|l| Some(l.as_bytes().to_vec())).into();
        for chunk in 1..40 {
            assert_eq!(lines(text, chunk), expected, "chunks of {chunk}");
        }
    }

    #[test]
    fn a_line_that_is_too_long_is_one_line() {
        let mut text = b"1 2 3\n".to_vec();
        text.extend(std::iter::repeat_n(b'7', 3 * LONGEST));
        text.extend(b"\n4 5 6\n");
        let expected = vec![Some(b"1 2 3".to_vec()), None, Some(b"4 5 6".to_vec())];
        assert_eq!(lines(&text, 1000), expected);
        assert_eq!(lines(&text, 1 << 20), expected);
    }
}
