//! What the raw integers of a source mean.

use rust_decimal::Decimal;
use rust_decimal::prelude::ToPrimitive;

/// The exact meaning of the raw integers on one axis: `value = offset + scale * raw`, in the source's unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Axis {
    /// The value of raw integer 0.
    pub offset: Decimal,
    /// The step from one raw integer to the next, above 0.
    pub scale: Decimal,
}

impl Axis {
    /// The value of `raw`, correctly rounded where it fits 28 digits.
    pub fn value(&self, raw: i64) -> f64 {
        let exact = self.scale.checked_mul(Decimal::from(raw)).and_then(|product| product.checked_add(self.offset));
        let float = |d: Decimal| d.to_f64().unwrap_or(f64::NAN);
        exact.map_or_else(|| float(self.offset) + float(self.scale) * raw as f64, float)
    }
}
