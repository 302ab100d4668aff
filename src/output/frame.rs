//! Where lattice integers lie in a glTF scene: metres, Y up, every coordinate on one power-of-two step.
//!
//! A vertex is `translation + position`, a node's translation and an f32 of its mesh. Both are whole multiples of the
//! job's steps, so their sum in f64 is exact and depends on the lattice integers alone: a vertex that several tiles
//! share has the same bits in all of them. A step is at most half the lattice step, so rounding finds the integer again;
//! it is finer, and positions truer, where the job is small enough for f32. Packed, with 16-bit positions, it is coarser, and
//! just as fine as rounding needs: see [`Frame::packed`].

use rust_decimal::Decimal;
use serde::{Deserialize, Serialize};

use crate::geometry::lattice::Lattice;
use crate::{Error, Result};

/// An f32 holds every whole number of steps up to this.
const F32_STEPS: i64 = 1 << 24;

/// Translations are multiples of this many steps. Steps from the origin stay below 2^39 (2^31 lattice integers, 256 steps
/// each), so that a translation has at most 24 binary digits and is exact in readers that hold it as f32.
const TRANSLATION_STEPS: i64 = 1 << 16;

/// Half the extent, in steps, of the widest mesh that one translation can serve, wherever it lies.
pub(crate) const PART_REACH: i64 = F32_STEPS - TRANSLATION_STEPS / 2;

/// Steps are refined below half the resolution by at most this factor, and not below [`FINE_STEP`].
const REFINEMENT: f64 = 64.0;

/// Metres.
const FINE_STEP: f64 = 1.0 / 4096.0;

/// Steps for 16-bit positions are at most this part of the lattice step: rounding to them moves a site by up to 0.49 of
/// a lattice step, and rounding back finds it.
const PACKED_RATIO: f64 = 0.98;

/// Steps that a 16-bit position reaches from its origin.
const SHORT_REACH: f64 = 65535.0;

/// Origins of meshes with 16-bit positions are multiples of this many steps. With at most 4 steps to a lattice step, steps
/// from the scene's origin stay below 2^33, so that the translation is exact as f32.
const SHORT_GRID: f64 = 512.0;

/// Lattice steps in metres beyond these bounds are no terrain and would leave the range of f32.
const RESOLUTION_BOUNDS: std::ops::Range<f64> = 1e-12..1e12;

/// What a reader needs to get from a glTF scene back to the source, as written to `scenes[0].extras`:
/// x = `offset[0]` + gx / `metres_per_unit`, y = `offset[1]` - gz / `metres_per_unit`,
/// z = `offset[2]` + gy / `metres_per_unit_z`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Extras {
    /// Source coordinates x, y, z of the scene's origin.
    pub offset: [f64; 3],
    /// Lattice step in x and y, source units.
    pub resolution: f64,
    /// Lattice step in z, source units.
    pub resolution_z: f64,
    /// Metres in a source unit of x and y.
    pub metres_per_unit: f64,
    /// Metres in a source unit of z.
    pub metres_per_unit_z: f64,
    /// Coordinate reference system as WKT.
    pub crs: Option<String>,
}

/// The way from lattice integers to glTF metres: a pure function of the job, the same in every tile.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Frame {
    extras: Extras,
    horizontal: Scale,
    vertical: Scale,
}

/// One kind of axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Scale {
    /// Metres in a glTF step, a power of two.
    step: f64,
    /// glTF steps in a lattice step, at least 2.
    ratio: f64,
}

impl Scale {
    fn new(resolution: f64, name: &str) -> Result<Scale> {
        if !RESOLUTION_BOUNDS.contains(&resolution) {
            return Err(Error::Config(format!(
                "a lattice step of {resolution:e} metres in {name} is out of range: set [input] unit and resolution"
            )));
        }
        Ok(Scale::coarsest(resolution))
    }

    /// The largest step of at most half of `resolution` metres.
    fn coarsest(resolution: f64) -> Scale {
        let step = power_below(resolution / 2.0);
        Scale { step, ratio: resolution / step }
    }

