//! Numbers and times as text.

use std::time::Duration;

/// Returns `value` with its digits in groups of three.
pub fn grouped(value: u64) -> String {
    let digits = value.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(' ');
        }
        text.push(digit);
    }
    text
}

/// Returns a number with its first two digits: an estimate tells no more.
pub fn rough(number: u64) -> u64 {
    let unit = 10u64.pow(number.checked_ilog10().unwrap_or(0).saturating_sub(1));
    (number + unit / 2) / unit * unit
}

/// Returns a count and what is counted, which is named in the singular.
pub fn counted(count: u64, what: &str) -> String {
    format!("{} {what}{}", grouped(count), if count == 1 { "" } else { "s" })
}

/// Returns an amount of bytes as whole mebibytes.
pub fn mebibytes(bytes: u64) -> String {
    format!("{} MiB", grouped(bytes >> 20))
}

/// Returns an amount of bytes as mebibytes with one decimal.
pub fn precise_mebibytes(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / (1 << 20) as f64)
}

/// Returns a time to come, rounded to what an estimate is worth.
pub fn rough_time(seconds: f64) -> String {
    // An estimate that is not a number is shown as the longest time.
    let seconds = Duration::try_from_secs_f64(seconds).map_or(u64::MAX, |time| time.as_secs());
    match seconds {
        0..=90 => format!("{seconds} s"),
        91..=5400 => format!("{} min", (seconds + 30) / 60),
        _ => format!("{} h {} min", seconds / 3600, seconds % 3600 / 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_are_in_groups_of_three() {
        assert_eq!([0, 999, 1000, 10_653_336].map(grouped), ["0", "999", "1 000", "10 653 336"]);
    }

    #[test]
    fn times_are_rough() {
        assert_eq!([0.4, 59.7, 600.0, 9000.0].map(rough_time), ["0 s", "59 s", "10 min", "2 h 30 min"]);
        assert_eq!([f64::NAN, -1.0, f64::INFINITY].map(|odd| rough_time(odd).is_empty()), [false; 3]);
    }
}
