//! The integer grid of a job, on which all sites lie: `world = offset + resolution * integer`, in exact decimals.

#![warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable)]

mod area;
mod polygon_text;
mod vertex_digest;

pub use area::{FARTHEST_VERTEX, LatticeArea, Polygons};
pub use vertex_digest::VertexDigest;

use rust_decimal::prelude::ToPrimitive;
use rust_decimal::{Decimal, RoundingStrategy};
use serde::{Deserialize, Serialize};

/// The raw integer of a coordinate that no other raw integer can hold. It lies outside every lattice.
pub const BEYOND: i64 = i64::MIN;

/// So many steps of the lattice of places are a step of that of points: the most that can be had.
const PARTS_OF_STEP: [i64; 4] = [1000, 100, 10, 2];

/// The lattice of a job, in source units.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Lattice {
    /// World coordinates (x, y, z) of the lattice point (0, 0, 0).
    #[serde(with = "decimal_text_array")]
    pub offset: [Decimal; 3],
    /// The step in x and y.
    #[serde(with = "decimal_text")]
    pub resolution: Decimal,
    /// The step in z.
    #[serde(with = "decimal_text")]
    pub resolution_z: Decimal,
}

impl Lattice {
    /// Tells whether it has all points of `other`: the steps are the same, and the offsets are whole numbers of them apart.
    pub fn has_points_of(&self, other: &Lattice) -> bool {
        let steps = [self.resolution, self.resolution, self.resolution_z];
        let is_whole = |axis: usize| {
            let distance = self.offset[axis].checked_sub(other.offset[axis]);
            distance.and_then(|distance| distance.checked_rem(steps[axis])).is_some_and(|rest| rest.is_zero())
        };
        (self.resolution, self.resolution_z) == (other.resolution, other.resolution_z) && (0..3).all(is_whole)
    }

    /// Returns the lattice with these steps, or `None` if the world coordinate of some `i32` needs more digits than a decimal has.
    pub fn new(offset: [Decimal; 3], resolution: Decimal, resolution_z: Decimal) -> Option<Lattice> {
        let lattice = Lattice { offset, resolution, resolution_z };
        let ends = [0, 1, 2].into_iter().flat_map(|axis| [i32::MIN, i32::MAX].map(|i| (axis, i)));
        ends.into_iter().all(|(axis, i)| lattice.exact_world(axis, i).is_some()).then_some(lattice)
    }

    /// Returns a finer lattice in x and y, for places that are not those of points, and the number of its steps in one of this: a thousand, or
    /// fewer where world coordinates would need more digits than a decimal has.
    pub fn for_places(&self) -> (Lattice, i64) {
        let is_exact = |lattice: &Lattice, axis: usize, i: i64| {
            let back =
                lattice.exact_world(axis, i)?.checked_sub(lattice.offset[axis])?.checked_div(lattice.resolution)?;
            Some(back == Decimal::from(i))
        };
        let finer = |parts: i64| {
            let resolution = self.resolution.checked_div(Decimal::from(parts))?;
            let lattice = Lattice { resolution, ..self.clone() };
            let ends =
                [0, 1].into_iter().flat_map(|axis| [i32::MIN, i32::MAX].map(|i| (axis, parts * i64::from(i) + 1)));
            let is_fine = ends.into_iter().all(|(axis, i)| is_exact(&lattice, axis, i).unwrap_or(false));
            is_fine.then_some((lattice, parts))
        };
        PARTS_OF_STEP.into_iter().find_map(finer).unwrap_or_else(|| (self.clone(), 1))
    }

    /// Returns the step along `axis` (0: x, 1: y, 2: z).
    #[inline]
    pub fn step(&self, axis: usize) -> Decimal {
        if axis == 2 { self.resolution_z } else { self.resolution }
    }

    /// Returns the steps in x and y from zero of the source coordinates to zero of the lattice, rounded down: 0 where they are too many for 64 bits.
    pub fn steps_from_zero(&self) -> [i64; 2] {
        let steps = |axis: usize| {
            let (offset, step) = (self.offset[axis], self.resolution);
            let rest = offset.checked_rem(step)?;
            let rounded = offset.checked_sub(rest)?.checked_div(step)?.to_i64()?;
            Some(if rest < Decimal::ZERO { rounded - 1 } else { rounded })
        };
        [0, 1].map(|axis| steps(axis).unwrap_or_default())
    }