    /// The largest step from which rounding still leads back, for `resolution` metres.
    fn packed(resolution: f64) -> Scale {
        // A resolution that is a power of two is met exactly.
        let is_power = power_below(resolution) == resolution;
        let step = if is_power { resolution } else { power_below(resolution * PACKED_RATIO) };
        Scale { step, ratio: resolution / step }
    }

    /// Metres between the ends of the longest line that one mesh can hold.
    fn longest(self) -> f64 {
        2.0 * PART_REACH as f64 * self.step
    }

    /// As fine as a mesh that spans so many lattice steps allows, within reason.
    fn refined(self, lattice_steps: i64) -> Scale {
        let resolution = self.ratio * self.step;
        let spanning = power_above(lattice_steps as f64 * resolution / (2 * PART_REACH) as f64);
        let step = self.step.min(spanning.max(FINE_STEP).max(self.step / REFINEMENT));
        Scale { step, ratio: resolution / step }
    }

    /// The glTF steps of lattice integer `i`: a whole number below 2^39.
    #[inline(always)]
    fn steps(&self, i: i32) -> f64 {
        nearest(i as f64 * self.ratio)
    }
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

/// `value` rounded to the nearest whole number, for magnitudes below 2^51; vectorizes on every machine.
#[inline(always)]
fn nearest(value: f64) -> f64 {
    const SHIFT: f64 = 1.5 * (1u64 << 52) as f64;
    (value + SHIFT) - SHIFT
}

impl Frame {
    /// The frame of a job, with steps of about half the lattice's. `metres_per_unit` is for x and y, `metres_per_unit_z` for z, `crs` is WKT.
    ///
    /// Fails where a lattice step in metres is not a positive number of a sensible size.
    pub fn new(lattice: &Lattice, metres_per_unit: f64, metres_per_unit_z: f64, crs: Option<String>) -> Result<Frame> {
        let [x, y, z] = lattice.offset;
        let extras = Extras {
            offset: [number(x), number(y), number(z)],
            resolution: number(lattice.resolution),
            resolution_z: number(lattice.resolution_z),
            metres_per_unit,
            metres_per_unit_z,
            crs,
        };
        let horizontal = Scale::new(extras.resolution * metres_per_unit, "x and y")?;
        let vertical = Scale::new(extras.resolution_z * metres_per_unit_z, "z")?;
        Ok(Frame { extras, horizontal, vertical })
    }

    /// The frame with finer steps, so that positions are truer, as far as a triangle across a job within these least and
    /// greatest lattice integers x, y, z can still be written. All tiles of a job need the same frame.
    pub fn refined(self, bounds: [[i32; 3]; 2]) -> Frame {
        let [dx, dy, dz] = [0, 1, 2].map(|k| bounds[1][k] as i64 - bounds[0][k] as i64);
        Frame { horizontal: self.horizontal.refined(dx.max(dy)), vertical: self.vertical.refined(dz), ..self }
    }

    /// The frame with the coarsest steps from which the lattice can be told, so that positions take 16 bits. All tiles of a
    /// job need the same frame.
    pub fn packed(self) -> Frame {
        let [xy, up] = self.resolution_metres();
        Frame { horizontal: Scale::packed(xy), vertical: Scale::packed(up), ..self }
    }

    /// What is written for readers.
    pub fn extras(&self) -> &Extras {
        &self.extras
    }

    /// Metres in a lattice step: in x and y, and in z.
    pub fn resolution_metres(&self) -> [f64; 2] {
        let Extras { resolution, resolution_z, metres_per_unit, metres_per_unit_z, .. } = self.extras;
        [resolution * metres_per_unit, resolution_z * metres_per_unit_z]
    }

    /// The extent in metres, in x or y and in z, up to which a triangle can always be written exactly. Where the whole
    /// job is smaller than this, no tile can fail.
    pub fn longest_triangle(&self) -> [f64; 2] {
        [self.horizontal.longest(), self.vertical.longest()]
    }

    /// What [`Frame::longest_triangle`] is for a resolution of so many metres.
    pub fn longest_at(resolution_metres: f64) -> f64 {
        Scale::coarsest(resolution_metres).longest()
    }

    /// The glTF coordinates (x, y up, z) of a lattice point in steps: whole numbers.
    #[inline(always)]
    pub(crate) fn steps(&self, point: [i32; 3]) -> [f64; 3] {
        let [x, y, z] = point;
        // 0.0 - y has no negative zero.
        [self.horizontal.steps(x), self.vertical.steps(z), 0.0 - self.horizontal.steps(y)]
    }

