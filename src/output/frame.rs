//! Where lattice integers lie in a glTF scene: in metres, Y up, with every coordinate a whole multiple of a power of two, the step.
//!
//! A vertex is at `translation + position`: its node's translation and an f32 of its mesh. Both are whole multiples of the job's
//! steps, so their sum in f64 is exact and depends on the lattice integers alone. A vertex that several tiles share has the same bits
//! in all of them. A step is at most half a lattice step, so rounding finds the integer again. In a job that is small enough for f32
//! the steps are finer, and positions are truer. Packed tiles have coarser steps, just fine enough for rounding, so that positions
//! take 16 bits: see [`Frame::packed`].

use rust_decimal::Decimal;
use serde::{Deserialize, Serialize};

use crate::geometry::Bounds;
use crate::geometry::lattice::Lattice;
use crate::output::curvature::Curvature;
use crate::{Error, Result};

/// An f32 holds every whole number of steps up to this.
const F32_STEPS: i64 = 1 << 24;

/// Translations are multiples of this many steps. They stay below 2^39 steps (2^31 lattice integers with 256 steps each), so a
/// translation has at most 24 binary digits: it is exact as f32.
const TRANSLATION_STEPS: i64 = 1 << 16;

/// Half the extent in steps of the widest mesh that one translation serves, wherever it lies.
pub(crate) const PART_REACH: i64 = F32_STEPS - TRANSLATION_STEPS / 2;

/// Steps are refined below half the resolution by at most this factor, and not below [`FINE_STEP`].
const REFINEMENT: f64 = 64.0;

/// The finest step in metres.
const FINE_STEP: f64 = 1.0 / 4096.0;

/// Steps for 16-bit positions are at most this part of a lattice step. Rounding to them moves a site by up to 0.49 lattice steps, and
/// rounding back finds it.
const PACKED_RATIO: f64 = 0.98;

/// A rounded place of a plain bent scene leads back to within this many lattice steps of its lattice point.
const MOST_OFF_PLAIN: f64 = 0.255;

/// The same for packed tiles.
const MOST_OFF_PACKED: f64 = 0.497;

/// More often than this no step is halved: a vertical and a horizontal one, each to a 256th.
const STEPS_HALVED: usize = 16;

/// Steps that a 16-bit position reaches from its origin.
const SHORT_REACH: f64 = 65535.0;

/// Origins of meshes with 16-bit positions are multiples of this many steps. A lattice step has at most 4 of these steps, so they stay
/// below 2^33 steps, and the translation is exact as f32.
const SHORT_GRID: f64 = 512.0;

/// The range of a lattice step in metres. Others would leave the range of f32, and no terrain has them.
const RESOLUTION_BOUNDS: std::ops::Range<f64> = 1e-12..1e12;

/// The numbers that lead from a glTF scene back to the source, as written to `scenes[0].extras`:
/// x = `offset[0]` + gx / `metres_per_unit`, y = `offset[1]` - gz / `metres_per_unit`,
/// z = `offset[2]` + gy / `metres_per_unit_z`, unless there is a `curvature`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Extras {
    /// The source coordinates x, y, z of the scene's origin.
    pub offset: [f64; 3],
    /// The lattice step in x and y, in source units.
    pub resolution: f64,
    /// The lattice step in z, in source units.
    pub resolution_z: f64,
    /// Metres in a source unit of x and y.
    pub metres_per_unit: f64,
    /// Metres in a source unit of z.
    pub metres_per_unit_z: f64,
    /// The coordinate reference system as WKT.
    pub crs: Option<String>,
    /// How the scene follows the curve of the earth. With it, a vertex lies this much beside its place of the formula above.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub curvature: Option<Curvature>,
}

/// The map from lattice integers to glTF metres. It is the same in every tile of a job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Frame {
    extras: Extras,
    horizontal: AxisScale,
    vertical: AxisScale,
}

/// The map along one kind of axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct AxisScale {
    /// Metres in a glTF step, a power of two.
    step: f64,
    /// glTF steps in a lattice step: at least 2, or at least 1 in packed tiles.
    ratio: f64,
}

