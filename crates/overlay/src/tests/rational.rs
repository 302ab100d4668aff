//! Exact fractions of any length, slow and short.

use std::cmp::Ordering;

/// A whole number: its sign and its size in digits of 32 bits, the lowest first, without zeros at the end.
#[derive(Clone, Debug, PartialEq)]
struct Whole {
    is_negative: bool,
    digits: Vec<u32>,
}

impl Whole {
    fn new(is_negative: bool, mut digits: Vec<u32>) -> Whole {
        while digits.last() == Some(&0) {
            digits.pop();
        }
        Whole { is_negative: is_negative && !digits.is_empty(), digits }
    }

    fn of(value: i64) -> Whole {
        let size = value.unsigned_abs();
        Whole::new(value < 0, vec![size as u32, (size >> 32) as u32])
    }

    fn times(&self, other: &Whole) -> Whole {
        let mut digits = vec![0u32; self.digits.len() + other.digits.len() + 1];
        for (i, a) in self.digits.iter().enumerate() {
            let mut carry = 0u64;
            for (j, b) in other.digits.iter().chain([&0]).enumerate() {
                let sum = u64::from(*a) * u64::from(*b) + u64::from(digits[i + j]) + carry;
                digits[i + j] = sum as u32;
                carry = sum >> 32;
            }
        }
        Whole::new(self.is_negative != other.is_negative, digits)
    }

    fn size_order(&self, other: &Whole) -> Ordering {
        let lengths = self.digits.len().cmp(&other.digits.len());
        lengths.then_with(|| self.digits.iter().rev().cmp(other.digits.iter().rev()))
    }

    fn plus(&self, other: &Whole) -> Whole {
        let digit = |whole: &Whole, k: usize| i64::from(whole.digits.get(k).copied().unwrap_or(0));
        let (large, small) = if self.size_order(other).is_ge() { (self, other) } else { (other, self) };
        let sign = if self.is_negative == other.is_negative { 1 } else { -1 };
        let (mut digits, mut carry) = (Vec::new(), 0i64);
        for k in 0..=large.digits.len() {
            let sum = digit(large, k) + sign * digit(small, k) + carry;
            digits.push(sum as u32);
            carry = sum >> 32;
        }
        Whole::new(large.is_negative, digits)
    }

    /// Returns the size as `f64 * 2^exponent`.
    fn scaled(&self) -> (f64, i32) {
        let top = self.digits.iter().rev().take(4).fold(0.0, |sum, digit| sum * 4294967296.0 + f64::from(*digit));
        (top, 32 * self.digits.len().saturating_sub(4) as i32)
    }
}

/// A fraction, which is not reduced.
#[derive(Clone, Debug)]
pub(crate) struct Fraction {
    top: Whole,
    /// Above 0.
    bottom: Whole,
}

impl Fraction {
    pub(crate) fn of(value: i64) -> Fraction {
        Fraction { top: Whole::of(value), bottom: Whole::of(1) }
    }

    pub(crate) fn plus(&self, other: &Fraction) -> Fraction {
        if self.bottom == other.bottom {
            return Fraction { top: self.top.plus(&other.top), bottom: self.bottom.clone() };
        }
        let top = self.top.times(&other.bottom).plus(&other.top.times(&self.bottom));
        Fraction { top, bottom: self.bottom.times(&other.bottom) }
    }

    pub(crate) fn minus(&self, other: &Fraction) -> Fraction {
        self.plus(&other.times(&Fraction::of(-1)))
    }

    pub(crate) fn times(&self, other: &Fraction) -> Fraction {
        Fraction { top: self.top.times(&other.top), bottom: self.bottom.times(&other.bottom) }
    }

    pub(crate) fn over(&self, other: &Fraction) -> Fraction {
        let top = self.top.times(&other.bottom);
        let bottom = self.bottom.times(&other.top);
        let top = Whole::new(top.is_negative != bottom.is_negative, top.digits);
        Fraction { top, bottom: Whole::new(false, bottom.digits) }
    }

    /// Returns -1, 0 or 1.
    pub(crate) fn sign(&self) -> i32 {
        match (self.top.digits.is_empty(), self.top.is_negative) {
            (true, _) => 0,
            (_, true) => -1,
            _ => 1,
        }
    }

    pub(crate) fn value(&self) -> f64 {
        let ((top, by), (bottom, below)) = (self.top.scaled(), self.bottom.scaled());
        let size = top / bottom * 2f64.powi(by - below);
        if self.top.is_negative { -size } else { size }
    }
}

#[test]
fn fractions_are_those_of_school() {
    let [third, half] = [3, -2].map(|n| Fraction::of(1).over(&Fraction::of(n)));
    assert_eq!(third.plus(&half).value(), -1.0 / 6.0);
    assert_eq!(third.minus(&half).times(&Fraction::of(1 << 40)).value(), 5.0 / 6.0 * (1u64 << 40) as f64);
    assert_eq!(third.minus(&Fraction::of(2).over(&Fraction::of(6))).sign(), 0);
    let long = Fraction::of(i64::MAX).times(&Fraction::of(i64::MAX)).over(&Fraction::of(i64::MAX));
    assert_eq!((long.value(), long.sign()), (i64::MAX as f64, 1));
}
