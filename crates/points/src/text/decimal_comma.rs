//! Rows in which a comma is both the delimiter and the sign before decimals, such as 565000,25,5933000,50,12,1.

use std::collections::BTreeMap;

use crate::text::delimiter::Delimiter;

/// Heights and depths of the Earth have fewer digits before their point.
const DIGITS_OF_NO_HEIGHT: usize = 6;

/// Decimals have at most as many digits if they are to be told from coordinates.
const MOST_DECIMALS: usize = 4;

/// Of fewer rows nobody can say what is common to them by chance.
const LEAST_ROWS: usize = 8;

/// One row in so many may be broken.
const BROKEN: usize = 10;

/// One row in so many has another number of columns because it is broken, not because its decimals were zeros.
const RAGGED: usize = 50;

/// x, y and z take so many columns if all of them have decimals.
const COLUMNS: usize = 6;

/// Rows without names and with more columns hold more than the number of the point, coordinates with decimals, and a colour.
const MOST_COLUMNS: usize = 10;

/// Rows without names and with more columns hold colours or other whole numbers after z, not its decimals alone.
const MOST_COLUMNS_Z_ALONE: usize = 7;

/// Which of x, y and z have decimals, as bits. x and y are written alike, so both have them or neither.
const PATTERNS: [usize; 3] = [0b011, Z_ALONE, 0b111];

/// Only z has decimals.
const Z_ALONE: usize = 0b100;

/// What the commas of rows stand for, if not only between columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum CommaUse {
    /// Before decimals as well.
    Decimals,
    /// Probably before decimals as well.
    Unclear,
    /// Between columns, but maybe before the decimals of z as well.
    Columns,
}

/// What is known of the columns without looking at the rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Names {
    /// Nothing.
    None,
    /// A comment has so many words, x, y and z first. It may name fewer columns than there are.
    InComment(usize),
    /// They begin with x, y, z.
    CoordinatesFirst,
    /// They begin with something else.
    Others,
}

/// The columns of a row that are all whole numbers, or those at its start.
type WholeRow<'a> = Vec<&'a [u8]>;

/// A row with a text in it may begin with decimals if so many whole numbers stand before the text.
const LEAST_COLUMNS: usize = 4;

/// Returns what the commas of these rows stand for; `None` if they stand between columns. Decimals after a comma are whole numbers in a
/// column of their own, so one number with a point in it shows that the commas stand between columns. `named` is the number of names.
pub(crate) fn second_use(delimiter: Delimiter, names: Names, named: Option<usize>, rows: &[&[u8]]) -> Option<CommaUse> {
    if delimiter != Delimiter::Byte(b',') {
        return None;
    }
    let all: Vec<Vec<&[u8]>> = rows.iter().map(|row| delimiter.fields(row)).collect();
    let looked_at = |row: &Vec<&[u8]>| row.len().min(COLUMNS);
    let has_point = |row: &Vec<&[u8]>| row[..looked_at(row)].iter().any(|field| is_pointed(field));
    if all.iter().any(has_point) {
        return None;
    }
    let count = all.len();
    let is_whole_row = |row: &Vec<&[u8]>| row.len() >= 3 && row[..looked_at(row)].iter().all(|field| is_whole(field));
    let is_most = |rows: usize| rows > 0 && (count - rows) * BROKEN <= count;
    let (whole, others): (Vec<WholeRow>, Vec<WholeRow>) = all.into_iter().partition(is_whole_row);
    // The lengths of rows with texts in them say nothing: a text may hold a comma.
    if is_most(whole.len()) && are_ragged(&whole, named) {
        return Some(CommaUse::Decimals);
    }
    let before_text = others.into_iter().filter_map(|mut row| {
        row.truncate(row.iter().take_while(|field| is_whole(field)).count());
        (row.len() >= LEAST_COLUMNS).then_some(row)
    });
    let whole: Vec<WholeRow> = whole.into_iter().chain(before_text).collect();
    if !is_most(whole.len()) {
        return None;
    }
    if names != Names::Others && (have_no_heights(&whole) || have_zeros(&whole, names)) {
        return Some(CommaUse::Decimals);
    }
    let words = match names {
        Names::None => None,
        Names::InComment(words) => Some(words),
        Names::CoordinatesFirst | Names::Others => return None,
    };
    possible_decimals(&whole, words)
}