    /// The glTF coordinates of a lattice point relative to an origin in steps; exact within [`PART_REACH`] of it.
    #[inline(always)]
    pub(crate) fn local(&self, point: [i32; 3], origin: [f64; 3]) -> [f32; 3] {
        let [x, y, z] = self.steps(point);
        let (xy, up) = (self.horizontal.step, self.vertical.step);
        [((x - origin[0]) * xy) as f32, ((y - origin[1]) * up) as f32, ((z - origin[2]) * xy) as f32]
    }

    /// The glTF coordinates of a lattice point relative to an origin in whole steps; exact within [`PART_REACH`] of it.
    #[inline(always)]
    pub(crate) fn local_steps(&self, point: [i32; 3], origin: [f64; 3]) -> [f64; 3] {
        let steps = self.steps(point);
        [0, 1, 2].map(|k| steps[k] - origin[k])
    }

    /// Metres in a step along the glTF axes.
    pub(crate) fn step(&self) -> [f64; 3] {
        self.metres([1.0; 3])
    }

    /// Metres in a vertical step over metres in a horizontal one.
    pub(crate) fn anisotropy(&self) -> f32 {
        (self.vertical.step / self.horizontal.step) as f32
    }

    /// The glTF world position in metres of a lattice point, exactly as every tile has it.
    pub fn world(&self, point: [i32; 3]) -> [f64; 3] {
        self.metres(self.steps(point))
    }

    /// The lattice point at a glTF world position in metres as [`Frame::world`] gives it; `None` where there is none.
    pub fn integers(&self, world: [f64; 3]) -> Option<[i32; 3]> {
        let [xy, up] = self.resolution_metres();
        let point = [world[0] / xy, -world[2] / xy, world[1] / up].map(f64::round);
        let is_there = point.iter().all(|v| v.abs() <= i32::MAX as f64);
        let point = point.map(|v| v as i32);
        (is_there && self.world(point) == world).then_some(point)
    }

    /// Steps as metres.
    pub(crate) fn metres(&self, steps: [f64; 3]) -> [f64; 3] {
        [steps[0] * self.horizontal.step, steps[1] * self.vertical.step, steps[2] * self.horizontal.step]
    }
}

/// A place where translations may lie, in steps, nearest to the middle between `low` and `high`.
pub(crate) fn origin_between(low: [f64; 3], high: [f64; 3], grid: i64) -> [f64; 3] {
    [0, 1, 2].map(|k| (nearest((low[k] + high[k]) * 0.5 / grid as f64)) * grid as f64 + 0.0)
}

/// The origin from which 16-bit positions reach all of what lies between `low` and `high`, in steps, if there is one.
pub(crate) fn short_origin(low: [f64; 3], high: [f64; 3]) -> Option<[f64; 3]> {
    let origin = low.map(|v| (v / SHORT_GRID).floor() * SHORT_GRID + 0.0);
    (0..3).all(|k| high[k] - origin[k] <= SHORT_REACH).then_some(origin)
}

/// The finest grid for [`origin_between`].
pub(crate) const FINE_GRID: i64 = TRANSLATION_STEPS;

/// The nearest f64. A lattice offset may have more digits: what an f64 loses of it is far below any lattice step.
fn number(exact: Decimal) -> f64 {
    exact.to_string().parse().expect("the text of a decimal is that of a number")
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
    fn packed_steps_are_powers_of_two_from_which_rounding_leads_back() {
        let near = [0.5f64, 1.0, 0.0078125].into_iter().flat_map(|v| [v.next_down(), v, v.next_up(), v * 0.981]);
        for resolution in near.chain([0.01, 0.001, 0.003048, 0.3048 / 4096.0, 7.0]) {
            let Scale { step, ratio } = Scale::packed(resolution);
            assert_eq!(step.log2().fract(), 0.0, "{resolution}");
            assert_eq!(step.to_bits() << 12, 0, "{resolution}");
            assert!(ratio == 1.0 || (1.02..2.05).contains(&ratio), "{resolution}: {ratio}");
        }
    }
}
