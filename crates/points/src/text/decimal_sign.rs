//! The sign before decimals: a point, or the comma that spreadsheets write in many countries.

use std::borrow::Cow;

use crate::text::decimal_comma::is_pointed;
use crate::text::delimiter::Delimiter;

/// What stands before the decimals of a text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DecimalSign {
    /// A point, or nobody can tell.
    Point,
    /// A comma; something else stands between columns.
    Comma,
    /// A comma in quotes; commas without quotes stand between columns.
    QuotedComma,
    /// A comma stands there or between thousands.
    Unclear,
}

/// The number of rows that show what stands before decimals.
const ROWS: usize = 300;

const COMMA: Delimiter = Delimiter::Byte(b',');

/// Returns the sign before the decimals of these rows. A row shows that it is a comma if it has three numbers that way, and more of them
/// with commas than with points. The rows may have other rows among them, such as those of a header.
pub(crate) fn find(rows: &[&[u8]], candidates: &[Delimiter]) -> DecimalSign {
    if !rows.iter().take(ROWS).any(|row| row.contains(&b',')) {
        return DecimalSign::Point;
    }
    let delimiters: Vec<Delimiter> = candidates.iter().copied().filter(|delimiter| *delimiter != COMMA).collect();
    let has_three =
        |row: &[u8], delimiters: &[Delimiter]| delimiters.iter().any(|delimiter| delimiter.numbers(row) >= 3);
    let with_commas = |row| numbers_with_commas(row, &delimiters).map(|numbers| (false, numbers));
    let in_quotes = |row| numbers_with_commas(row, candidates).map(|numbers| (true, numbers));
    let (mut commas, mut quoted, mut points, mut plain) = (0usize, 0usize, 0usize, 0usize);
    let (mut thousands, mut gaps) = (true, false);
    for row in rows.iter().take(ROWS).copied() {
        let (is_row, with_points) = (has_three(row, candidates), numbers_with_points(row, candidates));
        // Beside decimals there may be three whole numbers, such as colours, and a column that a program wrote with points.
        let found = with_commas(row).or_else(|| in_quotes(row));
        let found = found.filter(|(_, numbers)| numbers.iter().filter(|field| has(field, b',')).count() > with_points);
        if let Some((is_quoted, numbers)) = found {
            (commas, quoted) = (commas + !is_quoted as usize, quoted + is_quoted as usize);
            thousands &= numbers.iter().filter(|field| has(field, b',')).all(|field| may_have_thousands(field));
            gaps |= !numbers.iter().take(3).all(|field| has(field, b','));
        } else if is_row {
            // Commas that part whole numbers are no decimals, unless those are in quotes.
            points += (with_points > 0) as usize;
            plain += (with_points == 0 && !has_three(row, &delimiters)) as usize;
        }
    }
    if quoted <= commas {
        points += plain;
    }
    match commas + quoted > points {
        // Numbers below a thousand have no comma between thousands, so it stands before decimals if all numbers have one. Who writes commas
        // between columns writes thousands in quotes, so those have to be told apart by their digits.
        true if thousands && (gaps || quoted > 0) => DecimalSign::Unclear,
        true if quoted > commas => DecimalSign::QuotedComma,
        true => DecimalSign::Comma,
        false => DecimalSign::Point,
    }
}

/// Returns `line` with points in place of commas and the other way round, if it has a number with a comma in it.
pub(crate) fn pointed<'a>(line: &'a [u8], candidates: &[Delimiter]) -> Cow<'a, [u8]> {
    match numbers_with_commas(line, candidates) {
        Some(_) => line.iter().map(swapped).collect(),
        None => Cow::Borrowed(line),
    }
}

/// As [`pointed`], for lines in which only commas in quotes stand before decimals.
pub(crate) fn pointed_in_quotes(line: &[u8]) -> Cow<'_, [u8]> {
    match numbers_with_commas(line, &[COMMA]) {
        Some(_) => swapped_in_quotes(line).collect(),
        None => Cow::Borrowed(line),
    }
}

/// Returns `line` with points in place of the commas in quotes, and the other way round.
pub(crate) fn swapped_in_quotes(line: &[u8]) -> impl Iterator<Item = u8> {
    let mut is_quoted = false;
    line.iter().map(move |byte| {
        is_quoted ^= *byte == b'"';
        if is_quoted { swapped(byte) } else { *byte }
    })
}

/// Returns the point for a comma and the comma for a point. A point between thousands then is no part of a number.
#[inline]
pub(crate) fn swapped(byte: &u8) -> u8 {
    match byte {
        b',' => b'.',
        b'.' => b',',
        other => *other,
    }
}

/// Returns the numbers of a row with three numbers or more, at least one of them with a comma before decimals.
fn numbers_with_commas<'a>(row: &'a [u8], delimiters: &[Delimiter]) -> Option<Vec<&'a [u8]>> {
    let numbers = |delimiter: &Delimiter| -> Vec<&'a [u8]> {
        delimiter.fields(row).into_iter().filter(|field| is_number(field)).collect()
    };
    let is_row = |numbers: &Vec<&[u8]>| numbers.len() >= 3 && numbers.iter().any(|field| field.contains(&b','));
    row.contains(&b',').then(|| delimiters.iter().map(numbers).find(is_row)).flatten()
}

