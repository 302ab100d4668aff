//! Columns that nothing names and of which the first is the number of the point, not x.

use crate::text::delimiter::Delimiter;
use crate::text::number::Number;

/// Of fewer rows nobody can say that their first column counts them.
const LEAST_ROWS: usize = 5;

/// The columns of a number and of x, y and z.
const COLUMNS: usize = 4;

/// Returns whether the first of four or more columns is the number of the row: whole, and one more from row to row, or at least growing
/// where each of the next three columns has decimals. x, y and z are written alike.
pub(crate) fn are_numbered(delimiter: Delimiter, rows: &[&[u8]]) -> bool {
    let rows = with_whole_first(delimiter, rows);
    let steps = |is_step: fn(i64) -> bool| {
        rows.windows(2).all(|pair| pair[1][0].mantissa.checked_sub(pair[0][0].mantissa).is_some_and(is_step))
    };
    !rows.is_empty() && (steps(|step| step == 1) || steps(|step| step > 0) && have_decimals(&rows))
}

/// Returns whether the first of four or more columns is whole, and each of the next three has decimals.
pub(crate) fn may_be_numbered(delimiter: Delimiter, rows: &[&[u8]]) -> bool {
    let rows = with_whole_first(delimiter, rows);
    !rows.is_empty() && have_decimals(&rows)
}

/// Returns the first columns of these rows if the first of them is whole in all, and if they are enough.
fn with_whole_first(delimiter: Delimiter, rows: &[&[u8]]) -> Vec<[Number; COLUMNS]> {
    let read = |row: &&[u8]| -> Option<[Number; COLUMNS]> {
        let fields = delimiter.fields(row);
        let numbers: Vec<Number> = fields.iter().take(COLUMNS).map_while(|field| Number::parse(field)).collect();
        numbers.try_into().ok()
    };
    if rows.iter().find_map(read).is_none_or(|first| first[0].decimals > 0) {
        return Vec::new();
    }
    let rows: Vec<[Number; COLUMNS]> = rows.iter().filter_map(read).collect();
    if rows.len() < LEAST_ROWS || rows.iter().any(|row| row[0].decimals > 0) { Vec::new() } else { rows }
}

fn have_decimals(rows: &[[Number; COLUMNS]]) -> bool {
    let has_decimals = |column: usize| rows.iter().filter(|row| row[column].decimals > 0).count() * 2 > rows.len();
    (1..COLUMNS).all(has_decimals)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbered(row: impl Fn(usize) -> String) -> bool {
        let rows: Vec<String> = (0..50).map(row).collect();
        let rows: Vec<&[u8]> = rows.iter().map(String::as_bytes).collect();
        are_numbered(Delimiter::Blank, &rows)
    }

    #[test]
    fn the_number_of_a_point_is_told_from_x() {
        assert!(numbered(|i| format!("{} 5933000.50 565000.25 12.1 GND", i + 1)));
        assert!(numbered(|i| format!("{} 5933000 565000 12", 100 + i)));
        assert!(numbered(|i| format!("{} 5933000.50 565000.25 12.1", i * i + i)));
        assert!(!numbered(|i| format!("{} 5933000.50 12.1", i + 1)));
        assert!(!numbered(|i| format!("{} {} 12.1 255", i % 10, i / 10)));
        assert!(!numbered(|i| format!("{}.5 {} 12.1 255", i, i / 10)));
        assert!(!numbered(|i| format!("{} 5933000 565000 12", 2 * i)));
        assert!(!numbered(|i| format!("{} 5933000.5 565000.5 12.5", i % 7)));
    }
}
