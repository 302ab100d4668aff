//! A comment that is a header, such as `# time, latitude, longitude, height`, but does not name x, y and z by names that are known, or
//! lists them in another order. Without it, the first three columns would be taken for x, y and z.

use crate::text::axis_values::AxisValues;
use crate::text::column_list::{Doubt, Word, doubt, doubt_about_letters, words};
use crate::text::comment_names::texts_of;
use crate::text::delimiter::{CANDIDATES, Delimiter};
use crate::text::header::{ROWS_FOR_NAMES, columns_of};
use crate::text::lines::shown;
use crate::text::name::{Name, words_of};
use crate::text::names::{NamedColumns, named_columns};
use crate::text::number::Number;
use crate::text::role::ColumnRole;
use crate::text::units::TextUnit;
use crate::windows_1252::decoded;

/// So many names of coordinates and times make a header.
const LEAST_KNOWN: usize = 2;

/// So many comments before the rows are looked at, and so many bytes of each.
const MOST_COMMENTS: usize = 1000;
const LONGEST_COMMENT: usize = 1 << 14;

/// Measures that are no coordinates of a map: along a road and across it, around an instrument, in an image.
const MEASURES: [&str; 3] = [
    "station sta stn stationierung chainage km kp pk offset off offs abstand deport distance dist",
    "range rng azimuth azi az bearing angle winkel hz theta phi psi rho r",
    "line inline crossline sample row col column zeile spalte u v w i j t ts time timestamp",
];

const REMEDY: &str = "name the columns with `columns` under [input.csv], or set header = false there to take the first three for x, y and z";

/// A comment that may be a header and was not read as one.
#[derive(Debug, PartialEq)]
pub(crate) enum UnreadHeader {
    /// It is one, for this reason.
    Certain(String),
    /// It may be one: a warning.
    Possible(String),
}

/// The comments before the rows of a text, and its first rows.
pub(crate) struct Comments<'a> {
    pub(crate) lines: &'a [&'a [u8]],
    /// What begins a comment.
    pub(crate) marks: &'a [String],
    pub(crate) candidates: &'a [Delimiter],
    pub(crate) rows: &'a [&'a [u8]],
}