impl AxisScale {
    fn new(resolution: f64, name: &str) -> Result<AxisScale> {
        if !RESOLUTION_BOUNDS.contains(&resolution) {
            return Err(Error::Config(format!(
                "a lattice step of {resolution:e} metres in {name} is out of range: set [input] unit and resolution"
            )));
        }
        Ok(AxisScale::coarsest(resolution))
    }

    /// Returns the map with the largest step of at most half of `resolution` metres.
    fn coarsest(resolution: f64) -> AxisScale {
        let step = power_below(resolution / 2.0);
        AxisScale { step, ratio: resolution / step }
    }

    /// Returns the map with the largest step from which rounding still leads back, for `resolution` metres.
    fn packed(resolution: f64) -> AxisScale {
        // A resolution that is a power of two is a step itself.
        let is_power = power_below(resolution) == resolution;
        let step = if is_power { resolution } else { power_below(resolution * PACKED_RATIO) };
        AxisScale { step, ratio: resolution / step }
    }

    /// Returns the length in metres of the longest line that one mesh can hold.
    fn longest(self) -> f64 {
        2.0 * PART_REACH as f64 * self.step
    }

    /// Returns the map with a step as fine as a mesh that spans `lattice_steps` allows, within reason.
    fn refined(self, lattice_steps: i64) -> AxisScale {
        let resolution = self.ratio * self.step;
        let spanning = power_above(lattice_steps as f64 * resolution / (2 * PART_REACH) as f64);
        let step = self.step.min(spanning.max(FINE_STEP).max(self.step / REFINEMENT));
        AxisScale { step, ratio: resolution / step }
    }

    /// Returns the map with half the step.
    fn halved(self) -> AxisScale {
        AxisScale { step: self.step / 2.0, ratio: self.ratio * 2.0 }
    }

    /// Returns lattice integer `i` in glTF steps, a whole number below 2^39.
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

/// Rounds `value` to the nearest whole number, for magnitudes below 2^51. Unlike `round` it vectorizes on every machine.
#[inline(always)]
fn nearest(value: f64) -> f64 {
    const SHIFT: f64 = 1.5 * (1u64 << 52) as f64;
    (value + SHIFT) - SHIFT
}

impl Frame {
    /// Returns the frame of a job, with steps of about half a lattice step. `metres_per_unit` is for x and y, `metres_per_unit_z` for z,
    /// and `crs` is WKT.
    ///
    /// # Errors
    /// [`Error::Config`] if a lattice step in metres is not a positive number of a sensible size.
    pub fn new(lattice: &Lattice, metres_per_unit: f64, metres_per_unit_z: f64, crs: Option<String>) -> Result<Frame> {
        let [x, y, z] = lattice.offset;
        let extras = Extras {
            offset: [number(x), number(y), number(z)],
            resolution: number(lattice.resolution),
            resolution_z: number(lattice.resolution_z),
            metres_per_unit,
            metres_per_unit_z,
            crs,
            curvature: None,
        };
        let horizontal = AxisScale::new(extras.resolution * metres_per_unit, "x and y")?;
        let vertical = AxisScale::new(extras.resolution_z * metres_per_unit_z, "z")?;
        Ok(Frame { extras, horizontal, vertical })
    }

    /// Returns the frame with finer steps, so that positions are truer. They are as fine as a triangle across a job within `bounds`
    /// allows. All tiles of a job need the same frame.
    pub fn refined(self, bounds: Bounds<3>) -> Frame {
        let [xy, up] = self.resolution_metres();
        // A bent scene is a little larger.
        let moved = self.curvature().map_or([0.0; 3], Curvature::greatest);
        let extent = |k: usize, step: f64| bounds.extent(k) + (2.0 * moved[k] / step).ceil() as i64;
        let horizontal = self.horizontal.refined(extent(0, xy).max(extent(1, xy)));
        let vertical = self.vertical.refined(extent(2, up));
        Frame { horizontal, vertical, ..self }.invertible(MOST_OFF_PLAIN)
    }