/// Returns whether `field` is a number with a point. A date, a time or the name of a file is none.
pub(crate) fn is_pointed(field: &[u8]) -> bool {
    field.contains(&b'.') && std::str::from_utf8(field).is_ok_and(|text| text.parse::<f64>().is_ok())
}

fn is_whole(field: &[u8]) -> bool {
    let digits = field.strip_prefix(b"-").unwrap_or(field);
    !digits.is_empty() && digits.iter().all(u8::is_ascii_digit)
}

fn digits(field: &[u8]) -> usize {
    field.strip_prefix(b"-").unwrap_or(field).len()
}

fn is_padded(field: &[u8]) -> bool {
    field.len() > 1 && field[0] == b'0'
}

/// Returns whether the third column is a number that no height is, and the second as short as decimals: no terrain is that high
/// and that narrow.
fn have_no_heights(rows: &[WholeRow]) -> bool {
    let no_height = |row: &&WholeRow| {
        row.len() > 3 && digits(row[2]) >= DIGITS_OF_NO_HEIGHT && digits(row[1]) <= MOST_DECIMALS && row[1][0] != b'-'
    };
    rows.iter().filter(no_height).count() * 2 > rows.len()
}

/// Returns whether numbers in the columns of decimals begin with zeros, and none in those before them: who pads coordinates pads
/// all of them.
fn have_zeros(rows: &[WholeRow], names: Names) -> bool {
    // Named columns after z hold what they say, such as colours with three digits each.
    let (columns, least): (&[usize], usize) =
        if names == Names::CoordinatesFirst { (&[1], 4) } else { (&[1, 3, 5], 6) };
    let padded =
        |columns: &[usize]| rows.iter().any(|row| columns.iter().any(|&c| row.get(c).is_some_and(|f| is_padded(f))));
    let signed = |row: &WholeRow| columns.iter().any(|&column| row[column][0] == b'-');
    let fits = rows.iter().all(|row| row.len() >= least && !signed(row));
    fits && padded(columns) && !padded(&[0, 2, 4])
}

/// Returns whether rows differ in the number of their columns: programs leave out decimals that are zeros, and the comma before them.
/// Writers of tables leave out the last column at most.
fn are_ragged(rows: &[WholeRow], named: Option<usize>) -> bool {
    let usual = usual_length(rows);
    if rows.iter().all(|row| row.len() == usual || row.len() + 1 == usual) && named.is_none_or(|named| named == usual) {
        return false;
    }
    let others = rows.iter().filter(|row| row.len() != usual).count();
    rows.len() >= LEAST_ROWS && others >= 2 && others * RAGGED >= rows.len()
}

fn usual_length(rows: &[WholeRow]) -> usize {
    let mut with_length = BTreeMap::new();
    rows.iter().for_each(|row| *with_length.entry(row.len()).or_insert(0) += 1);
    with_length.into_iter().max_by_key(|(_, rows)| *rows).map_or(0, |(length, _)| length)
}

/// Returns what commas stand for if columns that nothing names can be read as coordinates with decimals, with or without the number of the
/// row before them. If a comment has so many `words`, rows of any width can, if it has no word for the decimals. If only z has decimals, the
/// column after it is as likely a class or an intensity, unless z is the same in all rows, or a comment names all other columns.
fn possible_decimals(rows: &[WholeRow], words: Option<usize>) -> Option<CommaUse> {
    let usual = usual_length(rows);
    let rows: Vec<&WholeRow> = rows.iter().filter(|row| row.len() == usual).collect();
    if rows.len() < LEAST_ROWS || usual < 4 {
        return None;
    }
    let starts = if are_numbered(&rows) { 0..2 } else { 0..1 };
    let is_usual = |pattern: usize| {
        let unnamed = words.map_or(0, |words| usual.saturating_sub(words));
        match pattern {
            Z_ALONE => usual <= MOST_COLUMNS_Z_ALONE || unnamed == 1,
            _ => usual <= MOST_COLUMNS || unnamed >= pattern.count_ones() as usize,
        }
    };
    let is_unnamed = words.is_some_and(|words| usual == words + 1);
    let use_of = |start: usize, pattern: usize| {
        let is_column = pattern == Z_ALONE && !is_unnamed && !are_same(&rows, start + 2);
        if is_column { CommaUse::Columns } else { CommaUse::Unclear }
    };
    let patterns = || PATTERNS.into_iter().filter(|pattern| is_usual(*pattern));
    let readings = starts.flat_map(|start| patterns().map(move |pattern| (start, pattern)));
    let fitting = readings.filter(|(start, pattern)| fits_pattern(&rows, *start, *pattern));
    fitting.map(|(start, pattern)| use_of(start, pattern)).min()
}

