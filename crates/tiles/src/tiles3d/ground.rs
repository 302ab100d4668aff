//! The way from the scene to the globe.

use crate::frame::Extras;
use crate::tiles3d::globe::{Globe, GlobeSystem, NotPlaced, after_linear, relative_place, transform_point};
use crs::geoid::Geoid;
use delaunay::geometry::Bounds;

/// The number of places along each side at which the distortion is measured. Both ends are among them: there it is greatest.
const PLACES: usize = 9;

/// Places on the way to the middle at which the geoid is asked where it has no height at a place itself.
const WAY: usize = 64;

/// Half the distance in metres over which the slope of a bent scene is taken.
const SLOPE_REACH: f64 = 10.0;

/// The ground of a terrain: metres east, north and up of the plane of the source, and where they lie on the globe.
pub struct Ground<'a> {
    extras: &'a Extras,
    globe: Globe,
    /// The height of the scene's origin above the geoid in metres.
    base: f64,
}

impl<'a> Ground<'a> {
    /// Returns the ground of a scene in a system. Heights count from `geoid`.
    pub fn new(extras: &'a Extras, system: GlobeSystem, geoid: Geoid) -> Ground<'a> {
        let globe = Globe::new(system, extras.metres_per_unit, geoid);
        Ground { extras, globe, base: extras.offset[2] * extras.metres_per_unit_z }
    }

    /// Returns the metres that are added to heights at a lattice point.
    ///
    /// # Errors
    /// As [`Globe::place`].
    pub fn height_offset(&self, [x, y]: [i32; 2]) -> Result<f64, NotPlaced> {
        self.offset_at(self.metres([f64::from(x), f64::from(y), 0.0]))
    }

    /// Returns the lattice point nearest to the middle of `bounds` for which it is known what to add to heights: a geoid's grid may have
    /// none at sea.
    ///
    /// # Errors
    /// As [`Globe::place`], of the middle, if there is no such point.
    pub fn seen_from(&self, bounds: Bounds<3>) -> Result<[i32; 3], NotPlaced> {
        let middle = bounds.middle();
        let known = |point: [i32; 3]| self.height_offset([point[0], point[1]]).map(|_| point);
        let Err(why) = known(middle) else { return Ok(middle) };
        let middle_place = PLACES as i64 / 2;
        let off = |i: usize| [i % PLACES, i / PLACES].map(|number| number as i64 - middle_place);
        let mut others: Vec<usize> = (0..PLACES * PLACES).collect();
        others.sort_by_key(|&i| off(i).map(|steps| steps * steps).iter().sum::<i64>());
        let point = |i: usize| {
            let [x, y] = [0, 1]
                .map(|k| i64::from(bounds.min[k]) + bounds.extent(k) * (off(i)[k] + middle_place) / (2 * middle_place));
            [x as i32, y as i32, middle[2]]
        };
        others.into_iter().find_map(|i| known(point(i)).ok()).ok_or(why)
    }

    /// Returns the name of the geoid's model; `None` for a number of metres.
    pub fn geoid_model(&self) -> Option<&str> {
        self.globe.geoid_model()
    }

    /// Returns the map from the plane to the globe that is exact to first order at a lattice point.
    ///
    /// # Errors
    /// As [`Globe::place`].
    pub fn tangent(&self, point: [i32; 3]) -> Result<[f64; 16], NotPlaced> {
        let middle = self.metres(point.map(f64::from));
        let [x, y] = self.source(middle);
        let mut transform = self.globe.tangent(x, y, self.base + middle[2])?;
        // Move the origin from the tangent's to the scene's.
        let origin = transform_point(&transform, middle.map(|metres| -metres));
        transform[12..15].copy_from_slice(&origin);
        Ok(transform)
    }

    /// Returns the map from the scene, bent as its extras say, to the globe that is exact to first order at a lattice point. The scene
    /// must be bent along the vertical alone.
    ///
    /// # Errors
    /// As [`Globe::place`].
    pub fn tangent_of_scene(&self, point: [i32; 3]) -> Result<[f64; 16], NotPlaced> {
        let flat = self.tangent(point)?;
        let place = point.map(f64::from);
        let up = self.moved(place)[2];
        let slope = |axis: usize| {
            let mut ends = [place; 2];
            ends[0][axis] -= SLOPE_REACH / self.steps()[axis];
            ends[1][axis] += SLOPE_REACH / self.steps()[axis];
            let [behind, ahead] = ends.map(|end| self.moved(end)[2]);
            (ahead - behind) / (2.0 * SLOPE_REACH)
        };
        // What is east on the plane leads upwards in the scene.
        let [east, north] = [slope(0), slope(1)];
        let mut transform = after_linear(&flat, [[1.0, 0.0, -east], [0.0, 1.0, -north], [0.0, 0.0, 1.0]]);
        let middle = self.metres(place);
        let belongs = transform_point(&flat, middle);
        let found = transform_point(&transform, [middle[0], middle[1], middle[2] + up]);
        (0..3).for_each(|k| transform[12 + k] += belongs[k] - found[k]);
        Ok(transform)
    }

    /// Returns how far from its place on the plane a lattice place lies on the globe, in metres of the frame of `transform`. If the geoid has
    /// no height there, that of the nearest place towards `middle` counts.
    ///
    /// # Errors
    /// As [`Globe::place`]; [`NotPlaced::Height`] if there is no such place.
    pub fn displacement(
        &self,
        transform: &[f64; 16],
        place: [f64; 3],
        middle: [i32; 3],
    ) -> Result<[f64; 3], NotPlaced> {
        let flat = self.metres(place);
        let offset = self.nearest_offset(flat, self.metres(middle.map(f64::from)))?;
        let [x, y] = self.source(flat);
        let belongs = self.globe.place_above_ellipsoid(x, y, self.base + flat[2] + offset)?;
        let found = relative_place(transform, belongs);
        Ok([0, 1, 2].map(|k| found[k] - flat[k]))
    }

    /// Tells whether it is known what to add to heights at a lattice place.
    pub fn is_known(&self, place: [f64; 3]) -> bool {
        self.offset_at(self.metres(place)).is_ok()
    }

    /// Returns the greatest distance in metres between where `transform` puts a place of the scene within `bounds` and where it belongs.
    ///
    /// # Errors
    /// [`NotPlaced::System`] if a place is outside the range of the projection, [`NotPlaced::Height`] if the geoid's file cannot be read.
    pub fn distortion(&self, transform: &[f64; 16], bounds: Bounds<3>) -> Result<f64, NotPlaced> {
        let [low, high] = [bounds.min, bounds.max].map(|corner| corner.map(f64::from));
        let mut greatest = 0.0f64;
        for i in 0..PLACES * PLACES * 2 {
            let share = [i % PLACES, i / PLACES % PLACES].map(|n| n as f64 / (PLACES - 1) as f64);
            let [x, y] = [0, 1].map(|k| low[k] + (high[k] - low[k]) * share[k]);
            let place = [x, y, if i < PLACES * PLACES { low[2] } else { high[2] }];
            let (flat, moved) = (self.metres(place), self.moved(place));
            let [source_x, source_y] = self.source(flat);
            let belongs = match self.globe.place(source_x, source_y, self.base + flat[2]) {
                // The corners of a box may lie beyond the geoid's grid although no point does.
                Err(NotPlaced::Height(_)) => continue,
                place => place?,
            };
            let found = transform_point(transform, [0, 1, 2].map(|k| flat[k] + moved[k]));
            greatest = greatest.max((0..3).map(|k| (found[k] - belongs[k]).powi(2)).sum::<f64>().sqrt());
        }
        Ok(greatest)
    }

    /// Returns the metres to add to heights at the place nearest to `flat`, on the straight way to `middle`, where the geoid has one.
    fn nearest_offset(&self, flat: [f64; 3], middle: [f64; 3]) -> Result<f64, NotPlaced> {
        let mut number = 0;
        loop {
            let share = number as f64 / WAY as f64;
            match self.offset_at([0, 1, 2].map(|k| flat[k] + (middle[k] - flat[k]) * share)) {
                Err(NotPlaced::Height(_)) if number < WAY => number += 1,
                offset => return offset,
            }
        }
    }

    fn offset_at(&self, flat: [f64; 3]) -> Result<f64, NotPlaced> {
        let [x, y] = self.source(flat);
        self.globe.height_offset(x, y)
    }

    /// Returns the metres by which a lattice place is moved from the plane to the scene.
    fn moved(&self, place: [f64; 3]) -> [f64; 3] {
        self.extras.curvature.as_ref().map_or([0.0; 3], |curvature| curvature.displacement(place))
    }

    /// Returns the source's x and y at a place of the plane.
    fn source(&self, flat: [f64; 3]) -> [f64; 2] {
        [0, 1].map(|k| self.extras.offset[k] + flat[k] / self.extras.metres_per_unit)
    }

    /// Returns the metres east, north and up of a lattice place, whole or not.
    fn metres(&self, place: [f64; 3]) -> [f64; 3] {
        let steps = self.steps();
        [0, 1, 2].map(|k| place[k] * steps[k])
    }

    /// Returns the metres in a lattice step along each axis.
    fn steps(&self) -> [f64; 3] {
        let Extras { resolution, resolution_z, metres_per_unit, metres_per_unit_z, .. } = self.extras;
        let xy = resolution * metres_per_unit;
        [xy, xy, resolution_z * metres_per_unit_z]
    }
}
