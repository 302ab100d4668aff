//! The way from the scene to the globe.

use crate::geometry::Bounds;
use crate::output::frame::Extras;
use crate::output::tiles3d::globe::{Globe, relative_place, transform_point};

/// The number of places along each side at which the distortion is measured. Both ends are among them: there it is greatest.
const PLACES: usize = 9;

/// The ground of a terrain: metres east, north and up of the scene's plane, and where they lie on the globe.
pub struct Ground<'a> {
    extras: &'a Extras,
    globe: Globe,
    /// The height of the scene's origin above the ellipsoid in metres.
    base: f64,
}

impl<'a> Ground<'a> {
    /// Returns the ground of a scene in the system of `definition`, in the form of PROJ.4. `height_offset` is added to heights, in metres.
    ///
    /// # Errors
    /// A sentence that says why there is none.
    pub fn new(extras: &'a Extras, definition: &str, height_offset: f64) -> Result<Ground<'a>, String> {
        let globe = Globe::new(definition, extras.metres_per_unit)?;
        Ok(Ground { extras, globe, base: extras.offset[2] * extras.metres_per_unit_z + height_offset })
    }

    /// Returns the source's x and y at a place of the plane.
    fn source(&self, place: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|k| self.extras.offset[k] + place[k] / self.extras.metres_per_unit)
    }

    /// Returns the metres east, north and up of a lattice place, whole or not.
    pub fn metres(&self, place: [f64; 3]) -> [f64; 3] {
        let steps = self.steps();
        [0, 1, 2].map(|k| place[k] * steps[k])
    }

    /// Returns the metres in a lattice step along each axis.
    pub fn steps(&self) -> [f64; 3] {
        let Extras { resolution, resolution_z, metres_per_unit, metres_per_unit_z, .. } = self.extras;
        let xy = resolution * metres_per_unit;
        [xy, xy, resolution_z * metres_per_unit_z]
    }

    /// Returns the map from the plane to the globe that is exact to first order at a place of the lattice, at the height of the scene's
    /// origin.
    ///
    /// # Errors
    /// A sentence if the place is outside the range of the projection.
    pub fn tangent(&self, [x, y]: [i32; 2]) -> Result<[f64; 16], String> {
        let [east, north, _] = self.metres([f64::from(x), f64::from(y), 0.0]);
        let [source_x, source_y] = self.source([east, north]);
        let mut transform = self.globe.tangent(source_x, source_y, self.base)?;
        // Move the origin from the tangent's to the scene's.
        let origin = transform_point(&transform, [-east, -north, 0.0]);
        transform[12..15].copy_from_slice(&origin);
        Ok(transform)
    }

    /// Returns the earth-centred place of a place of the plane in metres.
    ///
    /// # Errors
    /// As [`Ground::tangent`].
    pub fn place(&self, [east, north, up]: [f64; 3]) -> Result<[f64; 3], String> {
        let [source_x, source_y] = self.source([east, north]);
        self.globe.place(source_x, source_y, self.base + up)
    }

    /// Returns how far from its place of the plane a lattice place lies on the globe, in metres of the frame of `transform`.
    ///
    /// # Errors
    /// As [`Ground::tangent`].
    pub fn displacement(&self, transform: &[f64; 16], place: [f64; 3]) -> Result<[f64; 3], String> {
        let flat = self.metres(place);
        let belongs = relative_place(transform, self.place(flat)?);
        Ok([0, 1, 2].map(|k| belongs[k] - flat[k]))
    }

    /// Returns the greatest distance in metres between where `transform` puts a place within `bounds`, moved by the scene's curvature, and
    /// where it belongs.
    ///
    /// # Errors
    /// As [`Ground::tangent`].
    pub fn distortion(&self, transform: &[f64; 16], bounds: Bounds<3>) -> Result<f64, String> {
        let [low, high] = [bounds.min, bounds.max].map(|corner| corner.map(f64::from));
        let mut greatest = 0.0f64;
        for i in 0..PLACES * PLACES * 2 {
            let share = [i % PLACES, i / PLACES % PLACES].map(|n| n as f64 / (PLACES - 1) as f64);
            let [x, y] = [0, 1].map(|k| low[k] + (high[k] - low[k]) * share[k]);
            let place = [x, y, if i < PLACES * PLACES { low[2] } else { high[2] }];
            let moved = self.extras.curvature.as_ref().map_or([0.0; 3], |curvature| curvature.displacement(place));
            let belongs = self.displacement(transform, place)?;
            greatest = greatest.max((0..3).map(|k| (moved[k] - belongs[k]).powi(2)).sum::<f64>().sqrt());
        }
        Ok(greatest)
    }
}