impl Comments<'_> {
    /// Returns what to say of a comment that names other columns first than x, y and z. It is known that no comment names the columns by
    /// names that are known. If `has_words`, one begins with x, y and z.
    pub(crate) fn unread_header(&self, has_words: bool) -> Option<UnreadHeader> {
        if let Some(line) = self.contradicted_bounds() {
            let what = "bounds x, y and z, and other columns than the first three lie within these bounds";
            return Some(UnreadHeader::Certain(format!("the comment {} {what}: {REMEDY}", shown(line))));
        }
        let list = if has_words { None } else { self.unread_list() };
        if let Some((line, Doubt::Certain, error)) = list {
            return Some(UnreadHeader::Certain(refusal(line, &error)));
        }
        let (lines, texts): (Vec<&[u8]>, Vec<&[u8]>) = self.texts().unzip();
        let order = doubt(&texts, self.widths().into_iter().max().unwrap_or(0));
        let order = order.and_then(|(at, doubt)| Some((*lines.get(at)?, doubt)));
        if let Some((line, Doubt::Certain)) = order {
            let what = "lists other columns first than x, y and z, or in another order";
            return Some(UnreadHeader::Certain(format!("the comment {} {what}: {REMEDY}", shown(line))));
        }
        let (line, _) = order.or(list.map(|(line, doubt, _)| (line, doubt)))?;
        Some(UnreadHeader::Possible(format!(
            "the comment {} may name the columns: the first three are taken as x, y and z; if that is wrong, set `columns` under \
             [input.csv]",
            shown(line)
        )))
    }

    /// Returns what to say of a comment that certainly is a list of names, of which those of x, y and z are not known.
    pub(crate) fn unread_names(&self) -> Option<String> {
        let (line, _, error) = self.unread_list().filter(|(_, doubt, _)| *doubt == Doubt::Certain)?;
        Some(refusal(line, &error))
    }

    /// Returns a sentence about a comment that says that x or y of these names has another direction.
    pub(crate) fn other_directions(&self, named: &NamedColumns) -> Option<String> {
        let order = [named.place(0)?, named.place(1)?];
        let (lines, texts): (Vec<&[u8]>, Vec<&[u8]>) = self.texts().unzip();
        let line = lines.get(doubt_about_letters(&texts, order).filter(|_| named.letters)?)?;
        Some(format!(
            "its columns are named x and y, but the comment {} gives them other directions: name the columns with `columns` under \
             [input.csv], with \"x\" for the easting and \"y\" for the northing",
            shown(line)
        ))
    }

    /// Returns each comment and its text.
    fn texts(&self) -> impl Iterator<Item = (&[u8], &[u8])> {
        let last = &self.lines[self.lines.len().saturating_sub(MOST_COMMENTS)..];
        let texts = last.iter().filter_map(|line| Some((*line, texts_of(line, self.marks).pop()?)));
        texts.map(|(line, text)| (line, &text[..text.len().min(LONGEST_COMMENT)]))
    }

    /// Returns the first rows, each with what may part its columns.
    fn readings(&self) -> impl Iterator<Item = (Delimiter, &[u8])> {
        let rows = &self.rows[..self.rows.len().min(ROWS_FOR_NAMES)];
        let readings = rows.iter().flat_map(|row| self.candidates.iter().map(move |own| (*own, *row)));
        readings.filter(|(own, row)| own.numbers(row) >= 3)
    }

    /// Returns how many columns the first rows have.
    fn widths(&self) -> Vec<usize> {
        self.readings().map(|(own, row)| columns_of(own, row)).collect()
    }

    /// Returns a comment with the least or the greatest x, y and z, beyond which the first three columns of all first rows lie, where others lie
    /// within. Some programs write bounds that are no bounds of the rows.
    fn contradicted_bounds(&self) -> Option<&[u8]> {
        let numbers = |(own, row): (Delimiter, &[u8])| -> Vec<f64> {
            own.fields(row).iter().map_while(|field| Some(Number::parse(field)?.value())).collect()
        };
        let rows: Vec<Vec<f64>> = self.readings().map(numbers).collect();
        let columns = rows.iter().map(Vec::len).min()?;
        let bounds: Vec<(&[u8], AxisValues)> =
            self.texts().filter_map(|(line, text)| Some((line, AxisValues::read(text)?))).collect();
        let exclude =
            |bounds: &AxisValues, row: &[f64], [x, y, z]: [usize; 3]| bounds.exclude([row[x], row[y], row[z]]);
        let mut windows = (2..columns).map(|last| [last - 2, last - 1, last]);
        let first = windows.next()?;
        let (line, _) = bounds.iter().find(|(_, bounds)| rows.iter().all(|row| exclude(bounds, row, first)))?;
        let lie_within =
            |order: [usize; 3]| rows.iter().all(|row| bounds.iter().all(|(_, bounds)| !exclude(bounds, row, order)));
        let is_other = lie_within([1, 0, 2]) || windows.any(|[x, y, z]| lie_within([x, y, z]) || lie_within([y, x, z]));
        is_other.then_some(*line)
    }

    /// Returns the last comment that is a list of names, and what is wrong with them.
    fn unread_list(&self) -> Option<(&[u8], Doubt, String)> {
        let widths = self.widths();
        let lists = self.lines.iter().rev().flat_map(|line| {
            let texts = lists_of(line, self.marks).into_iter();
            let headers = texts.flat_map(|text| CANDIDATES.map(|own| (own, own.fields(text))));
            let unread = headers.filter(|(_, fields)| !begins_with_xyz(fields));
            let doubts = unread.filter_map(|(own, fields)| Some((header_doubt(own, &fields, &widths)?, fields)));
            doubts.filter_map(|(doubt, fields)| {
                Some((*line, doubt, named_columns(fields.into_iter()).err()?.to_string()))
            })
        });
        // Of several, the first is the last comment.
        let lists: Vec<_> = lists.collect();
        let certain = lists.iter().position(|(_, doubt, _)| *doubt == Doubt::Certain).unwrap_or(0);
        lists.into_iter().nth(certain)
    }
}

