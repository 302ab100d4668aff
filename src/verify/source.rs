//! From scene positions back to lattice integers, and from those to the source's coordinates, correctly rounded.

use rust_decimal::Decimal;

use crate::geometry::lattice::{REACH, shortest_decimal};
use crate::output::frame::Extras;

/// Whole numbers below this are exact as f64.
const EXACT: u128 = 1 << 53;

/// Powers of ten up to this are exact as f64.
const EXACT_POWER: u32 = 22;

/// Positions in metres are at most this far from the lattice, in lattice steps: half a glTF step, and some rounding.
const OFF_LATTICE: f64 = 0.26;

/// Quantized positions are on coarser steps, from which the lattice can still be told.
const OFF_LATTICE_QUANTIZED: f64 = 0.495;

/// What the tiles of a job say about their lattice.
#[derive(Clone, Debug)]
pub struct Source {
    /// Lattice steps in a metre: x and y, z.
    per_metre: [f64; 2],
    /// Metres in a lattice step: x and y, z.
    resolution: [f64; 2],
    axes: [Axis; 3],
}

impl Source {
    /// The lattice of a scene with these extras; a sentence where there can be none such.
    pub fn new(extras: &Extras) -> Result<Source, String> {
        let steps = [extras.resolution, extras.resolution, extras.resolution_z];
        let axis = |k: usize| Axis::new(extras.offset[k], steps[k]);
        let axes = [axis(0), axis(1), axis(2)];
        let resolution = [extras.resolution * extras.metres_per_unit, extras.resolution_z * extras.metres_per_unit_z];
        let per_metre = resolution.map(|metres| 1.0 / metres);
        let [Some(x), Some(y), Some(z)] = axes else {
            return Err("its offset and resolution are no decimals that a lattice can have".into());
        };
        if !per_metre.iter().all(|v| v.is_finite() && *v > 0.0) {
            return Err("its resolution and metres_per_unit are not positive numbers".into());
        }
        Ok(Source { per_metre, resolution, axes: [x, y, z] })
    }

    /// The lattice integers x, y, z of a scene position in metres; `None` if it is not on the lattice.
    #[inline]
    pub fn integers(&self, world: [f64; 3]) -> Option<[i32; 3]> {
        self.integers_within(world, OFF_LATTICE)
    }

    /// The lattice integers of a scene position that is a whole number of steps of so many metres, as x, y up, z of the scene
    /// have them; `None` if it is not the step next to a point of the lattice.
    #[inline]
    pub fn integers_on(&self, world: [f64; 3], steps: [f64; 3]) -> Option<[i32; 3]> {
        let point = self.integers_within(world, OFF_LATTICE_QUANTIZED)?;
        let [x, y, z] = [point[0], point[2], point[1]].map(f64::from);
        let [xy, up] = self.resolution;
        let exact = [x * (xy / steps[0]), y * (up / steps[1]), 0.0 - z * (xy / steps[2])];
        let met = (0..3).all(|k| nearest(exact[k]) * steps[k] == world[k]);
        met.then_some(point)
    }

    #[inline(always)]
    fn integers_within(&self, world: [f64; 3], tolerance: f64) -> Option<[i32; 3]> {
        let [xy, up] = self.per_metre;
        let exact = [world[0] * xy, -world[2] * xy, world[1] * up];
        let rounded = exact.map(nearest);
        let near = (0..3).all(|k| (exact[k] - rounded[k]).abs() <= tolerance);
        let within = rounded[0].abs().max(rounded[1].abs()) <= REACH as f64
            && (i32::MIN as f64..=i32::MAX as f64).contains(&rounded[2]);
        (near && within).then(|| rounded.map(|v| v as i32))
    }

    /// The source coordinates of lattice integers, each the f64 nearest to the exact decimal; never -0.0.
    #[inline]
    pub fn coordinates(&self, point: [i32; 3]) -> [f64; 3] {
        [self.axes[0].world(point[0]), self.axes[1].world(point[1]), self.axes[2].world(point[2])]
    }

    /// A site as a user knows it.
    pub fn site_text(&self, site: [i32; 2]) -> String {
        format!("({}, {})", self.axes[0].world(site[0]), self.axes[1].world(site[1]))
    }
}

/// `value` rounded to the nearest whole number where it is below 2^51, else something as large.
#[inline(always)]
fn nearest(value: f64) -> f64 {
    const SHIFT: f64 = 1.5 * (1u64 << 52) as f64;
    (value + SHIFT) - SHIFT
}

