//! Names of columns in a comment before the rows, such as `# x y z`.

use crate::text::axis_values::AxisValues;
use crate::text::column_list::doubt;
use crate::text::decimal_comma::is_pointed;
use crate::text::delimiter::{CANDIDATES, Delimiter};
use crate::text::header::{ROWS_FOR_NAMES, columns_of};
use crate::text::lines::{is_skipped, shown};
use crate::text::names::{NamedColumns, named_columns};
use crate::text::numbered::{are_numbered, may_be_numbered};
use crate::text::role::ColumnRole;

/// What parts names in comments, though no columns, as in `# E/N/H`.
const SLASH: Delimiter = Delimiter::Byte(b'/');

/// What comments say of columns.
pub(crate) struct CommentNames {
    /// The names of the columns.
    pub(crate) named: Option<NamedColumns>,
    /// The number of words of a comment that has other words than there are columns, but begins with x, y and z, as columns without
    /// names do.
    pub(crate) words: Option<usize>,
}

/// Returns the names in the last comment among `lines` that names the columns of `rows`, the first of the text.
///
/// # Errors
/// A sentence, if comments name x, y and z, but none of them can mean these columns.
pub(crate) fn names_in_comments(
    lines: &[&[u8]],
    comments: &[String],
    candidates: &[Delimiter],
    rows: &[&[u8]],
) -> Result<CommentNames, String> {
    let rows = Rows { rows: &rows[..rows.len().min(ROWS_FOR_NAMES)], candidates };
    let (mut misfit, mut words) = (None, None);
    let gives_values = |line: &[u8]| texts_of(line, comments).iter().any(|text| AxisValues::read(text).is_some());
    let is_comment = |line: &&[u8]| !line.trim_ascii().is_empty() && is_skipped(line, comments) && !gives_values(line);
    for (at, line) in lines.iter().enumerate().rev().filter(|(_, line)| is_comment(line)) {
        for text in texts_of(line, comments) {
            let others = candidates.iter().filter(|own| !CANDIDATES.contains(own));
            let readings = CANDIDATES.iter().chain(others).chain(&[SLASH]).filter_map(|delimiter| {
                let fields = Some(delimiter.fields(text)).filter(|fields| fields.len() >= 3)?;
                let names = named_columns(fields.into_iter()).ok()?;
                Some((*delimiter, names))
            });
            for (delimiter, names) in readings {
                match rows.fit(delimiter, &names) {
                    _ if rows.may_number(&names, line) => misfit = misfit.or(Some((line, names.count))),
                    Some(mut named) => {
                        let mut below = lines[at + 1..].iter().flat_map(|line| texts_of(line, comments));
                        let added = below.try_for_each(|text| named.add_units_of_comment(text));
                        added.map_err(|what| format!("the comment {} {what}", shown(line)))?;
                        return Ok(CommentNames { named: Some(named), words: None });
                    }
                    None if rows.mean_the_same(&names) => words = words.or(Some(names.count)),
                    None if rows.may_mean(&names, text) => misfit = misfit.or(Some((line, names.count))),
                    None => {}
                }
            }
        }
    }
    match misfit {
        None => Ok(CommentNames { named: None, words }),
        Some((line, names)) => Err(format!(
            "the comment {} names x, y and z, but it has {names} words and the rows have {} columns: name the columns with `columns` \
             under [input.csv]{}",
            shown(line),
            rows.columns().max().unwrap_or(0),
            if rows.may_have_decimal_commas(Delimiter::Byte(b',')) {
                "; if commas also stand before decimals, as in 565000,25,5933000,50, write it again with points there"
            } else {
                ""
            }
        )),
    }
}