fn refusal(line: &[u8], error: &str) -> String {
    format!("the comment {} {error}: {REMEDY}", shown(line))
}

/// Returns what may be a list in a comment: all of its text, and what follows its last colon, unless that is the value of something else.
fn lists_of<'a>(line: &'a [u8], marks: &[String]) -> Vec<&'a [u8]> {
    let mut texts = texts_of(line, marks);
    if let [after, whole] = texts.as_slice() {
        let title = words(&whole[..whole.len() - after.len()]);
        if title.contains(&Word::Unknown) && !title.contains(&Word::List) {
            texts.remove(0);
        }
    }
    texts
}

/// Returns whether these fields name columns, and the rows have so many columns: all are names, and some of coordinates or times. Where
/// something else than blanks parts them, single words are enough, or fewer or more names than columns.
fn header_doubt(delimiter: Delimiter, fields: &[&[u8]], widths: &[usize]) -> Option<Doubt> {
    let named = fields.len() - fields.last().is_some_and(|last| last.is_empty()) as usize;
    let fields = &fields[..named];
    let is_name = |field: &&[u8]| {
        decoded(field).contains(char::is_alphabetic)
            && std::str::from_utf8(field).map_or(true, |text| text.parse::<f64>().is_err())
    };
    if named < 3 || !fields.iter().all(is_name) {
        return None;
    }
    let is_as_wide = widths.contains(&named);
    if fields.iter().any(|field| !field.iter().any(u8::is_ascii_alphabetic)) {
        // Few words of other scripts are known.
        return is_as_wide.then_some(Doubt::Possible);
    }
    let measures = fields.iter().filter(|field| names_measure(field)).count();
    let is_known = |field: &&[u8]| names_measure(field) || is_column(&words(field));
    let are_measures = measures > 0 && fields.iter().all(is_known);
    let is_word = |field: &&[u8]| !Name::read(field).has_blanks();
    let are_words = delimiter != Delimiter::Blank && fields.iter().all(is_word);
    let fields: Vec<(bool, Vec<Word>)> = fields.iter().map(|field| (is_word(field), words(field))).collect();
    let count = |wanted: fn(bool, &[Word]) -> bool| fields.iter().filter(|(word, field)| wanted(*word, field)).count();
    if count(|_, field| gives_value(field)) > 0 {
        // "north: 5933000, east: 565000"
        return None;
    }
    let known = count(|is_word, field| names_column(field) && (is_word || is_column(field)));
    let is_kind = |kind: fn(&[Word]) -> bool| fields.iter().any(|(_, field)| kind(field));
    let kinds = [
        is_kind(|field| names_axis(field, 0)),
        is_kind(|field| names_axis(field, 1)),
        is_kind(|field| names_axis(field, 2)),
    ];
    let axes = kinds.into_iter().filter(|kind| *kind).count();
    let are_known = known >= LEAST_KNOWN && axes > 0 && (axes > 1 || is_kind(names_other));
    let is_long = delimiter != Delimiter::Blank && count(|_, field| is_column(field)) >= LEAST_KNOWN;
    // "station offset elevation", "theta phi r"
    let is_list_of_measures = are_measures && (kinds[2] || measures == named);
    if are_known && (is_as_wide || is_long) || is_as_wide && (is_list_of_measures || are_words && known > 0) {
        return Some(Doubt::Certain);
    }
    let has_unknown = count(|_, field| field.contains(&Word::Unknown)) > 0;
    (is_as_wide && are_words && has_unknown).then_some(Doubt::Possible)
}

