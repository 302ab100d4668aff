//! What a number with more digits than floating point holds was meant to be.
//!
//! Programs print 565023.14 as 565023.1400000001 or as 5.650231400000000140e+05, and 12.3 from single precision as
//! 12.300000190734863. Digits that only the binary form of a number made are no precision: they must not decide how fine the lattice
//! is.

use crate::text::number::{Number, POWERS};

/// Every number of up to 15 digits survives double precision. More digits are those of the binary number.
const DIGITS_OF_A_DOUBLE: u32 = 15;

/// Nine digits tell all numbers of single precision apart.
const DIGITS_OF_A_SINGLE: u64 = 1_000_000_000;

/// A number that is this close to a shorter one, in parts of the shorter one's last digit, was meant to be the shorter one.
const CLOSE: u128 = 1_000_000;

/// A number that has fewer digits than this after rounding to 15 is as short as people and instruments write numbers.
const SHORT: i64 = POWERS[13];

/// What was meant by a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Meaning {
    /// In as few decimals as it needs.
    pub(crate) number: Number,
    /// Whether it was printed from single precision.
    pub(crate) single: bool,
}

/// Returns what was meant by a number with more digits than double precision holds; `None` if it has no such digits.
#[cold]
pub(crate) fn meaning(number: &Number) -> Option<Meaning> {
    let exact = number.shortest();
    if !exact.is_long() || (exact.decimals == 0 && !exact.rounded) {
        return None;
    }
    let digits = exact.mantissa.unsigned_abs().checked_ilog10().map_or(1, |log| log + 1);
    let double = rounded(&exact, digits.saturating_sub(DIGITS_OF_A_DOUBLE));
    let meant = |number| Some(Meaning { number, single: false });
    if digits > DIGITS_OF_A_DOUBLE && double.mantissa.abs() < SHORT {
        return meant(double);
    }
    match (neighbour(&exact), single(&exact)) {
        (Some(number), _) => meant(number),
        (None, Some(number)) => Some(Meaning { number, single: true }),
        (None, None) => meant(double),
    }
}

/// Returns the number of decimals that `number` needs, which has no more than it needs, if it was printed from single precision: some
/// such numbers are no longer than those that people write.
#[cold]
pub(crate) fn decimals_from_single(number: &Number) -> u8 {
    let is_longer = number.mantissa.unsigned_abs() >= DIGITS_OF_A_SINGLE;
    let meant = if is_longer { single(number) } else { None };
    meant.map_or(number.decimals, |meant| meant.decimals)
}

/// Returns `number` without its last `surplus` digits, at most all of its decimals.
fn rounded(number: &Number, surplus: u32) -> Number {
    let decimals = number.decimals - surplus.min(number.decimals.into()) as u8;
    let mantissa = number.steps(decimals).map_or(number.mantissa, |(mantissa, _)| mantissa);
    Number { mantissa, decimals, rounded: false }.shortest()
}

/// Returns the shortest number that single precision holds as exactly this one.
fn single(number: &Number) -> Option<Number> {
    let value = number.value();
    let single = value as f32;
    let is_single = single.is_finite() && (single as f64 - value).abs() <= value.abs() * 2.0 * f64::EPSILON;
    let meant = is_single.then(|| Number::parse(format!("{single}").as_bytes())).flatten()?;
    (!meant.rounded).then_some(meant.shortest())
}

/// Returns the number with the fewest decimals that this one almost is.
fn neighbour(number: &Number) -> Option<Number> {
    let almost = |decimals: &u8| {
        let unit = POWERS[(number.decimals - decimals) as usize].unsigned_abs() as u128;
        let rest = number.mantissa.unsigned_abs() as u128 % unit;
        rest.min(unit - rest) * CLOSE < unit
    };
    let decimals = (0..number.decimals).find(almost)?;
    Some(rounded(number, (number.decimals - decimals).into()))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn meant(text: &str) -> Option<String> {
        let number = meaning(&Number::parse(text.as_bytes()).unwrap())?.number;
        Some(rust_decimal::Decimal::new(number.mantissa, number.decimals.into()).to_string())
    }

    #[test]
    fn noise_of_printing_is_told_from_precision() {
        for (text, expected) in [
            ("565023.1400000001", "565023.14"),
            ("565023.1399999999", "565023.14"),
            ("12.299999999999999", "12.3"),
            ("0.30000000000000004", "0.3"),
            ("-5.933000141200000420e+06", "-5933000.1412"),
            ("5.650231400000000139e+05", "565023.14"),
            ("23.14000000001397", "23.14"),
            ("12.300000190734863", "12.3"),
            ("812.2999877929688", "812.3"),
            ("1.1641532182693481e-10", "0"),
            ("565023.12345678912", "565023.123456789"),
        ] {
            assert_eq!(meant(text).as_deref(), Some(expected), "{text}");
        }
        for text in ["565023.14", "565023.140000000000", "5933000.12345678", "1000000000000000", "0.123456789012345"] {
            assert_eq!(meant(text), None, "{text}");
        }
    }

    proptest! {
        #[test]
        fn a_decimal_printed_from_a_double_is_found_again(cents in -900_000_000i64..900_000_000, ulps in -2i64..3) {
            let value = cents as f64 / 100.0;
            let noisy = f64::from_bits(value.to_bits().wrapping_add_signed(if value == 0.0 { 0 } else { ulps }));
            for text in [format!("{noisy}"), format!("{noisy:.18e}")] {
                let number = Number::parse(text.as_bytes()).unwrap();
                let meant = meaning(&number).map_or(number.shortest(), |meant| meant.number);
                prop_assert_eq!(meant.steps(2), Some((cents, false)), "{} gave {:?}", text, meant);
            }
        }
    }
}