/// `world = (base + step * integer) / 10^digits`.
#[derive(Clone, Copy, Debug)]
struct Axis {
    base: i128,
    step: i128,
    digits: u32,
    power: f64,
}

impl Axis {
    fn new(offset: f64, step: f64) -> Option<Axis> {
        let (offset, step) = (shortest_decimal(offset)?, shortest_decimal(step)?);
        let digits = offset.scale().max(step.scale());
        let whole = |d: Decimal| d.mantissa().checked_mul(10i128.checked_pow(digits - d.scale())?);
        let (base, step) = (whole(offset)?, whole(step)?);
        let fits = step > 0 && base.abs() < 1 << 120 && step < 1 << 90;
        fits.then(|| Axis { base, step, digits, power: format!("1e{digits}").parse().unwrap_or(f64::NAN) })
    }

    #[inline(always)]
    fn world(&self, integer: i32) -> f64 {
        let mantissa = self.base + self.step * integer as i128;
        if mantissa.unsigned_abs() < EXACT && self.digits <= EXACT_POWER {
            // Both numbers are exact, so the division rounds once.
            return mantissa as i64 as f64 / self.power;
        }
        self.world_from_text(mantissa)
    }

    #[cold]
    fn world_from_text(&self, mantissa: i128) -> f64 {
        format!("{mantissa}e-{}", self.digits).parse().unwrap_or(f64::NAN)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::lattice::Lattice;

    #[test]
    fn coordinates_are_the_nearest_doubles() {
        let axis = Axis::new(5274357.144, 0.00025).unwrap();
        assert_eq!(axis.world(1), 5274357.14425);
        assert_eq!(axis.world(-4 * 5274357), 5269082.787);
        let long = Axis::new(123456789012.3456, 0.0000001).unwrap();
        assert_eq!(long.world(30), "123456789012.345603".parse::<f64>().unwrap());
        let odd = Axis::new(114.00000000000003, 0.000001).unwrap();
        assert_eq!(odd.world(-113_000_000), 1.00000000000003);
        assert!(Axis::new(0.0, 0.01).unwrap().world(0).is_sign_positive());
    }

    #[test]
    fn what_is_off_the_lattice_is_seen() {
        let extras = Extras {
            offset: [0.0; 3],
            resolution: 0.01,
            resolution_z: 0.001,
            metres_per_unit: 1.0,
            metres_per_unit_z: 1.0,
            crs: None,
        };
        let source = Source::new(&extras).unwrap();
        assert_eq!(source.integers([0.012, 0.0041, -0.0502]), Some([1, 5, 4]));
        assert_eq!(source.integers([0.014, 0.0, 0.0]), None);
        assert_eq!(source.integers([1e30, 0.0, 0.0]), None);
        assert_eq!(source.integers([f64::NAN, 0.0, 0.0]), None);
    }

    #[test]
    fn quantized_positions_are_next_to_the_lattice() {
        let extras = Extras {
            offset: [0.0; 3],
            resolution: 0.01,
            resolution_z: 0.01,
            metres_per_unit: 1.0,
            metres_per_unit_z: 1.0,
            crs: None,
        };
        let source = Source::new(&extras).unwrap();
        let step = 1.0 / 128.0;
        let on = |x: f64| source.integers_on([x * step, 0.0, 0.0], [step; 3]);
        // 0.05 m are 6.4 steps.
        assert_eq!(on(6.0), Some([5, 0, 0]));
        // Seven steps are nearer to 0.05 m than to 0.06 m, and yet not the nearest to it.
        assert_eq!(on(7.0), None);
        assert_eq!(on(6.5), None);
    }

    #[test]
    fn agrees_with_the_decimal_lattice() {
        let lattice = Lattice {
            offset: [shortest_decimal(635577.79).unwrap(), Decimal::ZERO, Decimal::ZERO],
            resolution: shortest_decimal(0.01).unwrap(),
            resolution_z: shortest_decimal(0.01).unwrap(),
        };
        let axis = Axis::new(635577.79, 0.01).unwrap();
        for i in [-5, 0, 1, 77, 123456] {
            assert_eq!(axis.world(i), (635577.79f64 * 100.0).round().mul_add(1.0, i as f64) / 100.0);
            assert!((axis.world(i) - lattice.world(0, i)).abs() < 1e-9);
        }
    }
}