/// Returns whether the first column counts the rows.
fn are_numbered(rows: &[&WholeRow]) -> bool {
    let number = |row: &&WholeRow| std::str::from_utf8(row[0]).ok()?.parse::<i64>().ok();
    let numbers: Option<Vec<i64>> = rows.iter().map(number).collect();
    numbers.is_some_and(|numbers| numbers.windows(2).all(|pair| pair[0].checked_add(1) == Some(pair[1])))
}

/// Returns whether the columns from `start` on can be x, y and z if those have decimals whose bits are set in `pattern`.
fn fits_pattern(rows: &[&WholeRow], start: usize, pattern: usize) -> bool {
    let mut column = start;
    // Without decimals, the points would lie on a line.
    let is_line = pattern != Z_ALONE && are_same(rows, start + 1);
    for axis in 0..3 {
        column += 1;
        if pattern & (1 << axis) == 0 {
            continue;
        }
        // A column that is the same in all rows holds something else than decimals, such as a class, unless it is the y of no terrain.
        let is_class = column >= rows[0].len() || (are_same(rows, column) && !is_line);
        if is_class || !are_decimals(rows, column) {
            return false;
        }
        column += 1;
    }
    column <= rows[0].len()
}

fn are_same(rows: &[&WholeRow], column: usize) -> bool {
    rows.iter().all(|row| row[column] == rows[0][column])
}

