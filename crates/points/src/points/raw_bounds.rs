//! The bounds of a job in the raw integers of a source. They hold before any rounding to a lattice.

use rust_decimal::prelude::ToPrimitive;
use serde::{Deserialize, Serialize};

use crate::points::axis::Axis;
use lattice::shortest_decimal;

/// The raw integers within bounds in x and y, borders included. If `min` exceeds `max` on an axis, there are none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RawBounds {
    /// Least x and y.
    pub min: [i64; 2],
    /// Greatest x and y.
    pub max: [i64; 2],
}

impl RawBounds {
    /// Returns the bounds [xmin, ymin, xmax, ymax] in the raw integers of these axes.
    pub fn of(axes: &[Axis; 3], bounds: [f64; 4]) -> RawBounds {
        let steps = |bound: f64, axis: &Axis| {
            let from = shortest_decimal(bound).and_then(|bound| bound.checked_sub(axis.offset));
            from.and_then(|from| from.checked_div(axis.scale))
        };
        // A bound beyond all numbers is beyond all raw integers.
        let far = |bound: f64| if bound < 0.0 { i64::MIN } else { i64::MAX };
        let least = |axis: usize| steps(bounds[axis], &axes[axis]).and_then(|steps| steps.ceil().to_i64());
        let greatest = |axis: usize| steps(bounds[axis + 2], &axes[axis]).and_then(|steps| steps.floor().to_i64());
        RawBounds {
            min: [0, 1].map(|axis| least(axis).unwrap_or(far(bounds[axis]))),
            max: [0, 1].map(|axis| greatest(axis).unwrap_or(far(bounds[axis + 2]))),
        }
    }

    /// Returns whether a record may lie within both bounds.
    pub(crate) fn meet(&self, other: &RawBounds) -> bool {
        (0..2).all(|axis| self.min[axis].max(other.min[axis]) <= self.max[axis].min(other.max[axis]))
    }

    /// Returns whether a record with these raw integers lies within the bounds.
    #[inline]
    pub(crate) fn hold(&self, raw: &[i64; 3]) -> bool {
        let is_within = |axis: usize| raw[axis] >= self.min[axis] && raw[axis] <= self.max[axis];
        is_within(0) && is_within(1)
    }
}

#[cfg(test)]
mod tests {
    use rust_decimal::Decimal;

    use super::*;

    #[test]
    fn bounds_are_exact_in_raw_integers() {
        let axis = Axis { offset: Decimal::new(5, 1), scale: Decimal::new(1, 2) };
        let bounds = RawBounds::of(&[axis; 3], [0.994, -1e300, 1.006, 2.5]);
        assert_eq!(bounds, RawBounds { min: [50, i64::MIN], max: [50, 200] });
        let beside = |x: i64| RawBounds { min: [x, 190], max: [x + 9, i64::MAX] };
        assert_eq!([40, 41, 50, 51].map(|x| bounds.meet(&beside(x))), [false, true, true, false]);
        assert!(!RawBounds { min: [51, 0], max: [50, 9] }.meet(&RawBounds { min: [0; 2], max: [99; 2] }));
        assert!(bounds.hold(&[50, 200, 0]) && !bounds.hold(&[51, 0, 0]) && !bounds.hold(&[50, 201, 0]));
    }
}
