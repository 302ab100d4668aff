//! Whole numbers of two widths. Both give the same results wherever the narrow one suffices.

use std::ops::{Add, Mul, Neg, Sub};

/// `i64`, or `i128` where numbers may be longer.
pub(crate) trait WholeNumber:
    Copy + From<i64> + Ord + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self>
{
    /// Returns the nearest `f64`.
    fn nearest(self) -> f64;

    /// Returns the quotient of two numbers, correctly rounded where it is a whole number below 2^53, and else within some ulp.
    fn quotient(self, divisor: Self) -> f64;
}

/// Below this, whole numbers are exact as `f64`.
const EXACT: u64 = 1 << 53;

impl WholeNumber for i64 {
    #[inline(always)]
    fn nearest(self) -> f64 {
        self as f64
    }

    #[inline(always)]
    fn quotient(self, divisor: i64) -> f64 {
        if self.unsigned_abs() < EXACT {
            return self as f64 / divisor as f64;
        }
        (self / divisor) as f64 + (self % divisor) as f64 / divisor as f64
    }
}

impl WholeNumber for i128 {
    #[inline(always)]
    fn nearest(self) -> f64 {
        self as f64
    }

    #[inline]
    fn quotient(self, divisor: i128) -> f64 {
        if self.unsigned_abs() < u128::from(EXACT) {
            return self as f64 / divisor as f64;
        }
        (self / divisor) as f64 + (self % divisor) as f64 / divisor as f64
    }
}
