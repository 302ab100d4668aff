//! Where lattice integers lie in a glTF scene: in metres, Y up, with every coordinate a whole multiple of a power of two, the step.
//!
//! A vertex is at `translation + position`: its node's translation and an f32 of its mesh. Both are whole multiples of the job's
//! steps, so their sum in f64 is exact and depends on the lattice integers alone. A vertex that several tiles share has the same bits
//! in all of them. A step is at most half a lattice step, so rounding finds the integer again. In a job that is small enough for f32
//! the steps are finer, and positions are truer. Packed tiles have coarser steps, just fine enough for rounding, so that positions
//! take 16 bits: see [`Frame::packed`].

use rust_decimal::Decimal;
use serde::{Deserialize, Serialize};

use crate::axis_scale::{AxisScale, TRANSLATION_STEPS, nearest, nearest_integer};
use crate::compression::Compression;
use crate::curvature::{AT_ONCE, Curvature, place_of};
use delaunay::geometry::Bounds;
use lattice::Lattice;
use sys::Result;

/// A rounded place of a plain bent scene leads back to within this many lattice steps of its lattice point.
const MOST_OFF_PLAIN: f64 = 0.255;

/// The same for packed tiles.
const MOST_OFF_PACKED: f64 = 0.497;

/// More often than this no step is halved.
const STEPS_HALVED: usize = 8;

/// By how many metres in a metre a displacement may change at most, so that the places of a bent scene are surely found again. On the
/// earth that is a square about 640 km wide.
const STEEPEST: f64 = 0.1;

/// Steps that a 16-bit position reaches from its origin.
const SHORT_REACH: f64 = 65535.0;

/// Origins of meshes with 16-bit positions are multiples of this many steps. A lattice step has at most 4 of these steps, so they stay
/// below 2^33 steps, and the translation is exact as f32.
const SHORT_GRID: f64 = 512.0;

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

impl Frame {
    /// Returns the frame of a job, with steps of about half a lattice step. `metres_per_unit` is for x and y, `metres_per_unit_z` for z,
    /// and `crs` is WKT.
    ///
    /// # Errors
    /// [`sys::Error::Config`] if a lattice step in metres is not a positive number of a sensible size.
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

