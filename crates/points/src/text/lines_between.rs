//! Lines among the rows that are no rows: the header of another export, put together with the first, and numbers of points.

use crate::text::comment_names::{CommentNames, names_in_comments};
use crate::text::commented_header::Comments;
use crate::text::delimiter::Delimiter;
use crate::text::header::ROWS_FOR_NAMES;
use crate::text::lines::{is_skipped, shown};
use crate::text::names::NamedColumns;
use crate::text::role::ColumnRole;
use crate::text::stated_count::{StatedCount, stated_count};
use crate::text::units::UnitsOfAxes;
use crs::unit::Unit;

/// So many such lines of a chunk are read, of at most so many bytes.
const MOST_LINES: usize = 1000;
const LONGEST_LINE: usize = 1 << 14;

const REMEDY: &str = "split the file, or name the columns with `columns` under [input.csv]";

/// What the start of a text shows, with which later lines are compared.
pub(crate) struct TextStart {
    /// What begins a comment.
    marks: Vec<String>,
    /// The columns; `None` if the user names them or wants no header.
    header: Option<FirstHeader>,
    /// The numbers of points in the comments before the rows.
    pub(crate) counts: Vec<StatedCount>,
}

/// The header of a text, or that it has none, and its first rows.
struct FirstHeader {
    named: Option<NamedColumns>,
    /// The header or what stands in for it, for messages.
    what: String,
    candidates: Vec<Delimiter>,
    rows: Vec<Vec<u8>>,
}

impl TextStart {
    /// Describes the start of a text: its comments, and the names of its columns if `decides` is set, by which the columns were found.
    pub(crate) fn new(start: &Comments, named: Option<&NamedColumns>, decides: bool) -> TextStart {
        let rows = start.rows.iter().take(ROWS_FOR_NAMES).map(|row| row.to_vec()).collect();
        let mut text = TextStart {
            marks: start.marks.to_vec(),
            header: None,
            counts: start.lines.iter().filter_map(|line| stated_count(line, start.marks)).collect(),
        };
        if decides {
            let what = "x, y and z, for which the first three are taken".to_string();
            let mut header = FirstHeader { named: named.cloned(), what, candidates: start.candidates.to_vec(), rows };
            if let Some(named) = named {
                let is_same = |line: &&[u8]| header.read(line, &text.marks).is_some_and(|own| own.roles == named.roles);
                let at = start.lines.iter().rposition(is_same);
                let line = at.map(|at| format!("line {} ({})", at.saturating_add(1), shown(start.lines[at])));
                header.what = line.unwrap_or("the start of the file".to_string());
            }
            text.header = Some(header);
        }
        text
    }

    /// Returns whether the columns were found without any name.
    pub(crate) fn is_guessed(&self) -> bool {
        self.header.as_ref().is_some_and(|header| header.named.is_none())
    }
}

impl FirstHeader {
    fn rows(&self) -> Vec<&[u8]> {
        self.rows.iter().map(Vec::as_slice).collect()
    }

    /// Returns what `line` says of the columns, a comment or a line of words.
    fn comment_names(&self, line: &[u8], marks: &[String]) -> Result<CommentNames, String> {
        let no_mark = [String::new()];
        let marks = if is_skipped(line, marks) { marks } else { &no_mark };
        names_in_comments(&[line], marks, &self.candidates, &self.rows())
    }

    fn read(&self, line: &[u8], marks: &[String]) -> Option<NamedColumns> {
        self.comment_names(line, marks).ok()?.named
    }

    /// Returns a sentence about a line that names other columns.
    fn contradiction(&self, line: &[u8], marks: &[String]) -> Option<String> {
        let kind = if is_skipped(line, marks) { "comment" } else { "line" };
        match self.comment_names(line, marks) {
            Ok(CommentNames { named: Some(other), .. }) => self.is_other(&other).then(|| {
                let what =
                    if self.is_in_place(&other) { "gives the columns different units" } else { "names other columns" };
                format!("the {kind} {} {what} than {}: {REMEDY}", shown(line), self.what)
            }),
            Ok(CommentNames { words: Some(_), .. }) => None,
            Err(what) if self.named.is_none() => Some(what),
            _ => {
                let rows = self.rows();
                Comments { lines: &[line], marks, candidates: &self.candidates, rows: &rows }.unread_names()
            }
        }
    }

    /// Returns whether these names give a column another meaning or another unit.
    fn is_other(&self, other: &NamedColumns) -> bool {
        let own = self.named.as_ref();
        let units = own.and_then(|own| own.units().ok()).unwrap_or_default();
        !self.is_in_place(other)
            || own.is_some_and(|own| own.degrees) != other.degrees
            || other.units().map_or(true, |others| have_other_units(&units, &others))
    }

    fn is_in_place(&self, other: &NamedColumns) -> bool {
        let unnamed = [0, 1, 2].map(ColumnRole::Coordinate);
        let own = self.named.as_ref().map_or(&unnamed[..], |own| &own.roles);
        own.iter().zip(&other.roles).all(|(own, other)| own == other)
    }
}

/// Returns whether these `others` are units, and not `own`; where nothing is said, they are metres.
fn have_other_units(own: &UnitsOfAxes, others: &UnitsOfAxes) -> bool {
    let vertical = |units: &UnitsOfAxes| units.vertical.map(|metres| Unit::from_metres(Some(metres)));
    let horizontal = if own.horizontal == Unit::Unknown { Unit::Metre } else { own.horizontal };
    let length = if horizontal == Unit::Degree { Unit::Metre } else { horizontal };
    ![Unit::Unknown, horizontal].contains(&others.horizontal)
        || vertical(others).is_some_and(|other| other != vertical(own).unwrap_or(length))
}

/// What is found in the lines among the rows of a chunk, or of all chunks.
#[derive(Clone, Debug, Default)]
pub(crate) struct LinesBetween {
    /// How many were read.
    count: usize,
    /// The first line that names other columns: its number from 0, and a sentence about it.
    pub(crate) other_header: Option<(u64, String)>,
    /// The numbers of points in comments.
    pub(crate) counts: Vec<StatedCount>,
}

impl LinesBetween {
    /// Takes the line of this number into account, which is no row.
    #[cold]
    pub(crate) fn see(&mut self, start: &TextStart, index: u64, line: &[u8]) {
        let is_comment = is_skipped(line, &start.marks);
        let first = line.trim_ascii_start().first();
        let may_be_header = first.is_some_and(|first| {
            is_comment || *first == b'"' || !first.is_ascii_punctuation() && !first.is_ascii_digit()
        });
        if !may_be_header || line.len() > LONGEST_LINE || self.count >= MOST_LINES {
            return;
        }
        self.count += 1;
        self.counts.extend(stated_count(line, &start.marks));
        if let (None, Some(header)) = (&self.other_header, &start.header) {
            self.other_header = header.contradiction(line, &start.marks).map(|what| (index, what));
        }
    }

    /// Adds what the following lines hold; their first has the number `lines`.
    pub(crate) fn add(&mut self, other: &LinesBetween, lines: u64) {
        if self.other_header.is_none() {
            self.other_header = other.other_header.clone().map(|(index, what)| (lines + index, what));
        }
        self.counts.extend_from_slice(&other.counts);
    }
}
