//! The lowest and the highest heights of a file, and how many records have each.

use serde::{Deserialize, Serialize};

/// How many of the lowest and of the highest values are kept.
const KEPT: usize = 12;

/// A height and who has it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SharedHeight {
    pub value: f64,
    /// How many records have it.
    pub(crate) count: u64,
    /// The number of the first of them, or of its line.
    pub(crate) first: u64,
}

/// The lowest and the highest values of heights, and how many records have each.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Extremes {
    pub(crate) lowest: Lowest,
    /// With the other sign.
    pub(crate) highest: Lowest,
}

/// The lowest values, ascending.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Lowest(pub(crate) Vec<SharedHeight>);

impl Lowest {
    #[inline(always)]
    fn see(&mut self, height: SharedHeight) {
        let is_higher = |last: &SharedHeight| self.0.len() == KEPT && height.value > last.value;
        if !self.0.last().is_some_and(is_higher) {
            self.insert(height);
        }
    }

    #[inline(never)]
    fn insert(&mut self, height: SharedHeight) {
        match self.0.binary_search_by(|known| known.value.total_cmp(&height.value)) {
            Ok(at) => {
                let known = &mut self.0[at];
                known.count = known.count.saturating_add(height.count);
                known.first = known.first.min(height.first);
            }
            Err(at) => {
                self.0.insert(at, height);
                self.0.truncate(KEPT);
            }
        }
    }

    /// Returns the heights that are not numbers for nodata; `None` if there is none.
    pub(crate) fn rest(&self, is_number: impl Fn(f64) -> bool) -> Option<Vec<SharedHeight>> {
        let rest: Vec<SharedHeight> = self.0.iter().filter(|height| !is_number(height.value)).copied().collect();
        (!rest.is_empty()).then_some(rest)
    }
}

impl Extremes {
    /// Takes the height of record or line `number`.
    #[inline(always)]
    pub fn see(&mut self, value: f64, number: u64) {
        self.see_shared(SharedHeight { value, count: 1, first: number });
    }

    #[inline(always)]
    fn see_shared(&mut self, height: SharedHeight) {
        // -0 is 0.
        self.lowest.see(SharedHeight { value: height.value + 0.0, ..height });
        self.highest.see(SharedHeight { value: 0.0 - height.value, ..height });
    }

    /// Takes the heights of the records after these, whose numbers are counted from `before`.
    pub(crate) fn add(&mut self, other: &Extremes, before: u64) {
        let moved = |height: &SharedHeight| SharedHeight { first: height.first.saturating_add(before), ..*height };
        other.lowest.0.iter().for_each(|height| self.lowest.see(moved(height)));
        other.highest.0.iter().for_each(|height| self.highest.see(moved(height)));
    }

    /// Returns these heights with numbers that count from `before`.
    pub(crate) fn after(&self, before: u64) -> Extremes {
        let mut moved = Extremes::default();
        moved.add(self, before);
        moved
    }

    /// Returns these heights in other units.
    pub fn map(&self, to: impl Fn(f64) -> f64) -> Extremes {
        let map = |lowest: &Lowest, sign: f64| {
            let moved =
                lowest.0.iter().map(|height| SharedHeight { value: sign * to(sign * height.value) + 0.0, ..*height });
            Lowest(moved.collect())
        };
        Extremes { lowest: map(&self.lowest, 1.0), highest: map(&self.highest, -1.0) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(heights: impl IntoIterator<Item = f64>) -> Extremes {
        let mut extremes = Extremes::default();
        (0..).zip(heights).for_each(|(number, height)| extremes.see(height, number));
        extremes
    }

    #[test]
    fn extremes_of_parts_are_those_of_the_whole() {
        let heights: Vec<f64> = (0..1000).map(|i| f64::from((i * 7919) % 353) - 50.0).collect();
        let mut parts = Extremes::default();
        for (number, part) in (0..).zip(heights.chunks(100)) {
            parts.add(&of(part.iter().copied()), number * 100);
        }
        assert_eq!(parts, of(heights));
    }
}