    /// Returns the world coordinate of lattice integer `i` on `axis`, correctly rounded. It is a number on every lattice that
    /// [`Lattice::new`] returns, and NaN where another lattice would need too many digits.
    pub fn world(&self, axis: usize, i: i32) -> f64 {
        self.exact_world(axis, i).and_then(|exact| exact.to_f64()).unwrap_or(f64::NAN)
    }

    /// Returns the world coordinate of lattice integer `i` on `axis` as a decimal text without rounding; empty on a lattice that
    /// [`Lattice::new`] refuses.
    pub fn world_text(&self, axis: usize, i: i32) -> String {
        self.exact_world(axis, i).map(|exact| exact.normalize().to_string()).unwrap_or_default()
    }

    /// Returns the lattice integer of a world coordinate that is written as [`Lattice::world_text`] does; `None` if it is none of the lattice.
    pub fn integer_of_text(&self, axis: usize, text: &str) -> Option<i32> {
        self.wide_integer_of_text(axis, text).and_then(|integer| i32::try_from(integer).ok())
    }

    fn wide_integer_of_text(&self, axis: usize, text: &str) -> Option<i64> {
        let world = Decimal::from_str_exact(text).ok()?;
        let steps = world.checked_sub(self.offset[axis])?.checked_div(self.step(axis))?;
        steps.is_integer().then(|| steps.to_i64()).flatten()
    }

    /// Returns the lattice integer nearest to a world coordinate on `axis`, halves away from zero; `None` if it lies farther than
    /// [`FARTHEST_VERTEX`] from zero, is no number, or has no exact world coordinate.
    pub fn nearest(&self, axis: usize, value: f64) -> Option<i64> {
        let steps = shortest_decimal(value)?.checked_sub(self.offset[axis])?.checked_div(self.step(axis))?;
        let whole = steps.round_dp_with_strategy(0, RoundingStrategy::MidpointAwayFromZero).to_i64()?;
        let is_near = (-FARTHEST_VERTEX..=FARTHEST_VERTEX).contains(&whole);
        (is_near && self.exact_world(axis, whole).is_some()).then_some(whole)
    }

    fn exact_world(&self, axis: usize, i: impl Into<Decimal>) -> Option<Decimal> {
        self.step(axis).checked_mul(i.into())?.checked_add(self.offset[axis])
    }
}

/// Returns the decimal number of the shortest text for `value`: 0.1 for the `f64` nearest to one tenth. Returns `None` if `value`
/// is not finite or needs more than 28 digits.
pub fn shortest_decimal(value: f64) -> Option<Decimal> {
    if !value.is_finite() {
        return None;
    }
    let text = format!("{value}");
    Decimal::from_str_exact(&text).ok().map(|d| d.normalize())
}

/// The exact map from one axis of an input, `world = offset + scale * raw`, to the lattice:
/// `integer = round((raw * mul + add) / div)`, halves away from zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "[String; 3]", try_from = "[String; 3]")]
pub struct AxisMap {
    mul: i128,
    add: i128,
    div: i128,
    /// The same numbers, if they map every raw `i32` without leaving an `i64`. Wide division takes ten times as long.
    narrow: Option<[i64; 3]>,
}

impl AxisMap {
    /// Returns the map from an input axis with this `offset` and `scale` to a lattice axis, or `None` if the numbers have too many
    /// digits to be compared exactly, or a step is not positive.
    pub fn new(offset: Decimal, scale: Decimal, lattice_offset: Decimal, resolution: Decimal) -> Option<AxisMap> {
        let shift = offset.checked_sub(lattice_offset)?.normalize();
        let (scale, resolution) = (scale.normalize(), resolution.normalize());
        if scale <= Decimal::ZERO || resolution <= Decimal::ZERO {
            return None;
        }
        let digits = shift.scale().max(scale.scale()).max(resolution.scale());
        let integer = |d: Decimal| 10i128.checked_pow(digits - d.scale())?.checked_mul(d.mantissa());
        let (mul, add, div) = (integer(scale)?, integer(shift)?, integer(resolution)?);
        let common = gcd(gcd(mul, add.abs()), div);
        AxisMap::from_integers(mul / common, add / common, div / common)
    }

