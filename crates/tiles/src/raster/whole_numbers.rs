//! The whole numbers in which rasters are drawn: of 64 bits where they suffice, which is nearly everywhere, else of 128.

use std::ops::{Add, Mul, Neg, Sub};

/// A whole number.
pub(crate) trait WholeNumber:
    Copy + Ord + From<i32> + From<u32> + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self>
{
    /// Returns the nearest floating-point number; of two, the even one.
    fn nearest(self) -> f64;

    /// Returns the quotient rounded down, and whether there is no rest. The divisor is positive.
    fn divided(self, by: Self) -> (Self, bool);

    /// Returns the number within `0..=most`.
    fn within(self, most: u32) -> u32;
}

impl WholeNumber for i64 {
    #[inline(always)]
    fn nearest(self) -> f64 {
        self as f64
    }

    #[inline(always)]
    fn divided(self, by: i64) -> (i64, bool) {
        let (quotient, rest) = (self / by, self % by);
        (quotient - i64::from(rest < 0), rest == 0)
    }

    #[inline(always)]
    fn within(self, most: u32) -> u32 {
        self.clamp(0, i64::from(most)) as u32
    }
}

impl WholeNumber for i128 {
    fn nearest(self) -> f64 {
        self as f64
    }

    fn divided(self, by: i128) -> (i128, bool) {
        (self.div_euclid(by), self.rem_euclid(by) == 0)
    }

    fn within(self, most: u32) -> u32 {
        self.clamp(0, i128::from(most)) as u32
    }
}
