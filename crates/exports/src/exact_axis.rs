//! Source coordinates of lattice integers, without rounding.

use crate::place::Place;
use crate::text::push_padded;
use lattice::Lattice;
use rust_decimal::Decimal;

/// An axis of a lattice.
#[derive(Clone, Debug)]
pub struct ExactAxis {
    lattice: Lattice,
    axis: usize,
    short: Option<ShortDecimals>,
}

/// `(offset + step * i) / 10^digits`, where the numerator of every `i32` fits an `i64`.
#[derive(Clone, Copy, Debug)]
struct ShortDecimals {
    offset: i64,
    step: i64,
    digits: usize,
    /// 10^digits
    power: u64,
}

/// Doubles hold whole numbers up to this one, and powers of ten up to 10^22.
const EXACT_IN_DOUBLE: u64 = 1 << 53;

impl ShortDecimals {
    fn of(offset: Decimal, step: Decimal) -> Option<ShortDecimals> {
        let (offset, step) = (offset.normalize(), step.normalize());
        let digits = offset.scale().max(step.scale());
        let whole = |d: Decimal| {
            let power = 10_i128.checked_pow(digits - d.scale())?;
            i64::try_from(d.mantissa().checked_mul(power)?).ok()
        };
        let (offset, step) = (whole(offset)?, whole(step)?);
        let power = 10_u64.checked_pow(digits)?;
        let fits = |i: i64| step.checked_mul(i)?.checked_add(offset);
        fits(i32::MIN.into()).and(fits(i32::MAX.into()))?;
        Some(ShortDecimals { offset, step, digits: digits as usize, power })
    }

    fn numerator(&self, i: i32) -> i64 {
        self.offset + self.step * i64::from(i)
    }
}

impl ExactAxis {
    /// Returns the axis with this number: 0 for x, 1 for y, 2 for z.
    pub fn of(lattice: &Lattice, axis: usize) -> ExactAxis {
        let short = ShortDecimals::of(lattice.offset[axis], lattice.step(axis));
        ExactAxis { lattice: lattice.clone(), axis, short }
    }

    /// Appends the coordinate of lattice integer `i` as a decimal number, with no more digits than it needs.
    pub fn push(&self, i: i32, out: &mut Vec<u8>) {
        let Some(short) = &self.short else {
            return out.extend(self.lattice.world_text(self.axis, i).bytes());
        };
        let numerator = short.numerator(i);
        if numerator < 0 {
            out.push(b'-');
        }
        let size = numerator.unsigned_abs();
        push_padded(size / short.power, 1, out);
        let fraction = size % short.power;
        if fraction > 0 {
            out.push(b'.');
            push_padded(fraction, short.digits, out);
            let zeros = out.iter().rev().take_while(|digit| **digit == b'0').count();
            out.truncate(out.len() - zeros);
        }
    }

    /// Returns the double that is nearest to the coordinate of lattice integer `i`.
    pub fn number(&self, i: i32) -> f64 {
        if let Some(short) = &self.short {
            let numerator = short.numerator(i);
            if numerator.unsigned_abs() <= EXACT_IN_DOUBLE && short.power <= EXACT_IN_DOUBLE {
                // Both are exact, so the division rounds once.
                return numerator as f64 / short.power as f64;
            }
        }
        // The standard library reads decimals with correct rounding.
        self.lattice.world_text(self.axis, i).parse().unwrap_or(f64::NAN)
    }
}

/// A place of a lattice, with the axes that give its source coordinates.
#[derive(Clone, Copy, Debug)]
pub struct LatticePlace<'a> {
    /// x, y and z.
    pub axes: &'a [ExactAxis; 3],
    /// The place in lattice steps.
    pub at: [i32; 3],
}

impl Place for LatticePlace<'_> {
    fn push(&self, axis: usize, out: &mut Vec<u8>) {
        self.axes[axis].push(self.at[axis], out);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn axis(offset: Decimal, step: Decimal) -> Option<ExactAxis> {
        Some(ExactAxis::of(&Lattice::new([offset; 3], step, step)?, 0))
    }

    fn text(axis: &ExactAxis, i: i32) -> String {
        let mut out = b"before".to_vec();
        axis.push(i, &mut out);
        String::from_utf8(out).unwrap().strip_prefix("before").unwrap().to_owned()
    }

    #[test]
    fn numbers_are_as_short_as_they_can_be() {
        let axis = axis(Decimal::new(-1_000, 3), Decimal::new(25, 2)).unwrap();
        let found: Vec<String> = [0, 1, 4, 5, 44, 4004, -4].map(|i| text(&axis, i)).into();
        assert_eq!(found, ["-1", "-0.75", "0", "0.25", "10", "1000", "-2"]);
    }

    proptest! {
        #[test]
        fn texts_and_numbers_are_those_of_the_decimals(
            mantissa: i64, digits in 0u32..19, step in 1i64..100_000, step_digits in 0u32..12, i: i32,
        ) {
            let (offset, step) = (Decimal::new(mantissa, digits), Decimal::new(step, step_digits));
            if let Some(axis) = axis(offset, step) {
                let expected = axis.lattice.world_text(0, i);
                prop_assert_eq!(text(&axis, i), expected.as_str());
                prop_assert_eq!(axis.number(i), expected.parse::<f64>().unwrap());
            }
        }

        #[test]
        fn common_lattices_are_short(mantissa in -1_000_000_000_000i64..1_000_000_000_000, i: i32) {
            let axis = axis(Decimal::new(mantissa, 4), Decimal::new(1, 3)).unwrap();
            prop_assert!(axis.short.is_some());
            let expected = axis.lattice.world_text(0, i);
            prop_assert_eq!(text(&axis, i), expected.as_str());
            prop_assert_eq!(axis.number(i), expected.parse::<f64>().unwrap());
        }
    }
}
