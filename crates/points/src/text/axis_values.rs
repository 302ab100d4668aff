//! Comments that give values of x, y and z, such as `# max x y z: 557098.32 5423398.72 141.06` of las2txt: a box, an offset or a scale factor. They
//! are no lists of columns.

use crate::text::column_list::{Word, words};
use crate::text::name::{axis_of, words_of};
use crate::windows_1252::decoded;

/// A bound was rounded by less than this.
const ROUNDED: f64 = 1.0;

/// Whole numbers up to this may be the places of columns.
const MOST_PLACES: f64 = 40.0;

/// What the values of x, y and z are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Meaning {
    Least,
    Greatest,
    /// An offset, a scale factor, or least and greatest values together.
    Other,
}

/// The values that a comment gives of x, y and z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct AxisValues {
    meaning: Meaning,
    values: [f64; 3],
}

impl AxisValues {
    /// Reads the text of a comment; `None` unless it ends with the names of x, y and z and as many numbers, or several times as many.
    pub(crate) fn read(text: &[u8]) -> Option<AxisValues> {
        let decoded = decoded(text);
        let is_between = |c: char| c.is_whitespace() || matches!(c, ',' | ';' | ':' | '=' | '(' | ')' | '[' | ']');
        let fields: Vec<&str> = decoded.split(is_between).filter(|field| !field.is_empty()).collect();
        let value = |field: &&str| field.parse::<f64>().ok().filter(|value| value.is_finite());
        let names = fields.iter().rposition(|field| value(field).is_none())?.saturating_add(1);
        let (names, numbers) = fields.split_at(names);
        if numbers.is_empty() || !numbers.len().is_multiple_of(3) {
            return None;
        }
        let axes: Vec<usize> =
            names.iter().rev().take(3).rev().map_while(|name| axis_of(&name.to_lowercase())).collect();
        let mut values = [f64::NAN; 3];
        axes.iter().zip(numbers).for_each(|(axis, number)| values[*axis] = value(number).unwrap_or(f64::NAN));
        let found = AxisValues { meaning: meaning(text), values };
        let are_all = values.iter().all(|value| !value.is_nan());
        (are_all && !found.may_be_places(text)).then_some(found)
    }

    /// Returns whether the values may be the places of the columns, as in `# columns x y z: 2 3 4`.
    fn may_be_places(&self, text: &[u8]) -> bool {
        let [x, y, z] = self.values;
        let is_place = |value: &f64| value.fract() == 0.0 && (1.0..=MOST_PLACES).contains(value);
        let are_places = self.values.iter().all(is_place) && x != y && y != z && z != x;
        self.meaning == Meaning::Other && (are_places || words(text).contains(&Word::List))
    }

    /// Returns whether a place lies beyond these values, which bound all places.
    pub(crate) fn exclude(&self, place: [f64; 3]) -> bool {
        self.values.iter().zip(place).any(|(bound, value)| match self.meaning {
            Meaning::Least => value < bound - ROUNDED,
            Meaning::Greatest => value > bound + ROUNDED,
            Meaning::Other => false,
        })
    }
}

fn meaning(text: &[u8]) -> Meaning {
    let words = words_of(text);
    let has = |names: [&str; 2]| words.iter().any(|word| names.contains(&word.as_str()));
    match (has(["min", "minimum"]), has(["max", "maximum"])) {
        (true, false) => Meaning::Least,
        (false, true) => Meaning::Greatest,
        _ => Meaning::Other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_before_as_many_numbers_are_no_list() {
        for (text, values) in [
            ("max x y z:   557098.32 5423398.72 141.06", [557098.32, 5423398.72, 141.06]),
            ("max y x z 5423398.72 557098.32 141.06", [557098.32, 5423398.72, 141.06]),
            ("min x,y,z = 1,2,3", [1.0, 2.0, 3.0]),
            ("scale factor x y z:  0.01 0.01 0.001", [0.01, 0.01, 0.001]),
            ("offset x y z: 0 0 0", [0.0; 3]),
            ("bounds (x y z): 100 200 30 400 500 60", [100.0, 200.0, 30.0]),
        ] {
            assert_eq!(AxisValues::read(text.as_bytes()).map(|found| found.values), Some(values), "{text}");
        }
        for text in [
            "x y z",
            "id x y z",
            "x y z i 1 2 3",
            "x y z 1 2",
            "x y z: 2 3 4",
            "columns x y z: 100 101 102",
            "x x z: 500 600 700",
            "1 2 3",
            "",
        ] {
            assert_eq!(AxisValues::read(text.as_bytes()), None, "{text}");
        }
    }

    #[test]
    fn bounds_exclude_places_in_another_order() {
        let read = |text: &str| AxisValues::read(text.as_bytes()).unwrap();
        let place = [556_800.0, 5_423_136.0, 124.8];
        let shifted = [400_000.0, 556_800.0, 5_423_136.0];
        for text in ["max x y z: 557098.3 5423398.7 141", "min x y z: 556700.6 5423100.0 107", "offset x y z: 0 0 0"] {
            assert!(!read(text).exclude(place), "{text}");
            assert_eq!(read(text).exclude(shifted), !text.starts_with("offset"), "{text}");
        }
    }
}
