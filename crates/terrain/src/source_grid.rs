//! Turns scene positions back into lattice integers, and these into source coordinates, correctly rounded.

use rust_decimal::Decimal;

use delaunay::geometry::REACH;
use delaunay::geometry::Site;
use lattice::shortest_decimal;
use tiles::curvature::Curvature;
use tiles::frame::Extras;
use tiles::gltf::read::TilePart;

/// Whole numbers below this are exact as f64.
const EXACT_INTEGER: u128 = 1 << 53;

/// Powers of ten up to this are exact as f64.
const EXACT_POWER: u32 = 22;

/// A plain position is at most this many lattice steps from its lattice point: half a glTF step, and some rounding.
const PLAIN_TOLERANCE: f64 = 0.26;

/// A quantized position lies on coarser steps, so it may be farther off, but its lattice point is still the nearest one.
const QUANTIZED_TOLERANCE: f64 = 0.499;

/// Why the extras of a scene describe no lattice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SourceGridError {
    /// Offset or resolution has too many digits, or the resolution is not positive.
    #[error("no lattice can have its offset and resolution")]
    NotDecimal,
    /// A step in metres is not positive and finite.
    #[error("its resolution and metres_per_unit are not positive numbers")]
    NotPositive,
}

/// The lattice that the tiles of a job describe.
#[derive(Clone, Debug)]
pub struct SourceGrid {
    /// Lattice steps in a metre: for x and y, for z.
    per_metre: [f64; 2],
    /// Metres in a lattice step: for x and y, for z.
    resolution: [f64; 2],
    axes: [DecimalAxis; 3],
    /// How far a vertex lies beside its place on the plane.
    curvature: Option<Curvature>,
}

impl SourceGrid {
    /// Returns the lattice of a scene with these extras.
    ///
    /// # Errors
    /// [`SourceGridError`] if no lattice can have these numbers.
    pub fn new(extras: &Extras) -> Result<SourceGrid, SourceGridError> {
        let steps = [extras.resolution, extras.resolution, extras.resolution_z];
        let axis = |k: usize| DecimalAxis::new(extras.offset[k], steps[k]);
        let axes = [axis(0), axis(1), axis(2)];
        let resolution = [extras.resolution * extras.metres_per_unit, extras.resolution_z * extras.metres_per_unit_z];
        let per_metre = resolution.map(|metres| 1.0 / metres);
        let [Some(x), Some(y), Some(z)] = axes else {
            return Err(SourceGridError::NotDecimal);
        };
        if !per_metre.iter().all(|v| v.is_finite() && *v > 0.0) {
            return Err(SourceGridError::NotPositive);
        }
        Ok(SourceGrid { per_metre, resolution, axes: [x, y, z], curvature: extras.curvature.clone() })
    }

    /// Returns the lattice integers x, y, z of a scene position in metres, or `None` if it is not on the lattice.
    #[inline]
    pub fn integers(&self, world: [f64; 3]) -> Option<[i32; 3]> {
        self.integers_within(world, PLAIN_TOLERANCE)
    }

    /// Returns the lattice integers of a quantized scene position, which is a whole number of `steps` (metres, for x, y up and z
    /// of the scene), or `None` if it is not the one nearest to a point of the lattice.
    #[inline]
    pub fn integers_on(&self, world: [f64; 3], steps: [f64; 3]) -> Option<[i32; 3]> {
        let point = self.integers_within(world, QUANTIZED_TOLERANCE)?;
        let [x, y, z] = [point[0], point[2], point[1]].map(f64::from);
        let [xy, up] = self.resolution;
        let mut exact = [x * (xy / steps[0]), y * (up / steps[1]), 0.0 - z * (xy / steps[2])];
        if let Some(curvature) = &self.curvature {
            let [east, north, up] = curvature.displacement(point.map(f64::from));
            exact = [exact[0] + east / steps[0], exact[1] + up / steps[1], exact[2] - north / steps[2]];
        }
        let is_nearest = (0..3).all(|k| nearest(exact[k]) * steps[k] == world[k]);
        is_nearest.then_some(point)
    }

    /// Returns the lattice integers of the vertices of a mesh, or `None` if some are not on the lattice.
    pub fn points_of(&self, mesh: &TilePart) -> Option<Vec<[i32; 3]>> {
        let plain = if may_be_plain(mesh) { all_of(mesh, |world| self.integers(world)) } else { None };
        plain.or_else(|| all_of(mesh, |world| self.integers_on(world, mesh.scale)))
    }

    /// Returns the scene positions in metres of the vertices of a mesh that are not on the lattice.
    pub fn strays_of<'m>(&'m self, mesh: &'m TilePart) -> impl Iterator<Item = [f64; 3]> + 'm {
        let is_plain = may_be_plain(mesh);
        let integers = move |world| if is_plain { self.integers(world) } else { self.integers_on(world, mesh.scale) };
        (0..mesh.positions.len()).map(|v| mesh.world(v)).filter(move |world| integers(*world).is_none())
    }

    #[inline(always)]
    fn integers_within(&self, world: [f64; 3], tolerance: f64) -> Option<[i32; 3]> {
        let [xy, up] = self.per_metre;
        let exact = match &self.curvature {
            None => [world[0] * xy, -world[2] * xy, world[1] * up],
            Some(curvature) => {
                let [xy, up] = self.resolution;
                curvature.flat([world[0], -world[2], world[1]], [xy, xy, up])
            }
        };
        let rounded = exact.map(nearest);
        let near = (0..3).all(|k| (exact[k] - rounded[k]).abs() <= tolerance);
        let within = rounded[0].abs().max(rounded[1].abs()) <= REACH as f64
            && (i32::MIN as f64..=i32::MAX as f64).contains(&rounded[2]);
        (near && within).then(|| rounded.map(|v| v as i32))
    }