    /// Returns the frames with all steps that a job may choose, the coarsest first: those of packed tiles, halved some times.
    pub(crate) fn possible(&self) -> impl Iterator<Item = Frame> {
        const MOST_HALVED: usize = 12;
        let halved = |scale: AxisScale, times: usize| (0..times).fold(scale, |scale, _| scale.halved());
        let [xy, up] = self.resolution_metres();
        let all = (0..MOST_HALVED).flat_map(|flat| (0..MOST_HALVED).map(move |upward| [flat, upward]));
        all.map(move |[flat, upward]| Frame {
            horizontal: halved(AxisScale::packed(xy), flat),
            vertical: halved(AxisScale::packed(up), upward),
            ..self.clone()
        })
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
            let Some(parts) = self.off(&steep).into_iter().find(|parts| parts.iter().sum::<f64>() > most) else {
                break;
            };
            // The steps to blame need not be those of the axis along which the place is off.
            let is_vertical = parts[2] > parts[0].max(parts[1]);
            let scale = if is_vertical { &mut self.vertical } else { &mut self.horizontal };
            *scale = scale.halved();
        }
        self
    }

    /// Returns by how many lattice steps a place is off along each axis, at most, when it was rounded and led back: for each the parts that
    /// rounding along x, y and z has in it. `steep` is the steepness of the curvature.
    fn off(&self, steep: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
        let [xy, up] = self.resolution_metres();
        let half = [self.horizontal.step, self.horizontal.step, self.vertical.step].map(|step| step / 2.0);
        // To first order; a tenth covers the rest and what lies between the places that were looked at.
        let part = |k: usize, b: usize| half[b] * (f64::from(u8::from(k == b)) + 1.1 * steep[k][b]);
        [(0, xy), (1, xy), (2, up)].map(|(k, step)| [0, 1, 2].map(|b| part(k, b) / step))
    }

    /// Tells whether the places of a bent scene can be found again, and whether its steps hold every triangle within `bounds` that the frame
    /// `flat` of the job holds. If not, the scene must stay a plane.
    pub fn can_be_bent(&self, flat: &Frame, bounds: Bounds<3>, packing: Compression) -> bool {
        let Some(curvature) = self.curvature() else { return true };
        let [xy, up] = self.resolution_metres();
        let steep = curvature.steepness([xy, xy, up]);
        let most = if packing == Compression::None { MOST_OFF_PLAIN } else { MOST_OFF_PACKED };
        let leads_back = self.off(&steep).into_iter().all(|off| off.iter().sum::<f64>() <= most)
            && steep.iter().flatten().map(|part| part * part).sum::<f64>() <= STEEPEST * STEEPEST;
        let (moved, longest, needed) = (curvature.greatest(), self.longest_triangle(), flat.longest_triangle());
        let holds = |k: usize, step: f64, axis: usize| {
            longest[axis] >= needed[axis].min(bounds.extent(k) as f64 * step + 2.0 * moved[k])
        };
        leads_back && holds(0, xy, 0) && holds(1, xy, 0) && holds(2, up, 1)
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
    pub(crate) fn steps(&self, point: [i32; 3]) -> [f64; 3] {
        match self.curvature() {
            Some(curvature) => {
                let place = point.map(f64::from);
                self.bent(place, curvature.displacement(place))
            }
            None => self.flat_steps(point),
        }
    }

    /// Does what [`Frame::steps`] does if the scene is a plane.
    #[inline(always)]
    pub(crate) fn flat_steps(&self, [x, y, z]: [i32; 3]) -> [f64; 3] {
        // 0.0 - y has no negative zero.
        [self.horizontal.steps(x), self.vertical.steps(z), 0.0 - self.horizontal.steps(y)]
    }

    /// Returns the glTF coordinates in steps of a place on the lattice that is moved by so many metres.
    #[inline(always)]
    fn bent(&self, place: [f64; 3], moved: [f64; 3]) -> [f64; 3] {
        let along = |k: usize, axis: AxisScale| nearest(place[k] * axis.ratio + moved[k] / axis.step);
        [along(0, self.horizontal), along(2, self.vertical), 0.0 - along(1, self.horizontal)]
    }

    /// Returns what [`Frame::steps`] returns for each of `points`, in the memory of `steps`, if the scene is bent. On a plane it takes less
    /// time to compute places where they are needed.
    pub(crate) fn bent_steps(&self, points: &[[i32; 3]], mut steps: Vec<[f64; 3]>) -> Option<Vec<[f64; 3]>> {
        let curvature = self.curvature()?;
        steps.clear();
        steps.reserve(points.len());
        for some in points.chunks(AT_ONCE) {
            let mut places = [[0.0; AT_ONCE]; 3];
            for (i, point) in some.iter().enumerate() {
                (0..3).for_each(|k| places[k][i] = f64::from(point[k]));
            }
            let moved = curvature.displacements(&places);
            steps.extend((0..some.len()).map(|i| self.bent(place_of(&places, i), place_of(&moved, i))));
        }
        Some(steps)
    }

    /// Returns the glTF coordinates in metres of a place in steps relative to an origin in steps. They are exact within `NODE_REACH` of it.
    #[inline(always)]
    pub(crate) fn local(&self, [x, y, z]: [f64; 3], origin: [f64; 3]) -> [f32; 3] {
        let (xy, up) = (self.horizontal.step, self.vertical.step);
        [((x - origin[0]) * xy) as f32, ((y - origin[1]) * up) as f32, ((z - origin[2]) * xy) as f32]
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
        let point = flat.map(nearest);
        let is_there = point.iter().all(|v| v.abs() <= i32::MAX as f64);
        let point = point.map(|v| v as i32);
        (is_there && self.world(point) == world).then_some(point)
    }

    /// Returns the lattice points at `positions` of a mesh that its node moves by `translation` and stretches by `scale`.
    ///
    /// # Errors
    /// The first place in metres where the lattice has no point.
    pub fn points(
        &self,
        positions: &[[f32; 3]],
        translation: [f64; 3],
        scale: [f64; 3],
    ) -> std::result::Result<Vec<[i32; 3]>, [f64; 3]> {
        let many = match self.curvature() {
            Some(curvature) => self.unbent_points(curvature, positions, translation, scale),
            None => self.flat_points(positions, translation, scale),
        };
        if let Some(points) = many {
            return Ok(points);
        }
        let world = |p: &[f32; 3]| [0, 1, 2].map(|k| translation[k] + scale[k] * f64::from(p[k]));
        positions.iter().map(world).map(|world| self.integers(world).ok_or(world)).collect()
    }

    /// Does what [`Frame::points`] does, if the scene is bent, many points at a time. `None` if one of them is not found like this.
    fn unbent_points(
        &self,
        curvature: &Curvature,
        positions: &[[f32; 3]],
        translation: [f64; 3],
        scale: [f64; 3],
    ) -> Option<Vec<[i32; 3]>> {
        let mut points = Vec::with_capacity(positions.len());
        let [xy, up] = self.resolution_metres();
        for some in positions.chunks(AT_ONCE) {
            // All are looked for until the last is found, so what is left of the block has a place that is no harder to find.
            let mut moved = [[0.0; AT_ONCE]; 3];
            for (along, (k, sign)) in moved.iter_mut().zip([(0, 1.0), (2, -1.0), (1, 1.0)]) {
                let last = some.len() - 1;
                for (i, place) in along.iter_mut().enumerate() {
                    *place = sign * (translation[k] + scale[k] * f64::from(some[i.min(last)][k]));
                }
            }
            let places = curvature.flat_places(&moved, [xy, xy, up]).map(|along| along.map(nearest));
            let bent = curvature.displacements(&places);
            for i in 0..some.len() {
                let (place, moved) = (place_of(&places, i), place_of(&moved, i));
                let [x, y, z] = self.metres(self.bent(place, place_of(&bent, i)));
                if place.iter().any(|v| v.abs() > f64::from(i32::MAX)) || [x, 0.0 - z, y] != moved {
                    return None;
                }
                points.push(place.map(nearest_integer));
            }
        }
        Some(points)
    }

    /// Does what [`Frame::points`] does, if the scene is not bent, many points at a time. `None` if one of them is not found like this.
    fn flat_points(&self, positions: &[[f32; 3]], translation: [f64; 3], scale: [f64; 3]) -> Option<Vec<[i32; 3]>> {
        let mut points = Vec::with_capacity(positions.len());
        let axes = [(0, 1.0, self.horizontal), (2, -1.0, self.horizontal), (1, 1.0, self.vertical)];
        for some in positions.chunks(AT_ONCE) {
            let mut along = [[0; AT_ONCE]; 3];
            for (along, (k, sign, axis)) in along.iter_mut().zip(axes) {
                let mut places = [0.0; AT_ONCE];
                places
                    .iter_mut()
                    .zip(some)
                    .for_each(|(place, p)| *place = sign * (translation[k] + scale[k] * f64::from(p[k])));
                if !axis.integers(&places, along) {
                    return None;
                }
            }
            let [x, y, z] = &along;
            points.extend((0..some.len()).map(|i| [x[i], y[i], z[i]]));
        }
        Some(points)
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
