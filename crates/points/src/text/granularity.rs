//! The coarsest grid on which a column of numbers lies.

use rust_decimal::Decimal;
use serde::{Deserialize, Serialize};

use crate::text::number::{Number, POWERS};

/// The largest step, `step / 10^decimals`, that divides all numbers seen so far; 0 if all of them were 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Granularity {
    step: u64,
    decimals: u8,
}

impl Granularity {
    /// Returns the step of numbers with this many decimals.
    pub(crate) fn of_decimals(decimals: u8) -> Granularity {
        Granularity { step: 1, decimals }
    }

    /// Takes one more number into account.
    #[inline]
    pub(crate) fn see(&mut self, number: &Number) {
        let mantissa = number.mantissa.unsigned_abs();
        let same = number.decimals == self.decimals && self.step > 0 && mantissa.is_multiple_of(self.step);
        let finest = self.step == 1 && number.decimals <= self.decimals;
        if !same && !finest {
            self.add(&Granularity { step: mantissa, decimals: number.decimals });
        }
    }

    /// Takes all numbers that `other` has seen into account.
    pub(crate) fn add(&mut self, other: &Granularity) {
        let decimals = self.decimals.max(other.decimals);
        let scaled = |g: &Granularity| g.step.checked_mul(POWERS[(decimals - g.decimals) as usize] as u64);
        // A number that is too long to compare is assumed to need its last digit.
        let step = scaled(self).zip(scaled(other)).map_or(1, |(a, b)| gcd(a, b));
        *self = Granularity { step, decimals };
    }

    /// Returns the step; `None` if all numbers seen were 0.
    pub(crate) fn value(&self) -> Option<Decimal> {
        let step = Decimal::from_i128_with_scale(self.step.into(), self.decimals.into()).normalize();
        (self.step > 0).then_some(step)
    }
}

fn gcd(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { gcd(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(texts: &[&str]) -> Option<String> {
        let mut all = Granularity::default();
        texts.iter().for_each(|text| all.see(&Number::parse(text.as_bytes()).unwrap()));
        all.value().map(|step| step.to_string())
    }

    #[test]
    fn the_step_is_the_largest_that_divides_all_numbers() {
        assert_eq!(step(&["273357.14525", "-273357.14500", "0"]).unwrap(), "0.00025");
        assert_eq!(step(&["440750", "441890"]).unwrap(), "10");
        assert_eq!(step(&["0.5", "0.75", "3"]).unwrap(), "0.25");
        assert_eq!(step(&["1.1", "2.3"]).unwrap(), "0.1");
        assert_eq!(step(&["999999999999999999", "0.000000000000001"]).unwrap(), "0.000000000000001");
        assert_eq!(step(&["0", "0.0"]), None);
    }
}
