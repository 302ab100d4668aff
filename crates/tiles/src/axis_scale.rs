//! The map from lattice integers to the steps of a scene along one kind of axis: horizontal or vertical.

use multiversion::multiversion;
use serde::{Deserialize, Serialize};
use sys::{Error, Result};

/// An f32 holds every whole number of steps up to this.
const F32_STEPS: i64 = 1 << 24;

/// Translations are multiples of this many steps. They stay below 2^39 steps (2^31 lattice integers with 256 steps each), so a
/// translation has at most 24 binary digits: it is exact as f32.
pub(crate) const TRANSLATION_STEPS: i64 = 1 << 16;

/// Half the extent in steps of the widest mesh that one translation serves, wherever it lies.
pub(crate) const NODE_REACH: i64 = F32_STEPS - TRANSLATION_STEPS / 2;

/// Steps are refined below half the resolution by at most this factor, and not below [`FINE_STEP`].
const REFINEMENT: f64 = 64.0;

/// The finest step in metres.
const FINE_STEP: f64 = 1.0 / 4096.0;

/// Steps for 16-bit positions are at most this part of a lattice step. Rounding to them moves a site by up to 0.49 lattice steps, and
/// rounding back finds it.
const PACKED_RATIO: f64 = 0.98;

/// The range of a lattice step in metres. Others would leave the range of f32, and no terrain has them.
const RESOLUTION_BOUNDS: std::ops::Range<f64> = 1e-12..1e12;

/// The map along one kind of axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct AxisScale {
    /// Metres in a glTF step, a power of two.
    pub(crate) step: f64,
    /// glTF steps in a lattice step: at least 2, or at least 1 in packed tiles.
    pub(crate) ratio: f64,
}

impl AxisScale {
    pub(crate) fn new(resolution: f64, name: &str) -> Result<AxisScale> {
        if !RESOLUTION_BOUNDS.contains(&resolution) {
            return Err(Error::Config(format!(
                "a lattice step of {resolution:e} metres in {name} is out of range: set [input] unit and resolution"
            )));
        }
        Ok(AxisScale::coarsest(resolution))
    }

    /// Returns the map with the largest step of at most half of `resolution` metres.
    pub(crate) fn coarsest(resolution: f64) -> AxisScale {
        let step = power_below(resolution / 2.0);
        AxisScale { step, ratio: resolution / step }
    }

    /// Returns the map with the largest step from which rounding still leads back, for `resolution` metres.
    pub(crate) fn packed(resolution: f64) -> AxisScale {
        // A resolution that is a power of two is a step itself.
        let is_power = power_below(resolution) == resolution;
        let step = if is_power { resolution } else { power_below(resolution * PACKED_RATIO) };
        AxisScale { step, ratio: resolution / step }
    }

    /// Returns the length in metres of the longest line that one mesh can hold.
    pub(crate) fn longest(self) -> f64 {
        2.0 * NODE_REACH as f64 * self.step
    }

    /// Returns the map with a step as fine as a mesh that spans `lattice_steps` allows, within reason.
    pub(crate) fn refined(self, lattice_steps: i64) -> AxisScale {
        let resolution = self.ratio * self.step;
        let spanning = power_above(lattice_steps as f64 * resolution / (2 * NODE_REACH) as f64);
        let step = self.step.min(spanning.max(FINE_STEP).max(self.step / REFINEMENT));
        AxisScale { step, ratio: resolution / step }
    }

    /// Returns the map with half the step.
    pub(crate) fn halved(self) -> AxisScale {
        AxisScale { step: self.step / 2.0, ratio: self.ratio * 2.0 }
    }

    /// Rounds each of `places`, in metres along the axis, to a lattice integer. Returns whether all of them are exactly where their integers
    /// are; if not, the integers mean nothing.
    pub(crate) fn integers<const N: usize>(self, places: &[f64; N], found: &mut [i32; N]) -> bool {
        integers(self, places, found)
    }

    /// Returns lattice integer `i` in glTF steps, a whole number below 2^39.
    #[inline(always)]
    pub(crate) fn steps(&self, i: i32) -> f64 {
        nearest(i as f64 * self.ratio)
    }
}

/// Rounds `value` to the nearest whole number, for magnitudes below 2^31. It vectorizes too.
#[inline(always)]
pub(crate) fn nearest_integer(value: f64) -> i32 {
    const SHIFT: f64 = 1.5 * (1u64 << 52) as f64;
    // The last bits of the sum are those of the number.
    (value + SHIFT).to_bits() as i32
}

/// Rounds each of `places`, in metres, to a lattice integer; returns whether all of them are exactly where their integers are.
#[multiversion(targets("x86_64+avx2"))]
fn integers<const N: usize>(axis: AxisScale, places: &[f64; N], integers: &mut [i32; N]) -> bool {
    let per_metre = 1.0 / (axis.ratio * axis.step);
    let mut off = 0;
    for (&place, integer) in places.iter().zip(integers) {
        let near = nearest(place * per_metre);
        // What counts is this check, so it does not matter that the quotient was rounded.
        let is_there = near.abs() <= f64::from(i32::MAX) && nearest(near * axis.ratio) * axis.step == place;
        off += u32::from(!is_there);
        *integer = nearest_integer(near);
    }
    off == 0
}

/// Returns the greatest power of two that is not above `value`, or zero for zero. Exact, unlike a logarithm.
fn power_below(value: f64) -> f64 {
    f64::from_bits(value.to_bits() & f64::INFINITY.to_bits())
}

/// Returns the least power of two that is not below `value`, or zero for zero.
fn power_above(value: f64) -> f64 {
    let below = power_below(value);
    if below == value { value } else { 2.0 * below }
}

/// Rounds `value` to the nearest whole number, for magnitudes below 2^51. Unlike `round` it vectorizes on every machine.
#[inline(always)]
pub(crate) fn nearest(value: f64) -> f64 {
    const SHIFT: f64 = 1.5 * (1u64 << 52) as f64;
    (value + SHIFT) - SHIFT
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_of_two_bound_every_number() {
        assert_eq!(
            [0.0, 1.0, 0.75, 0.01, 1e-12, 6e11].map(power_below),
            [0.0, 1.0, 0.5, 1.0 / 128.0, 0.5f64.powi(40), 2f64.powi(39)]
        );
        assert_eq!([0.0, 1.0, 0.75, 0.01, 3.0].map(power_above), [0.0, 1.0, 1.0, 1.0 / 64.0, 4.0]);
        assert_eq!((power_below(1.0f64.next_down()), power_above(1.0f64.next_up())), (0.5, 2.0));
    }

    #[test]
    fn packed_steps_are_powers_of_two_just_below_the_resolution() {
        let near = [0.5f64, 1.0, 0.0078125].into_iter().flat_map(|v| [v.next_down(), v, v.next_up(), v * 0.981]);
        for resolution in near.chain([0.01, 0.001, 0.003048, 0.3048 / 4096.0, 7.0]) {
            let AxisScale { step, ratio } = AxisScale::packed(resolution);
            assert_eq!(step.log2().fract(), 0.0, "{resolution}");
            assert_eq!(step.to_bits() << 12, 0, "{resolution}");
            assert!(ratio == 1.0 || (1.02..2.05).contains(&ratio), "{resolution}: {ratio}");
        }
    }
}
