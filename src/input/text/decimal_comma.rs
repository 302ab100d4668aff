//! Rows in which a comma is both the delimiter and the sign before decimals, such as 565000,25,5933000,50,12,1.

use crate::input::text::delimiter::Delimiter;

/// Heights and depths of the Earth have fewer digits before their point.
const DIGITS_OF_NO_HEIGHT: usize = 6;

/// Decimals have at most as many digits if a number that follows is to be told from them.
const FEW_DIGITS: usize = 3;

/// Returns whether the commas of these rows without names stand both between columns and before decimals. Then all columns are
/// whole, and every second one holds decimals: it begins with zeros, or the third column, which would be z, is a number that no
/// height is.
pub(crate) fn is_used(delimiter: Delimiter, rows: &[&[u8]]) -> bool {
    if delimiter != Delimiter::Byte(b',') || rows.is_empty() {
        return false;
    }
    let rows: Vec<Vec<&[u8]>> = rows.iter().map(|row| delimiter.fields(row)).collect();
    let is_whole = |field: &&[u8]| {
        let digits = field.strip_prefix(b"-").unwrap_or(field);
        !digits.is_empty() && digits.iter().all(u8::is_ascii_digit)
    };
    let looks_doubled = |row: &Vec<&[u8]>| {
        let no_sign = |column: usize| row[column][0] != b'-';
        row.len() >= 6 && row[..6].iter().all(is_whole) && [1, 3, 5].into_iter().all(no_sign)
    };
    let has_zeros =
        |row: &Vec<&[u8]>| [1, 3, 5].into_iter().any(|column| row[column].len() > 1 && row[column][0] == b'0');
    let no_height = |row: &Vec<&[u8]>| {
        let digits = |column: usize| row[column].strip_prefix(b"-").unwrap_or(row[column]).len();
        digits(2) >= DIGITS_OF_NO_HEIGHT && digits(1) <= FEW_DIGITS && digits(3) <= FEW_DIGITS
    };
    rows.iter().all(looks_doubled) && (rows.iter().any(has_zeros) || rows.iter().all(no_height))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn used(text: &str) -> bool {
        let rows: Vec<&[u8]> = text.lines().map(str::as_bytes).collect();
        is_used(Delimiter::Byte(b','), &rows)
    }

    #[test]
    fn commas_with_two_meanings_are_seen() {
        assert!(used("565000,25,5933000,50,12,1\n565001,25,5933001,50,12,3"));
        assert!(used("12,05,50,50,12,10\n12,15,50,55,13,10"));
        assert!(used("565000,25,5933000,50,12,1,255,0,0"));
        assert!(!used("565000,5933000,12,255,128,3\n565001,5933001,13,255,128,3"));
        assert!(!used("12,5,50,5,12,1"));
        assert!(!used("565000,25,5933000.5,50,12,1"));
        assert!(!used("1,2,3"));
    }
}
