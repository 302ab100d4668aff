//! Signs between thousands where they look like something else: blanks or commas like delimiters, points like those before decimals.

use crate::text::delimiter::Delimiter;

/// The number of rows that show it.
const ROWS: usize = 300;

/// Of fewer rows nobody can say what is common to them by chance.
const LEAST_ROWS: usize = 8;

/// So many numbers with a point show that none has one or two decimals.
const LEAST_POINTED: usize = 50;

/// Returns whether the numbers of `rows` have signs between thousands that are taken for something else: blanks or commas that part
/// columns under `delimiter`, or points. `places` are the columns of x, y and z. Decimals have a point before them.
pub(crate) fn are_separated(delimiter: Delimiter, places: &[usize], rows: &[&[u8]]) -> bool {
    let rows = &rows[..rows.len().min(ROWS)];
    if rows.len() < LEAST_ROWS {
        return false;
    }
    if delimiter == Delimiter::Blank && are_most(rows, has_grouped_fields) {
        return true;
    }
    let fields: Vec<Vec<&[u8]>> = rows.iter().map(|row| delimiter.fields(row)).collect();
    let is_parted = matches!(delimiter, Delimiter::Blank | Delimiter::Byte(b','));
    is_parted && places.starts_with(&[0, 1]) && are_groups(&fields)
        || places.iter().any(|place| has_pointed_thousands(&fields, *place))
}

fn are_most(rows: &[&[u8]], is: impl Fn(&[u8]) -> bool) -> bool {
    let count = rows.iter().filter(|row| is(row)).count();
    count * 2 > rows.len()
}

/// Returns whether tabs part three numbers, of which one has blanks between its thousands.
fn has_grouped_fields(row: &[u8]) -> bool {
    let fields = Delimiter::Byte(b'\t').fields(row);
    let grouped = || fields.iter().filter(|field| is_grouped(field)).count();
    let plain = || fields.iter().filter(|field| is_number(field)).count();
    fields.len() >= 3 && grouped() > 0 && grouped() + plain() >= 3
}

/// Returns whether a field is one number with blanks between its thousands, as in "5 933 030.25".
fn is_grouped(field: &[u8]) -> bool {
    let groups: Vec<&[u8]> = field.split(|byte| *byte == b' ').collect();
    let [first, middle @ .., last] = groups.as_slice() else { return false };
    let whole = last.split(|byte| *byte == b'.').next().unwrap_or_default();
    (1..=3).contains(&first.strip_prefix(b"-").unwrap_or(first).len())
        && middle.iter().chain([&whole]).all(|group| group.len() == 3 && group.iter().all(u8::is_ascii_digit))
        && is_number(first)
        && is_number(last)
}

fn is_number(field: &[u8]) -> bool {
    std::str::from_utf8(field).is_ok_and(|text| text.parse::<f64>().is_ok())
}

/// Returns whether the second column is always the last three digits of the first number: it is padded with zeros, and the first is not.
fn are_groups(rows: &[Vec<&[u8]>]) -> bool {
    let is_first = |field: &[u8]| {
        let digits = field.strip_prefix(b"-").unwrap_or(field);
        (1..=3).contains(&digits.len()) && digits[0] != b'0' && digits.iter().all(u8::is_ascii_digit)
    };
    let is_group = |field: &[u8]| {
        let mut parts = field.split(|byte| *byte == b'.');
        let whole = parts.next().unwrap_or_default();
        whole.len() == 3 && whole.iter().all(u8::is_ascii_digit) && is_number(field)
    };
    let is_row = |row: &Vec<&[u8]>| row.len() >= 4 && is_first(row[0]) && is_group(row[1]);
    let is_padded = |row: &Vec<&[u8]>| row[1].starts_with(b"0");
    rows.iter().all(is_row) && rows.iter().any(is_padded)
}

/// Returns whether a column has numbers below a thousand without a point, and all others with exactly three digits after it: a program
/// that leaves out zeros at the end leaves out the last of some, and one that does not writes them always.
fn has_pointed_thousands(rows: &[Vec<&[u8]>], place: usize) -> bool {
    let (mut pointed, mut plain) = (0, 0);
    for field in rows.iter().filter_map(|row| row.get(place)) {
        let digits = field.strip_prefix(b"-").unwrap_or(field);
        let mut parts = digits.split(|byte| *byte == b'.');
        let (Some(whole), after, None) = (parts.next(), parts.next(), parts.next()) else { return false };
        let are_digits = |part: &[u8]| !part.is_empty() && part.iter().all(u8::is_ascii_digit);
        let may_be_thousands = whole.len() <= 3 && are_digits(whole) && (whole[0] != b'0' || whole.len() == 1);
        match after {
            None if may_be_thousands => plain += 1,
            Some(after) if may_be_thousands && whole != b"0" && after.len() == 3 && are_digits(after) => pointed += 1,
            _ => return false,
        }
    }
    pointed >= LEAST_POINTED && plain > 0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn separated(delimiter: Delimiter, row: impl Fn(usize) -> String) -> bool {
        let rows: Vec<String> = (0..300).map(row).collect();
        let rows: Vec<&[u8]> = rows.iter().map(String::as_bytes).collect();
        are_separated(delimiter, &[0, 1, 2], &rows)
    }

    #[test]
    fn thousands_are_told_from_columns_and_decimals() {
        let (blank, comma, semicolon) = (Delimiter::Blank, Delimiter::Byte(b','), Delimiter::Byte(b';'));
        assert!(separated(blank, |i| format!("565 {}.50\t5 933 {}.25\t99.5", 200 + i, 500 + i)));
        assert!(separated(blank, |i| format!("565 {:03}.50 5 933 {:03}.25 99.5", i, 300 + i)));
        assert!(separated(comma, |i| format!("565,{i:03},5,933,{:03},100", 300 + i)));
        let pointed = |value: usize| {
            if value < 1000 { value.to_string() } else { format!("{}.{:03}", value / 1000, value % 1000) }
        };
        assert!(separated(semicolon, |i| format!("{};{};7.5", pointed(137 * i), pointed(91 * i))));
        for (delimiter, row) in [
            (blank, (|i| format!("{i}.5 {}.25 99.5 7", 300 + i)) as fn(usize) -> String),
            (blank, |i| format!("565{i:03} 5933{:03} 99 007", 300 + i)),
            (blank, |i| format!("1{i:02}\t2{i:02}\t3 4")),
            (comma, |i| format!("{i},{},{}", 7 * i % 50, i % 4)),
            (semicolon, |i| format!("{i}.125;{i}.250;{}.5", i % 9)),
            (semicolon, |i| format!("{};{};{}", i as f64 * 0.125, i as f64 * 0.1, i)),
            (semicolon, |i| format!("{i}.000;{i}.100;7")),
        ] {
            assert!(!separated(delimiter, row), "{}", row(7));
        }
    }
}
