//! Sums that do not depend on the order of what is added.

use crate::polygon::Polygon;

/// A sum is a whole number of this part of a step.
const PARTS: f64 = 4_294_967_296.0;

/// What is below this, times [`PARTS`], fits an `i64`.
const SHORT: f64 = 9e18;

/// The greatest number that fits an `i128`, with room for many such.
const LONG: f64 = 1e36;

/// A sum in fixed point: each number that is added is rounded to a multiple of 2^-32, and whole numbers are added.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FixedSum {
    parts: i128,
    is_too_large: bool,
}

impl FixedSum {
    /// Adds a number.
    #[inline]
    pub fn add(&mut self, value: f64) {
        let parts = value * PARTS;
        let half = 0.5f64.copysign(parts);
        if parts.abs() < SHORT {
            self.add_parts(i128::from((parts + half) as i64));
        } else {
            self.is_too_large |= parts.is_nan() || parts.abs() >= LONG;
            self.add_parts((parts + half) as i128);
        }
    }

    /// Adds half of a whole number.
    #[inline]
    pub fn add_half(&mut self, double: i128) {
        match double.checked_mul(1 << 31) {
            Some(parts) => self.add_parts(parts),
            None => self.is_too_large = true,
        }
    }

    fn add_parts(&mut self, parts: i128) {
        match self.parts.checked_add(parts) {
            Some(sum) => self.parts = sum,
            None => self.is_too_large = true,
        }
    }

    /// Adds another sum.
    pub fn merge(&mut self, other: FixedSum) {
        self.is_too_large |= other.is_too_large;
        self.add_parts(other.parts);
    }

    /// Returns this sum without another.
    pub fn without(mut self, other: FixedSum) -> FixedSum {
        self.merge(FixedSum { parts: other.parts.saturating_neg(), ..other });
        self
    }

    /// Returns the sum; `None` if it was too large at some time.
    pub fn value(&self) -> Option<f64> {
        (!self.is_too_large).then(|| self.parts as f64 / PARTS)
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