/// Returns whether a field is the name of a measure that is no coordinate of a map, with or without its unit.
fn names_measure(field: &[u8]) -> bool {
    let words = words_of(field);
    let is_measure = |word: &String| MEASURES.iter().any(|known| known.split(' ').any(|known| known == word));
    match words.split_first() {
        Some((first, units)) => is_measure(first) && units.iter().all(|unit| TextUnit::read(unit).is_some()),
        None => false,
    }
}

/// Returns whether a field gives the value of what it names, and not the place of a column.
fn gives_value(field: &[Word]) -> bool {
    let is_number = |word: &Word| matches!(word, Word::Value | Word::Place(_));
    names_column(field) && !field.contains(&Word::List) && field.iter().any(is_number)
}

fn names_column(field: &[Word]) -> bool {
    field.iter().any(|word| matches!(word, Word::Axis(..) | Word::Other))
}

fn names_axis(field: &[Word], axis: usize) -> bool {
    field.iter().any(|word| matches!(word, Word::Axis(own, _) if *own == axis))
}

/// Returns whether a field names something else than an axis.
fn names_other(field: &[Word]) -> bool {
    field.contains(&Word::Other)
}

/// Returns whether a field names a column, and not a thing that lies north of another.
fn is_column(field: &[Word]) -> bool {
    names_column(field) && !field.iter().any(|word| matches!(word, Word::Unknown | Word::Stop))
}

