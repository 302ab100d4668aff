//! `[input] heights`: between which heights the points lie that a job reads.

use rust_decimal::prelude::ToPrimitive;
use serde::{Deserialize, Serialize};

use crate::points::axis::Axis;
use lattice::shortest_decimal;

/// The lowest and the highest height of the points that a job reads, both included, in the unit of the files.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<f64>")]
pub struct KeptHeights(pub [f64; 2]);

impl KeptHeights {
    /// Returns whether a height is kept.
    pub(crate) fn hold(self, height: f64) -> bool {
        let KeptHeights([low, high]) = self;
        (low..=high).contains(&height)
    }

    /// Returns the raw integers of these heights on an axis.
    pub(crate) fn raw(self, axis: &Axis) -> RawHeights {
        let KeptHeights([low, high]) = self;
        let steps = |height: f64| {
            let from = shortest_decimal(height).and_then(|height| height.checked_sub(axis.offset));
            from.and_then(|from| from.checked_div(axis.scale))
        };
        // A height beyond all numbers is beyond all raw integers.
        let far = |height: f64| if height < 0.0 { i64::MIN } else { i64::MAX };
        RawHeights {
            min: steps(low).and_then(|steps| steps.ceil().to_i64()).unwrap_or(far(low)),
            max: steps(high).and_then(|steps| steps.floor().to_i64()).unwrap_or(far(high)),
        }
    }
}

/// The raw heights that a job keeps of a LAS or LAZ file, both included.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct RawHeights {
    min: i64,
    max: i64,
}

impl RawHeights {
    /// Returns whether a raw height is kept.
    #[inline]
    pub(crate) fn hold(self, raw: i64) -> bool {
        (self.min..=self.max).contains(&raw)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rust_decimal::Decimal;

    #[test]
    fn heights_are_exact_in_raw_integers() {
        let axis = Axis { offset: Decimal::new(5, 1), scale: Decimal::new(1, 2) };
        let heights = KeptHeights([0.994, 1e300]).raw(&axis);
        assert_eq!([49, 50, i64::MAX].map(|raw| heights.hold(raw)), [false, true, true]);
        let heights = KeptHeights([-1e300, 2.5]).raw(&axis);
        assert_eq!([i64::MIN, 200, 201].map(|raw| heights.hold(raw)), [true, true, false]);
        assert!(KeptHeights([-1.0, 2.0]).hold(2.0) && !KeptHeights([-1.0, 2.0]).hold(-1.01));
    }
}
