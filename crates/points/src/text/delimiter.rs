//! What separates the columns of a line, and how a line is split.

use memchr::{memchr, memchr_iter, memchr2, memchr2_iter};
use serde::{Deserialize, Serialize};

use sys::{Error, Result};

/// What separates two columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Delimiter {
    /// One character, with or without spaces around it.
    Byte(u8),
    /// Any run of spaces and tabs.
    Blank,
}

/// The delimiters that detection tries, in this order: spaces may surround a comma, and a column that tabs separate may hold spaces.
pub(crate) const CANDIDATES: [Delimiter; 5] =
    [Delimiter::Byte(b';'), Delimiter::Byte(b'\t'), Delimiter::Byte(b'|'), Delimiter::Byte(b','), Delimiter::Blank];

impl Delimiter {
    /// Returns the delimiter that the option names. Fails if the character can be part of a number or of a name.
    pub(crate) fn from_option(delimiter: char) -> Result<Delimiter> {
        match delimiter {
            ' ' => Ok(Delimiter::Blank),
            '\t' => Ok(Delimiter::Byte(b'\t')),
            ',' | ';' | '|' | ':' | '/' | '!' | '&' | '*' | '~' | '^' | '%' | '$' | '@' | '_' => {
                Ok(Delimiter::Byte(delimiter as u8))
            }
            _ => Err(Error::Config(format!(
                "[input.csv] delimiter = {delimiter:?} cannot separate numbers; use a comma, a semicolon, a tab or a space"
            ))),
        }
    }

    /// Returns the column at the start of `line`, without spaces and quotes around it, and the rest of the line after the
    /// delimiter, if there is a delimiter.
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

    /// Returns whether `line` has more columns than `most`, apart from an empty last one.
    pub(crate) fn has_more_than(&self, most: usize, line: &[u8]) -> bool {
        let delimiters = match self {
            Delimiter::Byte(byte) => memchr_iter(*byte, line).count(),
            Delimiter::Blank => memchr2_iter(b' ', b'\t', line).count(),
        };
        if delimiters < most {
            return false;
        }
        let (mut columns, mut is_last_empty, mut rest) = (0, false, Some(line));
        while let Some(line) = rest {
            let (field, after) = self.split(line);
            (columns, is_last_empty, rest) = (columns + 1, field.is_empty(), after);
        }
        columns - is_last_empty as usize > most
    }

    /// Returns the number of columns of `line` that are numbers.
    pub(crate) fn numbers(&self, line: &[u8]) -> usize {
        self.fields(line).iter().filter(|field| is_number(field)).count()
    }

    /// Returns all columns of `line`.
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

fn is_number(field: &[u8]) -> bool {
    std::str::from_utf8(field).is_ok_and(|text| text.parse::<f64>().is_ok())
}

/// Returns the length of the quoted text that `line` begins with, quotes included. A quote that is doubled is a part of the text.
///
/// An apostrophe may stand around a field, but it does not quote a delimiter: names begin with one ('s-Gravenhage), and the next may
/// stand many columns further on.
fn quoted_length(line: &[u8]) -> Option<usize> {
    if line.first() != Some(&b'"') {
        return None;
    }
    let mut length = 1;
    loop {
        length += memchr(b'"', &line[length..])? + 1;
        if line.get(length) != Some(&b'"') {
            return Some(length);
        }
        length += 1;
    }
}

fn unquoted(field: &[u8]) -> &[u8] {
    match field {
        [b'"', inner @ .., b'"'] | [b'\'', inner @ .., b'\''] => inner.trim_ascii(),
        _ => field,
    }
}
