//! Sums that do not depend on the order of what is added.

use crate::polygon::Polygon;

/// 2^64: the number of parts that make 1.
const PARTS: f64 = 18_446_744_073_709_551_616.0;

/// What is below this fits an `i64`.
const SHORT: f64 = 9e18;

/// The greatest number that fits an `i128`, with room for many such.
const LONG: f64 = 1e36;

/// A sum in fixed point: each number that is added is cut to a multiple of 2^-64, and whole numbers are added.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FixedSum {
    /// The greatest whole number that is not above the sum.
    whole: i128,
    /// What the sum has above it, in parts of 2^-64.
    parts: u64,
    is_too_large: bool,
}

impl FixedSum {
    /// Adds a number.
    #[inline]
    pub fn add(&mut self, value: f64) {
        let floor = value.floor();
        // A fraction that is rounded to 1 becomes the greatest number of parts.
        let parts = ((value - floor) * PARTS) as u64;
        if floor.abs() < SHORT {
            self.add_exact(i128::from(floor as i64), parts);
        } else {
            self.is_too_large |= floor.is_nan() || floor.abs() >= LONG;
            self.add_exact(floor as i128, parts);
        }
    }

    /// Adds half of a whole number.
    #[inline]
    pub fn add_half(&mut self, double: i128) {
        let half = if double & 1 == 0 { 0 } else { 1 << 63 };
        self.add_exact(double >> 1, half);
    }

    fn add_exact(&mut self, whole: i128, parts: u64) {
        let (parts, carries) = self.parts.overflowing_add(parts);
        let sum = self.whole.checked_add(whole).and_then(|sum| sum.checked_add(carries.into()));
        match sum {
            Some(whole) => (self.whole, self.parts) = (whole, parts),
            None => self.is_too_large = true,
        }
    }

    /// Adds another sum.
    pub fn merge(&mut self, other: FixedSum) {
        self.is_too_large |= other.is_too_large;
        self.add_exact(other.whole, other.parts);
    }

    /// Returns this sum without another.
    pub fn without(mut self, other: FixedSum) -> FixedSum {
        self.is_too_large |= other.is_too_large;
        // The complement of the whole number is one below its negative: the parts make up for it.
        match other.parts {
            0 => self.add_exact(other.whole.saturating_neg(), 0),
            parts => self.add_exact(!other.whole, parts.wrapping_neg()),
        }
        self
    }

    /// Returns the sum; `None` if it was too large at some time.
    pub fn value(&self) -> Option<f64> {
        (!self.is_too_large).then(|| self.whole as f64 + self.parts as f64 / PARTS)
    }
}

/// Areas and volumes between two terrains, in lattice steps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Totals {
    /// The common area.
    pub area: FixedSum,
    /// What was removed: the volume where the later terrain lies below the earlier one.
    pub cut: FixedSum,
    /// What was added.
    pub fill: FixedSum,
    /// The greatest difference upwards, or 0.
    pub max_rise: f64,
    /// The greatest difference downwards, or 0.
    pub max_fall: f64,
}

impl Totals {
    /// Adds the totals of other triangles.
    pub fn merge(&mut self, other: &Totals) {
        self.area.merge(other.area);
        self.cut.merge(other.cut);
        self.fill.merge(other.fill);
        self.max_rise = self.max_rise.max(other.max_rise);
        self.max_fall = self.max_fall.max(other.max_fall);
    }

    /// Adds a polygon. Differences below `threshold`, which is not negative, are left out of the volumes. `double_area` is twice the area, if
    /// it is known exactly.
    #[inline]
    pub(crate) fn add(&mut self, polygon: &Polygon, double_area: Option<i128>, threshold: f64) {
        let rises = || polygon.vertices().iter().map(|vertex| vertex.rise);
        let [low, high] =
            rises().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], rise| [low.min(rise), high.max(rise)]);
        if low > high {
            return;
        }
        let [area, volume] = polygon.area_and_volume();
        match double_area {
            Some(double_area) => self.area.add_half(double_area),
            None => self.area.add(area),
        }
        self.max_rise = self.max_rise.max(high);
        self.max_fall = self.max_fall.max(-low);
        if low >= threshold {
            self.fill.add(volume);
        } else if high <= -threshold {
            self.cut.add(-volume);
        } else {
            self.add_parts(polygon, [low, high], threshold);
        }
    }

    fn add_parts(&mut self, polygon: &Polygon, [low, high]: [f64; 2], threshold: f64) {
        if high >= threshold {
            let above = polygon.clipped(|vertex| vertex.rise - threshold, |vertex| vertex.rise = threshold);
            self.fill.add(above.area_and_volume()[1]);
        }
        if low <= -threshold {
            let below = polygon.clipped(|vertex| -threshold - vertex.rise, |vertex| vertex.rise = -threshold);
            self.cut.add(-below.area_and_volume()[1]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn small_numbers_are_not_lost() {
        let mut sum = FixedSum::default();
        (0..1000).for_each(|_| sum.add(0.225e-6));
        assert!((sum.value().unwrap() - 0.225e-3).abs() < 1e-16);
        sum.add(-1e-300);
        sum.add_half(-3);
        assert!((sum.value().unwrap() + 1.5 - 0.225e-3).abs() < 1e-15);
        sum.add(1e37);
        assert_eq!(sum.value(), None);
    }

    proptest! {
        #[test]
        fn sums_have_the_same_bits_in_any_order(values in prop::collection::vec(-1e12..1e12f64, 1..50), cut in 0..50usize) {
            let sum = |values: &mut dyn Iterator<Item = f64>| {
                let mut sum = FixedSum::default();
                values.for_each(|value| sum.add(value));
                sum
            };
            let all = sum(&mut values.iter().copied());
            prop_assert_eq!(all, sum(&mut values.iter().rev().copied()));
            let cut = cut.min(values.len());
            let mut joined = sum(&mut values[cut..].iter().copied());
            let first = sum(&mut values[..cut].iter().copied());
            prop_assert_eq!(all.without(first), joined);
            joined.merge(first);
            prop_assert_eq!(all, joined);
            prop_assert_eq!(all.without(all), FixedSum::default());
            let plain: f64 = values.iter().sum();
            prop_assert!((all.value().unwrap() - plain).abs() < 1e-2);
        }
    }
}
