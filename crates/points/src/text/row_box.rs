//! The box of rows.

use serde::{Deserialize, Serialize};

use crate::text::number::Number;

/// The least and the greatest x, y, z of rows. Without a row, infinite and inside out.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RowBox {
    /// The least x, y, z.
    pub min: [f64; 3],
    /// The greatest x, y, z.
    pub max: [f64; 3],
}

impl RowBox {
    /// Returns the box of no row.
    pub(crate) fn empty() -> RowBox {
        RowBox { min: [f64::INFINITY; 3], max: [f64::NEG_INFINITY; 3] }
    }

    /// Returns the box, unless no row is in it.
    pub(crate) fn some(self) -> Option<RowBox> {
        (self.min[0] <= self.max[0]).then_some(self)
    }

    /// Takes one more row into the box.
    #[inline(always)]
    pub(crate) fn see(&mut self, numbers: &[Number; 3]) {
        for (axis, number) in numbers.iter().enumerate() {
            let value = number.value();
            self.min[axis] = self.min[axis].min(value);
            self.max[axis] = self.max[axis].max(value);
        }
    }

    /// Takes all rows of another box into this one.
    pub(crate) fn add(&mut self, other: &RowBox) {
        for axis in 0..3 {
            self.min[axis] = self.min[axis].min(other.min[axis]);
            self.max[axis] = self.max[axis].max(other.max[axis]);
        }
    }

    /// Returns whether all rows of the box lie at one place.
    pub(crate) fn is_point(&self) -> bool {
        self.min == self.max
    }

    /// Returns whether the row lies in the box, borders included.
    #[inline]
    pub(crate) fn holds(&self, numbers: &[Number; 3]) -> bool {
        (0..3).all(|axis| (self.min[axis]..=self.max[axis]).contains(&numbers[axis].value()))
    }

    /// Returns whether all of `other` lies in the box.
    pub fn holds_box(&self, other: &RowBox) -> bool {
        (0..3).all(|axis| self.min[axis] <= other.min[axis] && other.max[axis] <= self.max[axis])
    }

    /// Returns the greatest distance from zero along `axis`.
    pub(crate) fn farthest(&self, axis: usize) -> f64 {
        self.min[axis].abs().max(self.max[axis].abs())
    }
}