    /// Returns the map of these integers. Returns `None` if `mul` or `div` is not positive, or a number is too large.
    fn from_integers(mul: i128, add: i128, div: i128) -> Option<AxisMap> {
        let narrow = (mul < 1 << 29 && add.unsigned_abs() < 1 << 61 && div < 1 << 61)
            .then_some([mul as i64, add as i64, div as i64]);
        // Room for any 32-bit or 10^18 mantissa without overflow.
        let fits = (1..1 << 60).contains(&mul) && add.unsigned_abs() < 1 << 120 && (1..1 << 120).contains(&div);
        fits.then_some(AxisMap { mul, add, div, narrow })
    }

    /// Returns the lattice integer of `raw` and whether it was rounded, or `None` if it is outside the range of `i32`.
    #[inline(always)]
    pub fn apply(&self, raw: i64) -> Option<(i32, bool)> {
        match self.narrow {
            // Most maps are exact. Only this case is worth inlining wherever records are read.
            Some([mul, add, 1]) if i32::try_from(raw).is_ok() => Some((i32::try_from(raw * mul + add).ok()?, false)),
            _ => self.round(raw),
        }
    }

    /// Returns `mul` and `add` of a map that rounds nothing: the integer of a raw `i32` is `raw * mul + add`, which does not overflow an
    /// `i64`. Returns `None` for maps of very large numbers too.
    #[inline]
    pub fn exact(&self) -> Option<[i64; 2]> {
        self.narrow.and_then(|[mul, add, div]| (div == 1).then_some([mul, add]))
    }

    fn round(&self, raw: i64) -> Option<(i32, bool)> {
        match self.narrow {
            Some([mul, add, div]) if i32::try_from(raw).is_ok() => divide(raw * mul + add, div),
            _ => self.apply_wide(raw),
        }
    }

    #[inline(never)]
    fn apply_wide(&self, raw: i64) -> Option<(i32, bool)> {
        if raw == BEYOND {
            return None;
        }
        let numerator = raw as i128 * self.mul + self.add;
        let (quotient, rest) = (numerator.div_euclid(self.div), numerator.rem_euclid(self.div));
        let up = 2 * rest > self.div || (2 * rest == self.div && numerator >= 0);
        Some((i32::try_from(quotient + up as i128).ok()?, rest != 0))
    }
}

/// Returns `numerator / div`, rounded with halves away from zero, and whether it was rounded. Returns `None` if it is outside the range of
/// `i32`. Both numbers are less than 2^62. The decimals of a finer input are as good as random, so nothing here branches on them.
fn divide(numerator: i64, div: i64) -> Option<(i32, bool)> {
    let (size, sign) = (numerator.abs(), numerator.signum());
    // Division in floating point is faster than that of whole numbers, and wrong by one at the most if the result fits an i32.
    let estimate = size as f64 / div as f64 + 0.5;
    if estimate > 4e9 {
        return None;
    }
    let quotient = estimate as i64;
    // The rest, and a half: between 0 and 1 if the estimate is right.
    let rest = 2 * (size - quotient * div) + div;
    let quotient = quotient + (rest >= 2 * div) as i64 - (rest < 0) as i64;
    Some((i32::try_from(sign * quotient).ok()?, quotient * div != size))
}

/// A map is written as the digits of `mul`, `add` and `div`, since JSON readers do not keep all digits of large numbers.
impl From<AxisMap> for [String; 3] {
    fn from(map: AxisMap) -> [String; 3] {
        [map.mul, map.add, map.div].map(|number| number.to_string())
    }
}

impl TryFrom<[String; 3]> for AxisMap {
    type Error = InvalidAxisMap;

    fn try_from(numbers: [String; 3]) -> Result<AxisMap, InvalidAxisMap> {
        let [mul, add, div] = numbers.each_ref().map(|number| number.parse().ok());
        let map = mul.zip(add).zip(div).and_then(|((mul, add), div)| AxisMap::from_integers(mul, add, div));
        map.ok_or(InvalidAxisMap(numbers))
    }
}

