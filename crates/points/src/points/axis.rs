//! What the raw integers of a source mean.

use rust_decimal::Decimal;
use rust_decimal::prelude::ToPrimitive;
use serde::{Deserialize, Serialize};

/// The names of the axes, for messages.
pub(crate) const AXIS_NAMES: [&str; 3] = ["x", "y", "z"];

/// The exact meaning of the raw integers on one axis: `value = offset + scale * raw`, in the source's unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Axis {
    /// The value of raw integer 0.
    pub offset: Decimal,
    /// The step from one raw integer to the next, above 0.
    pub scale: Decimal,
}

impl Axis {
    /// Returns the value of `raw`: exact decimal arithmetic, rounded once, or floating-point arithmetic where the exact value
    /// does not fit a `Decimal`.
    pub fn value(&self, raw: i64) -> f64 {
        let exact = self.scale.checked_mul(Decimal::from(raw)).and_then(|product| product.checked_add(self.offset));
        let float = |d: Decimal| d.to_f64().unwrap_or(f64::NAN);
        exact.map_or_else(|| float(self.offset) + float(self.scale) * raw as f64, float)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_exact_and_those_that_do_not_fit_a_decimal_are_still_close() {
        let axis = Axis { offset: Decimal::new(1, 1), scale: Decimal::new(1, 2) };
        assert_eq!(axis.value(-7), 0.03);
        let wide = Axis { offset: Decimal::MAX, scale: Decimal::MAX };
        let expected = 7.922816251426434e28 * (1.0 + i64::MAX as f64);
        assert!((wide.value(i64::MAX) / expected - 1.0).abs() < 1e-15);
        let far = Axis { offset: Decimal::MIN, scale: Decimal::ONE };
        assert_eq!(far.value(-1), -7.922816251426434e28);
    }
}