/// Returns what may be names in a comment: what follows its last colon, and all of its text.
pub(crate) fn texts_of<'a>(line: &'a [u8], comments: &[String]) -> Vec<&'a [u8]> {
    let line = line.trim_ascii_start();
    let Some(comment) = comments.iter().find(|comment| line.starts_with(comment.as_bytes())) else { return Vec::new() };
    let text = &line[comment.len()..];
    let marks = text.iter().take_while(|byte| matches!(byte, b'#' | b'/' | b'!')).count();
    let text = text[marks..].trim_ascii();
    // "Columns: x y z" are three names.
    let after_colon = text.iter().rposition(|byte| *byte == b':').map(|colon| text[colon + 1..].trim_ascii());
    [after_colon, Some(text)].into_iter().flatten().collect()
}

fn begins_with_coordinate(names: &NamedColumns) -> bool {
    matches!(names.roles.first(), Some(ColumnRole::Coordinate(_)))
}

/// The first rows of a text, and what may part their columns.
struct Rows<'a> {
    rows: &'a [&'a [u8]],
    candidates: &'a [Delimiter],
}

impl Rows<'_> {
    /// Returns the delimiters under which rows have three numbers, and how many columns they have then.
    fn readings(&self) -> impl Iterator<Item = (Delimiter, usize)> {
        let readings = self.rows.iter().flat_map(|row| self.candidates.iter().map(move |own| (*own, *row)));
        readings.filter(|(own, row)| own.numbers(row) >= 3).map(|(own, row)| (own, columns_of(own, row)))
    }

    fn columns(&self) -> impl Iterator<Item = usize> {
        self.readings().map(|(_, columns)| columns)
    }

    /// Returns names that this delimiter parts, if they are as many as the columns, or the names of the first of them. Then columns
    /// without a name have none: a comment, unlike a header, need not name all. But there may be more columns than names because
    /// commas stand before decimals, or because a number of the row comes before x.
    fn fit(&self, delimiter: Delimiter, names: &NamedColumns) -> Option<NamedColumns> {
        let fields = |own: Delimiter| self.rows.iter().map(move |row| own.fields(row).len());
        let has_as_many = |(own, columns)| columns == names.count || fields(own).any(|fields| fields == names.count);
        if self.readings().any(has_as_many) {
            return Some(names.clone());
        }
        if self.may_have_decimal_commas(delimiter)
            || begins_with_coordinate(names) && are_numbered(delimiter, self.rows)
        {
            return None;
        }
        let wider = self.readings().filter(|(own, columns)| *own == delimiter && *columns > names.count);
        let mut names = names.clone();
        names.count = wider.map(|(_, columns)| columns).max()?;
        Some(names)
    }

    /// Returns whether the mark of the comment `line` may be the name of a first column, of numbers, as in `#<tab>x<tab>y<tab>z`, or as in
    /// `# x y z` before rows that begin with a whole number.
    fn may_number(&self, names: &NamedColumns, line: &[u8]) -> bool {
        let after = line.trim_ascii_start().strip_prefix(b"#").unwrap_or_default();
        let is_unclear = |own: Delimiter| may_be_numbered(own, self.rows) && !are_numbered(own, self.rows);
        let is_whole = |own: Delimiter| begins_with_coordinate(names) && is_unclear(own);
        let is_number = |own: Delimiter| after.starts_with(b"\t") || !after.is_empty() && is_whole(own);
        self.readings().any(|(own, columns)| columns == names.count + 1 && is_number(own))
    }

    /// Returns whether commas may stand before decimals as well: they part columns, and no number has a point.
    fn may_have_decimal_commas(&self, delimiter: Delimiter) -> bool {
        let has_point = |row: &&[u8]| delimiter.fields(row).iter().any(|field| is_pointed(field));
        delimiter == Delimiter::Byte(b',')
            && self.readings().any(|(own, _)| own == delimiter)
            && !self.rows.iter().any(has_point)
    }

    /// Returns whether a comment with more or fewer names than columns may name these columns, in another order or in other places. It may
    /// be a sentence.
    fn may_mean(&self, names: &NamedColumns, text: &[u8]) -> bool {
        let columns = self.columns().max().unwrap_or(0);
        let is_in_order = [0, 1, 2].map(|axis| names.place(axis)).is_sorted();
        is_in_order && columns != 3 || doubt(&[text], columns).is_some()
    }

    /// Returns whether columns without names mean the same: x, y and z come first, or are all there is in the order x, y, z.
    fn mean_the_same(&self, names: &NamedColumns) -> bool {
        let places = [0, 1, 2].map(|axis| names.place(axis));
        places == [Some(0), Some(1), Some(2)] || (places.is_sorted() && self.columns().all(|columns| columns == 3))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn places(comment: &str, row: &str) -> Result<Option<[usize; 3]>, ()> {
        let comments = ["#".to_string()];
        let rows: Vec<&[u8]> = row.lines().map(str::as_bytes).collect();
        let found = names_in_comments(&[comment.as_bytes()], &comments, &CANDIDATES, &rows);
        let place = |names: NamedColumns| [0, 1, 2].map(|axis| names.place(axis).unwrap());
        found.map(|found| found.named.map(place)).map_err(drop)
    }

    #[test]
    fn comments_that_name_the_columns_are_headers() {
        let swapped = Ok(Some([1, 0, 2]));
        for (comment, row) in [
            ("# y,x,z", "2,1,3,"),
            ("# y;x;z", "2;1;3;"),
            ("# Y X Z", "2 1 3 4"),
            ("# Columns: Y X Z", "2 1 3"),
            ("## Columns (m): y, x, z", "2 1 3"),
            ("# y,x,z", "2 1 3"),
        ] {
            assert_eq!(places(comment, row), swapped, "{comment}");
        }
        for comment in ["# x y z of the hill", "# points with x y z", "# made today"] {
            assert_eq!(places(comment, "1 2 3"), Ok(None), "{comment}");
        }
        assert_eq!(places("# x y z i r g b", "1 2 3 4"), Ok(None));
        assert_eq!(places("# y,x,z", "2.5,1,3,4"), swapped);
        assert_eq!(places("# x,y,z", "565013,44,5933084,74,25,3"), Ok(None));
        for (comment, row) in [
            ("# z y x of the hill", "1 2 3"),
            ("# rows of id x y z", "1 2 3 4"),
            ("# y,x,z", "2;1;3;4"),
            ("# y,x,z", "5933084,74,565013,44,25,3"),
            ("# id,x,y,z", "1,565013,44,5933084,74,25,3"),
            ("# columns x y z: 2 3 4", "1 2 3 4"),
        ] {
            assert_eq!(places(comment, row), Err(()), "{comment}");
        }
        for comment in ["# max x y z: 4.5 5.5 6.5", "# scale factor x y z  0.01 0.01 0.01"] {
            for row in ["1 2 3 4", "1 2 3 4 5 6", "1 2 3 4 5 6 7"] {
                assert_eq!(places(comment, row), Ok(None), "{comment} {row}");
            }
        }
        assert_eq!(places("#timestamp tx ty tz qx qy qz qw", "1305031102.5 1.5 2.5 3.5 0 0 0 1"), Ok(Some([1, 2, 3])));
    }

    #[test]
    fn the_mark_may_name_a_column_of_numbers() {
        let places = |comment: &str, row: &str| places(comment, &[row; 6].join("\n"));
        assert_eq!(places("# x y z", "1018 565013.5 5933084.7 25.3"), Err(()));
        assert_eq!(places("# x y z", "565013.5 5933084.7 25.3 12"), Ok(Some([0, 1, 2])));
        assert_eq!(places("# x y z", "565013 5933084 25.3 12"), Ok(Some([0, 1, 2])));
    }

    #[test]
    fn empty_columns_at_the_end_of_rows_have_names() {
        assert_eq!(places("#Label,X,Y,Z,Yaw,Pitch,Roll", "100,565013.5,5933084.7,25.3,,,"), Ok(Some([1, 2, 3])));
    }
}
