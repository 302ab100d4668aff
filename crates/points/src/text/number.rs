//! Decimal numbers as exact integers: a mantissa and a number of decimals. No floating point is involved.

/// The most decimals that are kept. Further decimals are noise of floating-point arithmetic, and are rounded away.
pub(crate) const MOST_DECIMALS: u8 = 15;

/// The most digits that always fit an `i64`.
const MOST_DIGITS: usize = 18;

/// Powers of ten that fit an `i64`.
pub(crate) const POWERS: [i64; 19] = {
    let mut powers = [1; 19];
    let mut i = 1;
    while i < 19 {
        powers[i] = powers[i - 1] * 10;
        i += 1;
    }
    powers
};

/// The number `mantissa / 10^decimals`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Number {
    pub(crate) mantissa: i64,
    /// At most [`MOST_DECIMALS`].
    pub(crate) decimals: u8,
    /// Whether digits had to be rounded away.
    pub(crate) rounded: bool,
}

impl Number {
    /// Reads the number at the start of `bytes` and returns it with its length; the caller checks what follows it. Returns `None`
    /// if there is no number, or only [`Number::parse`] can read it: it begins with a plus sign, or has many digits.
    #[inline]
    pub(crate) fn read(bytes: &[u8]) -> Option<(Number, usize)> {
        let negative = bytes.first() == Some(&b'-');
        let start = negative as usize;
        let (mut mantissa, mut at) = (0i64, start);
        let digit = |at: usize| bytes.get(at).map(|byte| byte.wrapping_sub(b'0')).filter(|&digit| digit < 10);
        while let Some(value) = digit(at) {
            mantissa = mantissa.wrapping_mul(10).wrapping_add(value as i64);
            at += 1;
        }
        let (mut digits, mut decimals) = (at - start, 0);
        if bytes.get(at) == Some(&b'.') {
            at += 1;
            let point = at;
            while let Some(value) = digit(at) {
                mantissa = mantissa.wrapping_mul(10).wrapping_add(value as i64);
                at += 1;
            }
            decimals = at - point;
            digits += decimals;
        }
        if digits == 0 || digits > MOST_DIGITS || decimals > MOST_DECIMALS as usize {
            return None;
        }
        let mantissa = if negative { -mantissa } else { mantissa };
        Some((Number { mantissa, decimals: decimals as u8, rounded: false }, at))
    }

    /// Returns the number that all of `text` says, which may have an exponent and any number of digits; `None` if it is not a
    /// number, or has more than 18 digits before the point.
    pub(crate) fn parse(text: &[u8]) -> Option<Number> {
        if let Some((number, length)) = Number::read(text)
            && length == text.len()
        {
            return Some(number);
        }
        let (negative, unsigned) = match text.first()? {
            b'-' => (true, &text[1..]),
            b'+' => (false, &text[1..]),
            _ => (false, text),
        };
        let exponent_at = unsigned.iter().position(|byte| byte.eq_ignore_ascii_case(&b'e'));
        let digits = Digits::read(&unsigned[..exponent_at.unwrap_or(unsigned.len())])?;
        let exponent = exponent_at.map_or(Some(0), |at| exponent(&unsigned[at + 1..]))?;
        let number = digits.shift(exponent)?;
        Some(if negative { Number { mantissa: -number.mantissa, ..number } } else { number })
    }

    /// Returns what stands for a number that is too large to be read.
    pub(crate) fn too_large(negative: bool) -> Number {
        Number { mantissa: if negative { -i64::MAX } else { i64::MAX }, decimals: 0, rounded: true }
    }

    /// Returns whether this is [`Number::too_large`].
    #[inline(always)]
    pub(crate) fn is_too_large(&self) -> bool {
        self.mantissa == i64::MAX || self.mantissa == -i64::MAX
    }

    /// Returns whether the number has more digits than double precision holds, some of which may be noise.
    #[inline]
    pub(crate) fn is_long(&self) -> bool {
        self.rounded || self.mantissa.unsigned_abs() >= POWERS[15].unsigned_abs()
    }