    /// Returns the frame with the coarsest steps from which rounding finds the lattice, so that positions take 16 bits. All tiles of
    /// a job need the same frame.
    pub fn packed(self) -> Frame {
        let [xy, up] = self.resolution_metres();
        Frame { horizontal: AxisScale::packed(xy), vertical: AxisScale::packed(up), ..self }.invertible(MOST_OFF_PACKED)
    }

    /// Returns the frame of a scene that follows the curve of the earth. It must be refined or packed afterwards.
    pub fn curved(mut self, curvature: Curvature) -> Frame {
        self.extras.curvature = Some(curvature);
        self
    }

    /// Returns how the scene follows the curve of the earth.
    pub(crate) fn curvature(&self) -> Option<&Curvature> {
        self.extras.curvature.as_ref()
    }

    /// Returns the frame with steps so fine that a place that was rounded to them leads back to a lattice place at most so many lattice
    /// steps off, `most`. Where a scene is bent, rounding along one axis is felt a little along the others.
    fn invertible(mut self, most: f64) -> Frame {
        let Some(curvature) = self.curvature() else { return self };
        let [xy, up] = self.resolution_metres();
        let steep = curvature.steepness([xy, xy, up]);
        for _ in 0..STEPS_HALVED {
            let half = [self.horizontal.step, self.horizontal.step, self.vertical.step].map(|step| step / 2.0);
            // To first order; a tenth covers the rest and what lies between the places that were looked at.
            let off = |k: usize| half[k] + 1.1 * (0..3).map(|b| steep[k][b] * half[b]).sum::<f64>();
            let (across, along) = (off(0).max(off(1)) / xy, off(2) / up);
            if across > most {
                self.horizontal = self.horizontal.halved();
            } else if along > most {
                self.vertical = self.vertical.halved();
            } else {
                break;
            }
        }
        self
    }

    /// Returns the numbers that are written for readers.
    pub fn extras(&self) -> &Extras {
        &self.extras
    }

    /// Returns the metres in a lattice step: in x and y, and in z.
    pub fn resolution_metres(&self) -> [f64; 2] {
        let Extras { resolution, resolution_z, metres_per_unit, metres_per_unit_z, .. } = self.extras;
        [resolution * metres_per_unit, resolution_z * metres_per_unit_z]
    }

    /// Returns the extent in metres, in x or y and in z, up to which a triangle can always be written exactly. If the whole job is
    /// smaller than this, no tile can fail.
    pub fn longest_triangle(&self) -> [f64; 2] {
        [self.horizontal.longest(), self.vertical.longest()]
    }

    /// Returns the extent in metres up to which a triangle can be written exactly at this resolution in metres.
    pub fn longest_at(resolution_metres: f64) -> f64 {
        AxisScale::coarsest(resolution_metres).longest()
    }

    /// Returns the glTF coordinates (x, y up, z) of a lattice point in steps, which are whole numbers.
    #[inline(always)]
    pub(crate) fn steps(&self, point: [i32; 3]) -> [f64; 3] {
        if let Some(curvature) = &self.extras.curvature {
            return self.curved_steps(curvature, point);
        }
        let [x, y, z] = point;
        // 0.0 - y has no negative zero.
        [self.horizontal.steps(x), self.vertical.steps(z), 0.0 - self.horizontal.steps(y)]
    }

    #[inline(never)]
    fn curved_steps(&self, curvature: &Curvature, point: [i32; 3]) -> [f64; 3] {
        let place = point.map(f64::from);
        let moved = curvature.displacement(place);
        let along = |k: usize, axis: AxisScale| nearest(place[k] * axis.ratio + moved[k] / axis.step);
        [along(0, self.horizontal), along(2, self.vertical), 0.0 - along(1, self.horizontal)]
    }

    /// Returns the least and the greatest glTF coordinates in steps of `points`.
    pub(crate) fn extent(&self, points: &[[i32; 3]]) -> [[f64; 3]; 2] {
        let none = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        points.iter().map(|&p| self.steps(p)).fold(none, |[low, high], point| {
            [[0, 1, 2].map(|k| low[k].min(point[k])), [0, 1, 2].map(|k| high[k].max(point[k]))]
        })
    }