/// Returns whether a column looks like decimals: few digits without a sign, and either as many in all rows or none with a zero at the
/// end. Most columns with anything else fail both.
fn are_decimals(rows: &[&WholeRow], column: usize) -> bool {
    let fields = || rows.iter().map(|row| row[column]);
    let short = fields().all(|field| field[0] != b'-' && field.len() <= MOST_DECIMALS);
    let fixed = fields().all(|field| field.len() == rows[0][column].len());
    let trimmed = fields().all(|field| field == b"0" || !field.ends_with(b"0"));
    short && (fixed || trimmed)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn used(names: Names, text: &str) -> Option<CommaUse> {
        let rows: Vec<&[u8]> = text.lines().map(str::as_bytes).collect();
        second_use(Delimiter::Byte(b','), names, None, &rows)
    }

    fn table(rows: usize, row: impl Fn(usize) -> String) -> String {
        (0..rows).map(|i| row(i) + "\n").collect()
    }

    #[test]
    fn commas_with_two_meanings_are_seen() {
        let decimals = Some(CommaUse::Decimals);
        assert_eq!(used(Names::None, "565000,25,5933000,50,12,1\n565001,25,5933001,50,12,3"), decimals);
        assert_eq!(used(Names::None, "12,05,50,50,12,10\n12,15,50,55,13,10"), decimals);
        assert_eq!(used(Names::None, "565000,25,5933000,50,12,1,255,0,0"), decimals);
        assert_eq!(used(Names::None, "565000,5933000,12,255,128,3\n565001,5933001,13,255,128,3"), None);
        assert_eq!(used(Names::None, "12,5,50,5,12,1"), None);
        assert_eq!(used(Names::None, "565000,25,5933000.5,50,12,1"), None);
        assert_eq!(used(Names::None, "565000,25,5933000,50,12,01.02.2024"), decimals);
        assert_eq!(used(Names::None, "1,2,3"), None);
    }

    #[test]
    fn decimal_commas_are_seen_under_names_in_ragged_rows_and_with_whole_heights() {
        let decimals = Some(CommaUse::Decimals);
        let six =
            |i: usize| format!("{},{},{},{},{},{}", 565_000 + i, i % 9, 5_933_000 + 7 * i, 50 + i % 40, 12, i % 10);
        let five = |i: usize| format!("{},{},{},{},{}", 565_000 + i, 10 + i % 80, 5_933_000 + 7 * i, i % 90, 12);
        for names in [Names::None, Names::CoordinatesFirst] {
            assert_eq!(used(names, &table(50, six)), decimals);
            assert_eq!(used(names, &table(50, |i| if i == 10 { five(i) } else { six(i) })), decimals);
            assert_eq!(used(names, &table(50, five)), decimals);
        }
        let small = |i: usize| format!("{},{:02},{},{},{},{}", i, i % 90, i % 7, 11 + i % 80, i % 5, 12);
        assert_eq!(used(Names::CoordinatesFirst, &table(50, small)), decimals);
        // Decimals of zeros are left out.
        let dropped = |i: usize| {
            if i.is_multiple_of(10) { format!("{i},{},5,3", 2 * i) } else { format!("{i},{},{i},5,3,1", i % 10) }
        };
        for names in [Names::None, Names::CoordinatesFirst, Names::Others] {
            assert_eq!(used(names, &table(50, dropped)), decimals);
        }
    }

    #[test]
    fn decimal_commas_are_seen_before_a_text() {
        let coded = |i: usize| format!("{},{},{},{},{},GND", 565_013 + i, 44 + i % 50, 5_933_084 + i, 74 - i % 60, 25);
        for names in [Names::None, Names::CoordinatesFirst] {
            assert_eq!(used(names, &table(50, coded)), Some(CommaUse::Decimals));
        }
        let heights = |i: usize| format!("{},{},12,{},tree {i}", 565_000 + i, 5_933_000 + 7 * i, 10 + i % 90);
        assert_eq!(used(Names::None, &table(50, heights)), Some(CommaUse::Unclear));
        // Texts with commas in them.
        let notes = |i: usize| {
            let note = ["Baum", "Baum, alt", "", "7", "a,b,c"][i % 5];
            format!("{},{},{},5,{note}", 565_000 + i, 5_933_000 + 7 * i, 12 + i % 90)
        };
        assert_eq!(used(Names::CoordinatesFirst, &table(300, notes)), None);
        let triples = |i: usize| format!("{},{},{},GND", 565_000 + i, 5_933_000 + 7 * i, 12 + i % 90);
        assert_eq!(used(Names::None, &table(300, triples)), None);
    }

    #[test]
    fn whole_columns_that_may_be_decimals_are_unclear_unless_they_have_names() {
        let numbered = |i: usize| {
            format!("{i},{},{},{},{},{},5", 565_000 + 3 * i, 10 + i % 90, 5_933_000 + i, 10 + 7 * i % 90, i % 9)
        };
        let heights = |i: usize| format!("{},{},12,{}", 565_000 + i, 5_933_000 + 7 * i, 10 + i % 90);
        let local = |i: usize| {
            format!("{},{},{},{},{},{}", 100 + i, i % 10, 200 + 7 * i % 100, i * 3 % 10, 7 + i % 9, i * 7 % 10)
        };
        let centres = |i: usize| format!("{},5,{},5,{}", i % 9, i / 9, 3 + i % 4);
        for text in [table(50, numbered), table(50, heights), table(50, local), table(50, centres)] {
            assert_eq!(used(Names::None, &text), Some(CommaUse::Unclear), "{text}");
            assert_eq!(used(Names::CoordinatesFirst, &text), None, "{text}");
        }
    }

    #[test]
    fn a_column_after_whole_coordinates_is_a_column() {
        let heights = |i: usize| format!("{},{},{},{}", 565_000 + i, 5_933_000 + 7 * i, 12 + i % 3, 10 + i % 90);
        let strip = |i: usize| format!("{},{},{},{}", 1000 + i / 4, i % 4, 200 + i % 3, 1 + i % 7);
        for text in [table(50, heights), table(50, strip)] {
            assert_eq!(used(Names::None, &text), Some(CommaUse::Columns), "{text}");
            assert_eq!(used(Names::CoordinatesFirst, &text), None, "{text}");
        }
        let classed = |i: usize| format!("{},{},{},2", 1000 + i / 4, i % 4, 200 + i % 3);
        let flagged = |i: usize| format!("{},{},{},2,0", 1000 + i / 4, i % 4, 200 + i % 3);
        assert_eq!(used(Names::None, &table(50, classed)), None);
        assert_eq!(used(Names::None, &table(50, flagged)), None);
    }

    #[test]
    fn decimals_are_seen_in_wide_rows_that_a_comment_names_in_part() {
        let unclear = Some(CommaUse::Unclear);
        let wide = |count: usize, i: usize| {
            let row = [75_404 + i, i * 7 % 10, 80_200 + i * i % 99, i * 3 % 10, 266 + i % 9, i * 7 % 10, 127, 68, 44];
            let row = row.into_iter().chain((0..20).map(|more| more + i % 7)).take(count);
            row.map(|field| field.to_string()).collect::<Vec<_>>().join(",")
        };
        assert_eq!(used(Names::None, &table(300, |i| wide(9, i))), unclear);
        assert_eq!(used(Names::None, &table(300, |i| format!("{i},{}", wide(9, i)))), unclear);
        assert_eq!(used(Names::InComment(6), &table(300, |i| wide(9, i))), unclear);
        assert_eq!(used(Names::InComment(20), &table(300, |i| wide(23, i))), unclear);
        assert_eq!(used(Names::InComment(3), &table(300, |i| wide(12, i))), unclear);
        let named = Names::InComment(20);
        // x and y are whole.
        let high = |count: usize, i: usize| {
            let row =
                [75_404 + 3 * i, 80_200 + i * i % 99, 266 + i % 9, i * 7 % 10, 127, 68, 44, 5 * i % 256, 3 * i % 256];
            let row = row.into_iter().chain((0..20).map(|more| more + i % 7)).take(count);
            row.map(|field| field.to_string()).collect::<Vec<_>>().join(",")
        };
        assert_eq!(used(Names::InComment(8), &table(300, |i| high(9, i))), unclear);
        for (names, count) in [(Names::None, 9), (Names::None, 20), (Names::InComment(6), 9), (named, 20), (named, 24)]
        {
            assert_eq!(used(names, &table(300, |i| high(count, i))), None, "{names:?} {count}");
        }
        assert_eq!(used(Names::CoordinatesFirst, &table(300, |i| high(20, i))), None);
        let colored =
            |i: usize| format!("{},{},{},{},{},70,9,8,7", 1_000 + 3 * i, 40 * i, 12 + i % 90, i * 5 % 256, i * i % 256);
        for names in [Names::None, Names::InComment(6), Names::InComment(8), Names::InComment(3)] {
            assert_eq!(used(names, &table(300, colored)), None, "{names:?}");
        }
    }

    #[test]
    fn a_table_without_some_of_its_last_column_is_a_table() {
        let classed = |i: usize| {
            let class = if i.is_multiple_of(3) { "" } else { ",2" };
            format!("{},{},{}{class}", 565_000 + i, 5_933_000 + 7 * i, 12 + i % 90)
        };
        let text = table(300, classed);
        let rows: Vec<&[u8]> = text.lines().map(str::as_bytes).collect();
        assert_eq!(second_use(Delimiter::Byte(b','), Names::CoordinatesFirst, Some(4), &rows), None);
        assert_eq!(second_use(Delimiter::Byte(b','), Names::None, None, &rows), None);
        let decimals = Some(CommaUse::Decimals);
        assert_eq!(second_use(Delimiter::Byte(b','), Names::CoordinatesFirst, Some(3), &rows), decimals);
    }

    #[test]
    fn tables_of_whole_numbers_are_tables() {
        let colored = |i: usize| {
            format!("{},{},{},{},{},{}", 565_000 + i, 5_933_000 + 7 * i, 12 + i % 90, i % 256, 5 * i % 256, 70)
        };
        let intense =
            |i: usize| format!("{},{},{},{}", 5_650_000 + 13 * i, 59_330_000 + 7 * i, 1_200 + i, 17 * i % 3000);
        let classed = |i: usize| format!("{},{},{},2", 565_000 + i, 5_933_000 + 7 * i, 12 + i % 90);
        let local = |i: usize| format!("{},{},{},{}", 40 * i, 70 * i % 900, i % 90, 3 * i % 256);
        let padded = |i: usize| format!("{:05},{:05},{:05},{:03},000,012", 3 * i, 7 * i % 1000, i % 90, i % 256);
        let empty = |i: usize| format!("{i},{},{},{}", 3 * i, i % 9, if i.is_multiple_of(2) { "" } else { "5" });
        let triples = |i: usize| format!("{i},{},{}", 7 * i % 50, i % 4);
        for text in [
            table(300, colored),
            table(300, intense),
            table(300, classed),
            table(300, local),
            table(300, empty),
            table(300, triples),
            table(300, |i| if i == 9 { "7,8,9,10,11".into() } else { triples(i) }),
            table(300, |i| if i == 9 { "7,8".into() } else { triples(i) }),
        ] {
            assert_eq!(used(Names::None, &text), None, "{}", &text[..60]);
            assert_eq!(used(Names::CoordinatesFirst, &text), None, "{}", &text[..60]);
        }
        assert_eq!(used(Names::CoordinatesFirst, &table(300, padded)), None);
    }
}