    /// Returns whether one of the numbers may be [long](Number::is_long): quickly, and for a few that are not.
    #[inline(always)]
    pub(crate) fn may_be_long(numbers: &[Number; 3]) -> bool {
        let [x, y, z] = numbers;
        let bits = x.mantissa.unsigned_abs() | y.mantissa.unsigned_abs() | z.mantissa.unsigned_abs();
        bits >= 1 << 49 || x.rounded || y.rounded || z.rounded
    }

    /// Returns the same number with as few decimals as it needs.
    pub(crate) fn shortest(mut self) -> Number {
        while self.decimals > 0 && self.mantissa % 10 == 0 {
            self.mantissa /= 10;
            self.decimals -= 1;
        }
        self
    }

    /// Returns the number in steps of `10^-decimals`, and whether it was rounded; `None` if it does not fit.
    #[inline]
    pub(crate) fn steps(&self, decimals: u8) -> Option<(i64, bool)> {
        if self.decimals <= decimals {
            let factor = POWERS[(decimals - self.decimals) as usize];
            return Some((self.mantissa.checked_mul(factor)?, self.rounded));
        }
        let (steps, rounded) = divide(self.mantissa, (self.decimals - decimals) as u32);
        Some((steps, rounded || self.rounded))
    }

    /// Returns the nearest floating-point number, or one of its neighbours if there are more than 15 digits.
    #[inline]
    pub(crate) fn value(&self) -> f64 {
        self.mantissa as f64 / POWERS[self.decimals as usize] as f64
    }
}

/// The significant digits of a number without sign and exponent: `mantissa * 10^-decimals`.
struct Digits {
    mantissa: i64,
    decimals: i64,
    rounded: bool,
}

impl Digits {
    fn read(text: &[u8]) -> Option<Digits> {
        let mut all = Digits { mantissa: 0, decimals: 0, rounded: false };
        let (mut count, mut point, mut dropped) = (0usize, false, None);
        for &byte in text {
            match byte {
                b'.' if !point => point = true,
                b'0'..=b'9' => {
                    count += 1;
                    if all.mantissa < POWERS[MOST_DIGITS - 1] {
                        all.mantissa = all.mantissa * 10 + (byte - b'0') as i64;
                        all.decimals += point as i64;
                    } else {
                        all.decimals -= !point as i64;
                        all.rounded |= byte != b'0';
                        dropped = dropped.or(Some(byte));
                    }
                }
                _ => return None,
            }
        }
        all.mantissa += dropped.is_some_and(|byte| byte >= b'5') as i64;
        (count > 0).then_some(all)
    }

    fn shift(self, exponent: i64) -> Option<Number> {
        let decimals = self.decimals - exponent;
        let number = |mantissa, decimals, rounded| Number { mantissa, decimals, rounded };
        if self.mantissa == 0 {
            return Some(number(0, 0, self.rounded));
        }
        if decimals < 0 {
            let factor = POWERS.get(usize::try_from(-decimals).ok()?)?;
            return Some(number(self.mantissa.checked_mul(*factor)?, 0, self.rounded));
        }
        if decimals <= MOST_DECIMALS as i64 {
            return Some(number(self.mantissa, decimals as u8, self.rounded));
        }
        let surplus = u32::try_from(decimals - MOST_DECIMALS as i64).unwrap_or(u32::MAX);
        let (mantissa, rounded) = divide(self.mantissa, surplus);
        Some(number(mantissa, MOST_DECIMALS, rounded || self.rounded))
    }
}

/// Returns `mantissa / 10^digits`, rounded to the nearest integer (halves away from zero), and whether it was rounded.
fn divide(mantissa: i64, digits: u32) -> (i64, bool) {
    let Some(&divisor) = POWERS.get(digits as usize) else {
        return (0, mantissa != 0);
    };
    let (quotient, rest) = (mantissa / divisor, mantissa % divisor);
    let up = rest.unsigned_abs() * 2 >= divisor as u64 && rest != 0;
    (quotient + if up { rest.signum() } else { 0 }, rest != 0)
}