    /// Returns the least and the greatest glTF coordinates in steps of `points`, which are within `bounds`.
    pub(crate) fn extent_within(&self, points: &[[i32; 3]], bounds: Bounds<3>) -> [[f64; 3]; 2] {
        // On the plane the map is monotonic.
        if self.curvature().is_some() { self.extent(points) } else { self.extent(&[bounds.min, bounds.max]) }
    }

    /// Returns the glTF coordinates in metres of a lattice point relative to an origin in steps. They are exact within [`PART_REACH`]
    /// of it.
    #[inline(always)]
    pub(crate) fn local(&self, point: [i32; 3], origin: [f64; 3]) -> [f32; 3] {
        let [x, y, z] = self.steps(point);
        let (xy, up) = (self.horizontal.step, self.vertical.step);
        [((x - origin[0]) * xy) as f32, ((y - origin[1]) * up) as f32, ((z - origin[2]) * xy) as f32]
    }

    /// Returns the glTF coordinates in steps of a lattice point relative to an origin in steps.
    #[inline(always)]
    pub(crate) fn local_steps(&self, point: [i32; 3], origin: [f64; 3]) -> [f64; 3] {
        let steps = self.steps(point);
        [0, 1, 2].map(|k| steps[k] - origin[k])
    }

    /// Returns the metres in a step along the glTF axes.
    pub(crate) fn step(&self) -> [f64; 3] {
        self.metres([1.0; 3])
    }

    /// Returns a vertical step divided by a horizontal one.
    pub(crate) fn anisotropy(&self) -> f32 {
        (self.vertical.step / self.horizontal.step) as f32
    }

    /// Returns the glTF world position in metres of a lattice point, exactly as every tile has it.
    pub fn world(&self, point: [i32; 3]) -> [f64; 3] {
        self.metres(self.steps(point))
    }

    /// Returns the lattice point at a glTF world position in metres, or `None` if [`Frame::world`] gives no point that position.
    pub fn integers(&self, world: [f64; 3]) -> Option<[i32; 3]> {
        let [xy, up] = self.resolution_metres();
        let moved = [world[0], -world[2], world[1]];
        let steps = [xy, xy, up];
        let flat = match self.curvature() {
            Some(curvature) => curvature.flat(moved, steps),
            None => [0, 1, 2].map(|k| moved[k] / steps[k]),
        };
        let point = flat.map(f64::round);
        let is_there = point.iter().all(|v| v.abs() <= i32::MAX as f64);
        let point = point.map(|v| v as i32);
        (is_there && self.world(point) == world).then_some(point)
    }

    /// Returns steps as metres.
    pub(crate) fn metres(&self, steps: [f64; 3]) -> [f64; 3] {
        [steps[0] * self.horizontal.step, steps[1] * self.vertical.step, steps[2] * self.horizontal.step]
    }
}

/// Returns the origin on `grid` next to the middle between `low` and `high`, all in steps.
pub(crate) fn origin_between(low: [f64; 3], high: [f64; 3], grid: i64) -> [f64; 3] {
    [0, 1, 2].map(|k| (nearest((low[k] + high[k]) * 0.5 / grid as f64)) * grid as f64 + 0.0)
}

/// Returns the origin from which 16-bit positions reach everything between `low` and `high`, in steps, if there is one.
pub(crate) fn short_origin(low: [f64; 3], high: [f64; 3]) -> Option<[f64; 3]> {
    let origin = low.map(|v| (v / SHORT_GRID).floor() * SHORT_GRID + 0.0);
    (0..3).all(|k| high[k] - origin[k] <= SHORT_REACH).then_some(origin)
}

/// The finest grid for [`origin_between`].
pub(crate) const FINE_GRID: i64 = TRANSLATION_STEPS;

/// Returns the nearest f64. A lattice offset may have more digits, but the loss is far below any lattice step.
fn number(exact: Decimal) -> f64 {
    // The text of a decimal is always a number.
    exact.to_string().parse().unwrap_or(f64::NAN)
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
