//! Ranges of coordinates for messages: rounded outwards to few digits, so that a user can copy them into the configuration.

/// Returns the ends of a range, rounded outwards to about a hundredth of its length.
pub(crate) fn rounded([low, high]: [f64; 2]) -> [String; 2] {
    let length = (high - low).max(1e-6);
    let digits = (2.0 - length.log10().floor()).clamp(-9.0, 9.0) as i32;
    let step = 10f64.powi(-digits);
    let decimals = digits.max(0) as usize;
    [(low / step).floor() * step, (high / step).ceil() * step].map(|end| format!("{end:.decimals$}"))
}

/// Returns the ends of a range for `[input] heights`, which takes no single height.
pub(crate) fn rounded_heights([low, high]: [f64; 2]) -> [String; 2] {
    let margin = if low < high { 0.0 } else { 1.0 };
    rounded([low - margin, high + margin])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_rounded_outwards() {
        for (range, expected) in [
            ([605_000.13, 605_499.97], ["605000", "605500"]),
            ([-0.314, 75.66], ["-0.4", "75.7"]),
            ([6_782_000.0, 6_982_001.0], ["6782000", "6983000"]),
            ([5.0, 5.0], ["5.00000000", "5.00000000"]),
        ] {
            assert_eq!(rounded(range), expected.map(String::from), "{range:?}");
        }
        assert_eq!(rounded_heights([5.0, 5.0]), ["4.00", "6.00"].map(String::from));
    }
}