/// Reads the exponent after the letter e. An exponent beyond 2^20 becomes 2^20, which is too large as well.
fn exponent(text: &[u8]) -> Option<i64> {
    let (sign, digits) = match text.first()? {
        b'-' => (-1, &text[1..]),
        b'+' => (1, &text[1..]),
        _ => (1, text),
    };
    let step = |value: i64, byte: &u8| byte.is_ascii_digit().then(|| (value * 10 + (byte - b'0') as i64).min(1 << 20));
    (!digits.is_empty()).then(|| digits.iter().try_fold(0, step)).flatten().map(|value| sign * value)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn parse(text: &str) -> Option<(i64, u8, bool)> {
        Number::parse(text.as_bytes()).map(|n| (n.mantissa, n.decimals, n.rounded))
    }

    #[test]
    fn plain_numbers_are_exact() {
        assert_eq!(parse("635577.79"), Some((63557779, 2, false)));
        assert_eq!(parse("-0.00025"), Some((-25, 5, false)));
        assert_eq!(parse("+5."), Some((5, 0, false)));
        assert_eq!(parse(".5"), Some((5, 1, false)));
        assert_eq!(parse("-0"), Some((0, 0, false)));
    }

    #[test]
    fn exponents_and_long_numbers_are_exact_if_they_fit() {
        assert_eq!(parse("1.5e3"), Some((1500, 0, false)));
        assert_eq!(parse("6.3557779E+05"), Some((63557779, 2, false)));
        assert_eq!(parse("25e-5"), Some((25, 5, false)));
        assert_eq!(parse("0e999999999999"), Some((0, 0, false)));
        assert_eq!(parse("1.5000000000000000000000"), Some((1500000000000000, 15, false)));
        assert_eq!(parse("0.30000000000000004"), Some((300000000000000, 15, true)));
        assert_eq!(parse("0.1234567890123455"), Some((123456789012346, 15, true)));
    }

    #[test]
    fn text_that_is_not_a_number_is_refused() {
        for text in [
            "",
            "-",
            ".",
            "+.",
            "1.2.3",
            "1e",
            "1e+",
            "e5",
            "nan",
            "inf",
            "-Infinity",
            "1,5",
            "0x10",
            "1 2",
            "1e400",
            "--1",
        ] {
            assert_eq!(parse(text), None, "{text}");
        }
        assert_eq!(parse("9999999999999999999"), None);
    }

    #[test]
    fn steps_round_halves_away_from_zero() {
        let steps = |text: &str, decimals| Number::parse(text.as_bytes()).unwrap().steps(decimals);
        assert_eq!(steps("1.5", 2), Some((150, false)));
        assert_eq!(steps("1.125", 2), Some((113, true)));
        assert_eq!(steps("-1.125", 2), Some((-113, true)));
        assert_eq!(steps("-1.120", 2), Some((-112, false)));
        assert_eq!(steps("999999999999999999", 2), None);
    }

    proptest! {
        #[test]
        fn numbers_agree_with_the_standard_library(text in "[+-]?[0-9]{0,12}(\\.[0-9]{0,17})?([eE][+-]?[0-9]{1,2})?") {
            match (Number::parse(text.as_bytes()), text.parse::<f64>()) {
                (None, Err(_)) => {}
                (None, Ok(value)) => prop_assert!(value.abs() >= 1e18, "{text}"),
                (Some(number), Ok(value)) => {
                    let slack = if number.rounded { 0.51e-15 + value.abs() * 1e-15 } else { value.abs() * 4e-16 };
                    prop_assert!((number.value() - value).abs() <= slack, "{text}: {number:?}");
                }
                (Some(number), Err(_)) => prop_assert!(false, "{text} gave {number:?}"),
            }
        }

        #[test]
        fn shortest_and_steps_keep_the_value(mantissa in -1_000_000_000_000i64..1_000_000_000_000, decimals in 0u8..6) {
            let number = Number { mantissa, decimals, rounded: false };
            let short = number.shortest();
            prop_assert_eq!(short.steps(decimals), Some((mantissa, false)));
            prop_assert!(short.decimals == 0 || short.mantissa % 10 != 0);
        }
    }
}