/// Returns how many numbers of a row have a point, if it has three numbers that way. A date, a time or the name of a file is none.
fn numbers_with_points(row: &[u8], candidates: &[Delimiter]) -> usize {
    let rows = candidates.iter().filter(|delimiter| row.contains(&b'.') && delimiter.numbers(row) >= 3);
    let pointed = |delimiter: &Delimiter| delimiter.fields(row).into_iter().filter(|field| is_pointed(field)).count();
    rows.map(pointed).max().unwrap_or(0)
}

fn has(field: &[u8], sign: u8) -> bool {
    field.contains(&sign)
}

/// Returns whether `field` is a number with nothing but a comma before its decimals, if it has any.
fn is_number(field: &[u8]) -> bool {
    let comma = field.iter().position(|byte| *byte == b',');
    let is_digit = |at: usize| field.get(at).is_some_and(u8::is_ascii_digit);
    let between_digits = comma.is_none_or(|at| at > 0 && is_digit(at - 1) && is_digit(at + 1));
    let pointed: Vec<u8> = field.iter().map(swapped).collect();
    between_digits
        && !field.contains(&b'.')
        && std::str::from_utf8(&pointed).is_ok_and(|text| text.parse::<f64>().is_ok())
}

/// Returns whether the comma of `number` may stand between thousands, as in 565,000.
fn may_have_thousands(number: &[u8]) -> bool {
    let digits = number.strip_prefix(b"-").unwrap_or(number);
    let comma = digits.iter().position(|byte| *byte == b',').unwrap_or(0);
    (1..=3).contains(&comma) && digits[0] != b'0' && digits.len() == comma + 4
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::text::delimiter::CANDIDATES;

    fn sign(text: &str) -> DecimalSign {
        let rows: Vec<&[u8]> = text.lines().map(str::as_bytes).collect();
        find(&rows, &CANDIDATES)
    }

    #[test]
    fn commas_before_decimals_are_seen_where_something_else_parts_columns() {
        for text in [
            "565000,25;5933000,50;12,1",
            "x;y;z\n565000,25;5933000;12\n565001;5933000;12",
            "565000,25\t5933000,50\t12,1",
            "565000,25 5933000,50 12,1",
            "565000,25|5933000,50|12,1",
            "\"565000,25\";\"5933000,50\";12",
            "1,500;2,250;3,125",
            "0,500;2;3",
            "5,65e5;2,2e3;-3,1",
            "565013,44;5933084,74;25,28;10;20;30",
            "7 565013,44 5933084,74 25,28 10 20 30",
            "id;x;y;z;intensity;class\n1;565013,44;5933084,74;25,28;100;2\n2;565014;5933085;25;101;2",
            "1;565816,44;5933334,81;25,19;5;2;01.02.2024",
            "1;565816,44;5933334,81;25,19;5;2;12:30:01.5",
            "1;565816,44;5933334,81;25,19;10;20;30;img1.jpg",
            "7\t565816,44\t5933334,81\t25,19\t5\t2\tv1.0",
            "7 565816,44 5933334,81 25,19 5 2 scan_1.las",
            "565816,44;5933334,81;25,19;5;2.5;1",
            "1;\"565816,44\";\"5933334,81\";\"25,19\";5;01.02.2024",
        ] {
            assert_eq!(sign(text), DecimalSign::Comma, "{text}");
        }
        for text in [
            "\"565013,44\",\"5933084,74\",\"25,28\"",
            "1,\"0,44\",\"84,742\",25,10,20",
            "a,\"1,5\",2,\"3,25\"",
            "7,\"1,5\",2,\"3,2\",2.5",
        ] {
            assert_eq!(sign(text), DecimalSign::QuotedComma, "{text}");
        }
        for text in [
            "565000,25,5933000,50,12,1",
            "1, 2, 3",
            "1 ,2 ,3",
            "1.5,2,3\n1,2,3",
            "1.5;2;3\n1,5;2;3",
            "565,000.25;933,000.50;12.10",
            "5,933,000;5,933,000;12",
            "x,y,z",
            "1 2 3 a,b",
            "1.5;2.5;3;4,5",
            "1.5;2;3;4,5",
        ] {
            assert_eq!(sign(text), DecimalSign::Point, "{text}");
        }
        assert_eq!(sign("565,000;933,012;12\n565,001;933,011;13"), DecimalSign::Unclear);
        assert_eq!(sign("\"565,000\",\"933,012\",\"1,120\""), DecimalSign::Unclear);
    }

    #[test]
    fn points_between_thousands_are_no_part_of_a_number() {
        assert_eq!(&*pointed(b"1.500,5;2;3,5;4", &[Delimiter::Byte(b';')]), b"1,500.5;2;3.5;4");
        assert_eq!(&*pointed(b"1,5;2;3,5", &[Delimiter::Byte(b';')]), b"1.5;2;3.5");
        assert_eq!(&*pointed(b"a;b,c;d", &[Delimiter::Byte(b';')]), b"a;b,c;d");
        assert_eq!(&*pointed_in_quotes(b"\"1.500,5\",2,\"3,5\",4"), b"\"1,500.5\",2,\"3.5\",4");
        assert_eq!(&*pointed_in_quotes(b"1,2,3"), b"1,2,3");
    }
}
