//! The numbers that programs write for "nothing measured" (nodata).

/// Numbers that some programs write for nodata, and that may be heights.
const USUAL_NUMBERS: [f64; 7] = [0.0, -1.0, -99.0, 255.0, 999.0, 65535.0, 1e6];

/// No height is as large, whatever its unit.
pub(crate) const NO_HEIGHT: f64 = 1e18;

/// The greatest numbers of single and of double precision, half of the first, and the fill value of NetCDF. Programs write them with more or
/// fewer digits.
const HUGE_NUMBERS: [f64; 4] = [f32::MAX as f64, f64::MAX, 1.701_411_834_6e38, 9.969_209_968_386_869e36];

/// The ends of 16 and of 32 bits, and those that some programs keep for nodata beside them.
const ENDS_OF_INTEGERS: [f64; 6] = [-32768.0, -32767.0, 32767.0, -2_147_483_648.0, -2_147_483_647.0, 2_147_483_647.0];

/// Returns whether programs write `value` for nodata: nines alone, the end of a kind of number, or a great power of ten.
pub(crate) fn is_nodata_number(value: f64) -> bool {
    let least_digits = if value < 0.0 { 3 } else { 4 };
    let is_nines = || (least_digits..=15).any(|digits| value.abs() == power_of_ten(digits) - 1.0);
    let is_end = || HUGE_NUMBERS.into_iter().any(|end| (value.abs() / end - 1.0).abs() < 1e-4);
    ENDS_OF_INTEGERS.contains(&value) || is_nines() || is_great_power_of_ten(value.abs()) || is_end()
}

/// Returns whether some programs write `value` for nodata, though it may be a height.
pub(crate) fn is_usual_number(value: f64) -> bool {
    USUAL_NUMBERS.contains(&value) || is_nodata_number(value)
}

fn is_great_power_of_ten(value: f64) -> bool {
    let mut powers =
        std::iter::successors(Some(1e9_f64), |power| Some(power * 10.0)).take_while(|power| power.is_finite());
    powers.any(|power| (value / power - 1.0).abs() < 1e-9)
}

fn power_of_ten(power: u32) -> f64 {
    10_i64.checked_pow(power).map_or(f64::INFINITY, |power| power as f64)
}

/// Returns whether a value that programs write for nodata is none without other heights to compare it with.
pub(crate) fn stands_for_nodata_alone(value: f64) -> bool {
    value <= -9999.0 || value.abs() >= power_of_ten(9)
}

/// Returns whether `value`, in steps of so many units, is as near to a number for nodata as it can be.
pub fn is_number_in_steps(value: f64, step: f64) -> bool {
    let whole = value.round();
    is_nodata_number(whole) && (value - whole).abs() <= 0.501 * step
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_for_nodata_are_known() {
        let known = [
            -999.0,
            -9999.0,
            9999.0,
            -99999.0,
            -32768.0,
            -32767.0,
            1e20,
            1e30,
            -3.4028235e38,
            -3.40282e38,
            1.70141e38,
            9.96921e36,
            f64::MIN,
            1e10,
        ];
        assert!(known.into_iter().all(is_nodata_number));
        assert!(
            ![0.0, -1.0, 999.0, -9998.0, 99.0, -99.0, 10000.0, 32768.0, 8848.0, 1.5e18, -1.234e19]
                .into_iter()
                .any(is_nodata_number)
        );
    }
}