/// Returns whether the first words of the fields are x, y and z, in a sentence such as "x, y, z in metres".
fn begins_with_xyz(fields: &[&[u8]]) -> bool {
    let axis = |field: &[u8]| match words_of(field).first().and_then(|word| Name::read(word.as_bytes()).role()) {
        Some((_, ColumnRole::Coordinate(axis))) => Some(axis),
        _ => None,
    };
    (0..3).all(|place| fields.get(place).is_some_and(|field| axis(field) == Some(place)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unread(comment: &str, row: &str) -> Option<UnreadHeader> {
        let marks = ["#".to_string(), "//".to_string()];
        let lines: Vec<&[u8]> = comment.lines().map(str::as_bytes).collect();
        let comments = Comments { lines: &lines, marks: &marks, candidates: &CANDIDATES, rows: &[row.as_bytes()] };
        comments.unread_header(false)
    }

    #[test]
    fn comments_that_name_other_columns_are_headers() {
        for (comment, row) in [
            (
                "# UTC_Seconds, Latitude(deg), Longitude(deg), WGS84_Ellipsoid_Height(m), Slope",
                "42000.5,78.1,301.2,1903.3",
            ),
            ("// \"time\",\"lat\",\"lon\"", "42000.5,78.1,301.2"),
            ("# Time; Lat; Lon; Level", "42000.5;78.1;301.2;1903.3"),
            ("# time lat lon level", "42000.5 78.1 301.2 1903.3"),
            ("# time\tlat\tlon\tlevel", "42000.5\t78.1\t301.2\t1903.3"),
            (
                "# a scan\n# LFID SHOT TIME LONGITUDE_CENTROID LATITUDE_CENTROID ELEVATION_CENTROID\n# ready",
                "1 2 42504.4 301.2 78.3 1956.5",
            ),
            ("# Columns: time, lat, lon, level", "42000.5,78.1,301.2,1903.3"),
            ("# zeit breite laenge pegel", "42000.5 78.1 301.2 1903.3"),
            ("# time,two,three", "42000.5,78.1,301.2"),
        ] {
            let what = unread(comment, row);
            let words = ["names no column", "lists other columns first"];
            let is_named = |what: &str| words.iter().any(|word| what.contains(word));
            assert!(matches!(&what, Some(UnreadHeader::Certain(what)) if is_named(what)), "{comment}: {what:?}");
        }
    }

    #[test]
    fn lists_of_measures_are_headers() {
        for comment in [
            "# Station Offset Elevation",
            "# Sta Off Elev",
            "# Sta. Offset(m) Elev(m)",
            "# azimuth range height",
            "# line sample elevation",
            "# chainage offset z",
            "# km offset hoehe",
            "# theta r z",
            "# u v height",
            "# azimuth elevation range",
            "# theta phi r",
            "# Columns: station offset level",
            "# Distance\tOffset\tHeight",
        ] {
            for row in ["0.5 -9.5 124.8", "0.5,-9.5,124.8"] {
                let what = unread(comment, row);
                let is_named = |what: &str| {
                    what.contains(&comment[2..8]) && what.contains("names no column") && what.contains("`columns`")
                };
                assert!(matches!(&what, Some(UnreadHeader::Certain(what)) if is_named(what)), "{comment}: {what:?}");
            }
            assert_eq!(unread(comment, "0.5 -9.5 124.8 1"), None, "{comment}");
        }
        for comment in [
            "# ground elevation points",
            "# Digital elevation model",
            "# mean height 120",
            "# station height",
            "# station of elevation",
            "# line 12 height",
            "# range of heights",
            "# total station survey",
        ] {
            assert_eq!(unread(comment, "565013.5 5933084.7 25.3"), None, "{comment}");
        }
    }

    #[test]
    fn bounds_of_another_order_are_refused() {
        let row = "400000.0 556800.33 5423136.67 124.84";
        for comment in ["# max x y z: 557098.32 5423398.72 141.06", "# min x y z: 556700.67 5423100.09 107.02"] {
            let what = unread(comment, row);
            assert!(
                matches!(&what, Some(UnreadHeader::Certain(what)) if what.contains("bounds x, y and z")),
                "{what:?}"
            );
            assert_eq!(unread(comment, "556800.33 5423136.67 124.84 400000.0"), None);
        }
        let exchanged = unread("# max x y z: 557098.32 5423398.72 141.06", "5423136.67 556800.33 124.84");
        assert!(matches!(exchanged, Some(UnreadHeader::Certain(_))));
        // Bounds that were never written, or before a shift, are those of no column.
        for comment in ["# offset x y z: 500000 5000000 0", "# max x y z: 0 0 0", "# min x y z: 9e6 9e6 9e6"] {
            assert_eq!(unread(comment, row), None, "{comment}");
        }
    }

    #[test]
    fn lists_of_other_words_are_only_doubtful() {
        for comment in ["# one,two,three", "# Meyer, Berger, Bern", "# NCOLS, NROWS, CELLSIZE"] {
            let what = unread(comment, "42000.5,78.1,301.2");
            assert!(matches!(what, Some(UnreadHeader::Possible(what)) if what.contains("first three")), "{comment}");
        }
    }

    #[test]
    fn words_of_other_scripts_are_doubtful() {
        for comment in ["# 序号 东坐标 北坐标 高程", "# رقم شرق شمال ارتفاع", "# α/α Χ Υ Ζ", "# 点,東,北,高"]
        {
            for row in ["1018 565013.5 5933084.7 25.3", "1018,565013.5,5933084.7,25.3"] {
                assert!(matches!(unread(comment, row), Some(UnreadHeader::Possible(_))), "{comment}");
            }
            assert_eq!(unread(comment, "565013.5 5933084.7 25.3"), None, "{comment}");
        }
    }

    #[test]
    fn sentences_are_no_headers() {
        for (comment, row) in [
            ("# x y z of the hill", "1 2 3"),
            ("# made by a scanner", "1 2 3 4"),
            ("# x, y, z in metres", "1,2,3"),
            ("# scanned in May, by two people, in the rain", "1,2,3"),
            ("# scanned in May, on the north bank, and on the east bank, by me", "1,2,3"),
            ("# WGS84, UTM32N, EGM96", "1,2,3"),
            ("# surveyed 2020, Meyer, Bern", "1,2,3"),
            ("# 12, 13, 14", "1,2,3"),
            ("# hill, dale", "1,2,3"),
            ("# processed: filtered, gridded, exported", "1,2,3"),
            ("# client: East Height Ltd", "1 2 3"),
            ("# position: north 3, east 4, up 5", "1,2,3"),
        ] {
            assert_eq!(unread(comment, row), None, "{comment}");
        }
    }
}
