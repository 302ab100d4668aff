//! A comment that is a header, such as `# time, latitude, longitude, height`, but does not name x, y and z by names that are known. Without
//! it, the first three columns would be taken for x, y and z.

use crate::input::text::comment_names::texts_of;
use crate::input::text::delimiter::{CANDIDATES, Delimiter};
use crate::input::text::header::{ROWS_FOR_NAMES, columns_of};
use crate::input::text::lines::shown;
use crate::input::text::name::{Name, is_coordinate, words_of};
use crate::input::text::names::named_columns;
use crate::input::text::role::ColumnRole;

/// Words in the names of columns that are often beside coordinates.
const TIMES: [&str; 9] = ["time", "utc", "gps", "gpstime", "seconds", "epoch", "timestamp", "zeit", "tiempo"];

/// So many names of coordinates and times make a header.
const LEAST_KNOWN: usize = 2;

/// Returns a sentence about the last comment among `lines` that is a header of `rows`, the first of the text, if it names other columns
/// first than x, y and z. It is known that no comment names x, y and z by names that are known.
pub(crate) fn unread_header(
    lines: &[&[u8]],
    comments: &[String],
    candidates: &[Delimiter],
    rows: &[&[u8]],
) -> Option<String> {
    let rows = &rows[..rows.len().min(ROWS_FOR_NAMES)];
    let readings = rows.iter().flat_map(|row| candidates.iter().map(move |own| (own, *row)));
    let widths: Vec<usize> =
        readings.filter(|(own, row)| own.numbers(row) >= 3).map(|(own, row)| columns_of(*own, row)).collect();
    lines.iter().rev().find_map(|line| {
        let texts = texts_of(line, comments).into_iter();
        let headers = texts.flat_map(|text| CANDIDATES.map(|own| (own, own.fields(text))));
        let mut unread = headers.filter(|(own, fields)| is_header(*own, fields, &widths) && !begins_with_xyz(fields));
        let error = unread.find_map(|(_, fields)| named_columns(fields.into_iter()).err())?;
        Some(format!(
            "the comment {} {error}: name the columns with `columns` under [input.csv], or set header = false there to take the first three \
             for x, y and z",
            shown(line)
        ))
    })
}

/// Returns whether these fields name columns, and the rows have so many columns: all are names, and some of coordinates or times. Where
/// something else than blanks parts them, single words are enough, or fewer or more names than columns.
fn is_header(delimiter: Delimiter, fields: &[&[u8]], widths: &[usize]) -> bool {
    let named = fields.len() - fields.last().is_some_and(|last| last.is_empty()) as usize;
    let fields = &fields[..named];
    let is_name = |field: &&[u8]| {
        field.iter().any(u8::is_ascii_alphabetic)
            && std::str::from_utf8(field).map_or(true, |text| text.parse::<f64>().is_err())
    };
    if named < 3 || !fields.iter().all(is_name) {
        return false;
    }
    let is_as_wide = widths.contains(&named);
    let is_known =
        |field: &&&[u8]| words_of(field).iter().any(|word| is_coordinate(word) || TIMES.contains(&word.as_str()));
    let has_known = fields.iter().filter(is_known).count() >= LEAST_KNOWN;
    let are_words = || fields.iter().all(|field| !Name::read(field).has_blanks());
    match delimiter {
        Delimiter::Blank => is_as_wide && has_known,
        Delimiter::Byte(_) => has_known || (is_as_wide && are_words()),
    }
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

    fn unread(comment: &str, row: &str) -> Option<String> {
        let comments = ["#".to_string(), "//".to_string()];
        let lines: Vec<&[u8]> = comment.lines().map(str::as_bytes).collect();
        unread_header(&lines, &comments, &CANDIDATES, &[row.as_bytes()])
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
            ("# one,two,three", "42000.5,78.1,301.2"),
        ] {
            let what = unread(comment, row);
            assert!(what.is_some_and(|what| what.contains("names no column")), "{comment}");
        }
    }

    #[test]
    fn sentences_are_no_headers() {
        for (comment, row) in [
            ("# x y z of the hill", "1 2 3"),
            ("# made by a scanner", "1 2 3 4"),
            ("# x, y, z in metres", "1,2,3"),
            ("# scanned in May, by two people, in the rain", "1,2,3"),
            ("# 12, 13, 14", "1,2,3"),
            ("# hill, dale", "1,2,3"),
        ] {
            assert_eq!(unread(comment, row), None, "{comment}");
        }
    }
}