    /// Returns the source coordinates of lattice integers, each the f64 nearest to the exact decimal and never -0.0.
    #[inline]
    pub fn coordinates(&self, point: [i32; 3]) -> [f64; 3] {
        [self.axes[0].world(point[0]), self.axes[1].world(point[1]), self.axes[2].world(point[2])]
    }

    /// Returns a site as a user knows it: in source coordinates.
    pub fn site_text(&self, site: Site) -> String {
        format!("({}, {})", self.axes[0].world(site[0]), self.axes[1].world(site[1]))
    }

    /// Returns both ends of an edge in source coordinates.
    pub fn edge_text(&self, a: Site, b: Site) -> String {
        format!("{} to {}", self.site_text(a), self.site_text(b))
    }
}

/// A plain mesh has the scale 1. So has a quantized mesh with steps of one metre.
fn may_be_plain(mesh: &TilePart) -> bool {
    mesh.scale == [1.0; 3]
}

fn all_of(mesh: &TilePart, integers: impl Fn([f64; 3]) -> Option<[i32; 3]>) -> Option<Vec<[i32; 3]>> {
    let mut points = Vec::with_capacity(mesh.positions.len());
    for v in 0..mesh.positions.len() {
        points.push(integers(mesh.world(v))?);
    }
    Some(points)
}

/// Returns `value` rounded to the nearest whole number if it is below 2^51, else something as large.
#[inline(always)]
fn nearest(value: f64) -> f64 {
    const SHIFT: f64 = 1.5 * (1u64 << 52) as f64;
    (value + SHIFT) - SHIFT
}

/// `world = (base + step * integer) / 10^digits`.
#[derive(Clone, Copy, Debug)]
struct DecimalAxis {
    base: i128,
    step: i128,
    digits: u32,
    power: f64,
}

impl DecimalAxis {
    fn new(offset: f64, step: f64) -> Option<DecimalAxis> {
        let (offset, step) = (shortest_decimal(offset)?, shortest_decimal(step)?);
        let digits = offset.scale().max(step.scale());
        let whole = |d: Decimal| d.mantissa().checked_mul(10i128.checked_pow(digits - d.scale())?);
        let (base, step) = (whole(offset)?, whole(step)?);
        let fits = step > 0 && base.abs() < 1 << 120 && step < 1 << 90;
        fits.then(|| DecimalAxis { base, step, digits, power: format!("1e{digits}").parse().unwrap_or(f64::NAN) })
    }

    #[inline(always)]
    fn world(&self, integer: i32) -> f64 {
        let mantissa = self.base + self.step * integer as i128;
        if mantissa.unsigned_abs() < EXACT_INTEGER && self.digits <= EXACT_POWER {
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
    use lattice::Lattice;

    #[test]
    fn coordinates_are_the_nearest_doubles() {
        let axis = DecimalAxis::new(5274357.144, 0.00025).unwrap();
        assert_eq!(axis.world(1), 5274357.14425);
        assert_eq!(axis.world(-4 * 5274357), 5269082.787);
        let long = DecimalAxis::new(123456789012.3456, 0.0000001).unwrap();
        assert_eq!(long.world(30), "123456789012.345603".parse::<f64>().unwrap());
        let odd = DecimalAxis::new(114.00000000000003, 0.000001).unwrap();
        assert_eq!(odd.world(-113_000_000), 1.00000000000003);
        assert!(DecimalAxis::new(0.0, 0.01).unwrap().world(0).is_sign_positive());
    }

    /// Returns a lattice in metres with steps of a centimetre, and of `resolution_z` for heights.
    fn grid(resolution_z: f64) -> SourceGrid {
        let extras = Extras {
            offset: [0.0; 3],
            resolution: 0.01,
            resolution_z,
            metres_per_unit: 1.0,
            metres_per_unit_z: 1.0,
            crs: None,
            curvature: None,
        };
        SourceGrid::new(&extras).unwrap()
    }

    #[test]
    fn positions_off_the_lattice_are_refused() {
        let source = grid(0.001);
        assert_eq!(source.integers([0.012, 0.0041, -0.0502]), Some([1, 5, 4]));
        assert_eq!(source.integers([0.014, 0.0, 0.0]), None);
        assert_eq!(source.integers([1e30, 0.0, 0.0]), None);
        assert_eq!(source.integers([f64::NAN, 0.0, 0.0]), None);
    }

    #[test]
    fn quantized_positions_are_next_to_the_lattice() {
        let source = grid(0.01);
        let step = 1.0 / 128.0;
        let on = |x: f64| source.integers_on([x * step, 0.0, 0.0], [step; 3]);
        // 0.05 m is 6.4 steps.
        assert_eq!(on(6.0), Some([5, 0, 0]));
        // Seven steps are nearer to 0.05 m than to 0.06 m, but six are nearer.
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
        let axis = DecimalAxis::new(635577.79, 0.01).unwrap();
        for i in [-5, 0, 1, 77, 123456] {
            assert_eq!(axis.world(i), (635577.79f64 * 100.0).round().mul_add(1.0, i as f64) / 100.0);
            assert!((axis.world(i) - lattice.world(0, i)).abs() < 1e-9);
        }
    }
}