/// Three numbers that are not the integers of an [`AxisMap`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0:?} are not the integers of a map to the lattice")]
pub struct InvalidAxisMap([String; 3]);

fn gcd(a: i128, b: i128) -> i128 {
    if b == 0 { a } else { gcd(b, a % b) }
}

mod decimal_text {
    use rust_decimal::Decimal;
    use serde::{Deserialize, Deserializer, Serializer};

    pub(super) fn serialize<S: Serializer>(value: &Decimal, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(value)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Decimal, D::Error> {
        let text = String::deserialize(deserializer)?;
        Decimal::from_str_exact(&text).map_err(serde::de::Error::custom)
    }
}

mod decimal_text_array {
    use rust_decimal::Decimal;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(super) fn serialize<S: Serializer>(value: &[Decimal; 3], serializer: S) -> Result<S::Ok, S::Error> {
        value.map(|d| d.to_string()).serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[Decimal; 3], D::Error> {
        let texts = <[String; 3]>::deserialize(deserializer)?;
        let mut values = [Decimal::ZERO; 3];
        for (value, text) in values.iter_mut().zip(&texts) {
            *value = Decimal::from_str_exact(text).map_err(serde::de::Error::custom)?;
        }
        Ok(values)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decimal(text: &str) -> Decimal {
        Decimal::from_str_exact(text).unwrap()
    }

    #[test]
    fn places_lie_on_a_lattice_that_is_as_fine_as_decimals_allow() {
        for (step, finer, parts) in [
            ("1", "0.001", 1000),
            ("0.01", "0.00001", 1000),
            ("0.0003048006096012192", "0.0000003048006096012192", 1000),
            ("0.91440182880365758", "0.00091440182880365758", 1000),
            ("0.000000000000000001", "0.000000000000000000001", 1000),
        ] {
            let decimal = |text| Decimal::from_str_exact(text).unwrap();
            let lattice =
                Lattice::new([decimal("635000.01"), Decimal::ZERO, Decimal::ZERO], decimal(step), Decimal::ONE)
                    .unwrap();
            let (places, found) = lattice.for_places();
            assert_eq!((places.resolution.normalize(), found), (decimal(finer), parts), "{step}");
            assert_eq!(places.exact_world(0, 5 * parts), lattice.exact_world(0, 5), "{step}");
        }
    }

    #[test]
    fn the_same_scale_and_a_whole_shift_is_exact() {
        let map = AxisMap::new(decimal("1000.5"), decimal("0.01"), decimal("600000"), decimal("0.01")).unwrap();
        assert_eq!(map.apply(5), Some((-59899945, false)));
    }

    #[test]
    fn a_finer_input_is_rounded_to_the_nearest_step() {
        let map = AxisMap::new(decimal("0"), decimal("0.001"), decimal("0"), decimal("0.01")).unwrap();
        let rounded: Vec<_> = [14, 15, 16, -14, -15, -16, 20].iter().map(|&raw| map.apply(raw).unwrap()).collect();
        let expected = [(1, true), (2, true), (2, true), (-1, true), (-2, true), (-2, true), (2, false)];
        assert_eq!(rounded, expected);
    }

    proptest::proptest! {
        #[test]
        fn both_widths_agree(raw: i32, offset in -1_000_000_000i64..1_000_000_000, scale in 1i64..1000, step in 1i64..1000) {
            let [offset, scale, step] = [offset, scale, step].map(|mantissa| Decimal::new(mantissa, 5));
            let map = AxisMap::new(offset, scale, Decimal::new(123, 2), step).unwrap();
            proptest::prop_assert!(map.narrow.is_some());
            proptest::prop_assert_eq!(map.apply(raw.into()), map.apply_wide(raw.into()));
        }

        #[test]
        fn exact_maps_round_nothing(raw: i32, offset in -3_000_000i64..3_000_000, scale in 1i64..30, step in 1i64..4) {
            let map = AxisMap::new(Decimal::from(offset), Decimal::from(scale), Decimal::ZERO, Decimal::from(step)).unwrap();
            proptest::prop_assert_eq!(map.exact().is_some(), offset % step == 0 && scale % step == 0);
            if let Some([mul, add]) = map.exact() {
                let integer = i32::try_from(i64::from(raw) * mul + add).ok();
                proptest::prop_assert_eq!(map.apply(raw.into()), integer.map(|integer| (integer, false)));
            }
        }

        #[test]
        fn quotients_of_any_size_agree(numerator in -(1i64 << 61)..1 << 61, bits in 0u32..61, near: i32, is_half: bool) {
            let div = (1i64 << bits) + i64::from(near.unsigned_abs()) % (1 << bits);
            // A tie, or next to one, and anything.
            let ties = [div / 2, div / 2 + 1].map(|half| i64::from(near) % ((1 << 60) / div + 1) * div + half);
            for numerator in [numerator, ties[is_half as usize], -ties[is_half as usize]] {
                let map = AxisMap { mul: 1, add: i128::from(numerator), div: i128::from(div), narrow: None };
                proptest::prop_assert_eq!(divide(numerator, div), map.apply_wide(0), "{} / {}", numerator, div);
            }
        }
    }

    #[test]
    fn maps_are_read_back_as_they_were_written() {
        let wide =
            AxisMap::new(decimal("1"), decimal("0.001"), decimal("0"), decimal("12345678901234567890.123")).unwrap();
        let narrow = AxisMap::new(decimal("-0.5"), decimal("0.01"), decimal("0"), decimal("0.03")).unwrap();
        for map in [wide, narrow] {
            let text = serde_json::to_string(&map).unwrap();
            assert_eq!(serde_json::from_str::<AxisMap>(&text).unwrap(), map, "{text}");
        }
        let least = i128::MIN.to_string();
        for [mul, add, div] in [["1", "0", "0"], ["0", "0", "1"], ["-1", "0", "1"], ["1", &least, "1"], ["1", "x", "1"]]
        {
            let text = format!("[\"{mul}\",\"{add}\",\"{div}\"]");
            assert!(serde_json::from_str::<AxisMap>(&text).is_err(), "{text}");
        }
    }

    #[test]
    fn values_beyond_the_range_are_refused() {
        let map = AxisMap::new(decimal("1"), decimal("1"), decimal("0"), decimal("0.001"));
        assert_eq!(map.unwrap().apply(i32::MAX as i64), None);
        assert!(AxisMap::new(decimal("0"), decimal("0"), decimal("0"), decimal("1")).is_none());
    }

    #[test]
    fn shortest_decimals_are_what_people_wrote() {
        assert_eq!(shortest_decimal(0.00025).unwrap().to_string(), "0.00025");
        assert_eq!(shortest_decimal(-123456.789).unwrap().to_string(), "-123456.789");
        assert_eq!(shortest_decimal(f64::NAN), None);
        assert_eq!(shortest_decimal(1e300), None);
    }

    #[test]
    fn lattices_of_the_same_points_are_whole_steps_apart() {
        let steps = |x: &str, y: &str, step: &str| {
            let offset = [decimal(x), decimal(y), Decimal::ZERO];
            Lattice::new(offset, decimal(step), Decimal::ONE).unwrap().steps_from_zero()
        };
        assert_eq!(steps("500000", "-0.3", "0.01"), [50_000_000, -30]);
        assert_eq!(steps("500000.003", "-0.303", "0.01"), [50_000_000, -31]);
        assert_eq!(steps("1.2", "-1.0", "0.3"), [4, -4]);
    }

    #[test]
    fn a_lattice_whose_coordinates_need_too_many_digits_is_refused() {
        let one = Decimal::ONE;
        let far = decimal("79000000000000000000000000000");
        assert!(Lattice::new([Decimal::ZERO; 3], one, one).is_some());
        let coarse = decimal("1000000000000000000000000000");
        assert_eq!(Lattice::new([Decimal::ZERO; 3], coarse, one), None);
        assert_eq!(Lattice::new([Decimal::ZERO; 3], one, coarse), None);
        assert_eq!(Lattice::new([Decimal::ZERO, far, Decimal::ZERO], decimal("1000000000000000000"), one), None);
        let unchecked = Lattice { offset: [Decimal::ZERO; 3], resolution: coarse, resolution_z: one };
        assert_eq!(unchecked.world(0, 3), 3e27);
        assert!(unchecked.world(0, 1000).is_nan());
    }
}
