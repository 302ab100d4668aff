//! Places a terrain in a projected coordinate system on the WGS 84 ellipsoid.
//!
//! The sines are those of the crate `libm`, which gives the same bits on every machine.

use crs::geoid::Geoid;
use glam::{DAffine3, DMat3, DMat4, DVec3};
use sys::Error;

/// The greater half axis of the WGS 84 ellipsoid in metres.
const SEMI_MAJOR: f64 = 6_378_137.0;

/// The square of the eccentricity of the WGS 84 ellipsoid.
const ECCENTRICITY_2: f64 = 0.006_694_379_990_141_317;

/// Why a terrain, or a place of it, is not on the globe.
#[derive(Debug, thiserror::Error)]
pub enum NotPlaced {
    /// Its coordinate system does not lead there.
    #[error("{0}")]
    System(String),
    /// What to add to heights there is not known: the job cannot do what its configuration says.
    #[error("{0}")]
    Height(Error),
}

impl From<String> for NotPlaced {
    fn from(why: String) -> NotPlaced {
        NotPlaced::System(why)
    }
}

/// Computes longitude and latitude in radians on WGS 84 of x and y; `None` outside the range of the projection.
pub type Geographic = Box<dyn Fn([f64; 2]) -> Option<[f64; 2]> + Send + Sync>;

/// The system of a terrain, and its way to the globe.
pub struct GlobeSystem {
    /// In the form of PROJ.4.
    pub definition: String,
    /// Its way to longitude and latitude, with the same bits on every machine.
    pub way: Geographic,
}

/// The map from a projected system to the ellipsoid.
pub struct Globe {
    way: Geographic,
    /// Metres in a unit of x and y.
    metres_per_unit: f64,
    /// What is added to heights.
    geoid: Geoid,
}

impl Globe {
    /// Returns the map from a system. Its heights count from `geoid`.
    pub fn new(system: GlobeSystem, metres_per_unit: f64, geoid: Geoid) -> Globe {
        Globe { way: system.way, metres_per_unit, geoid }
    }

    /// Returns the earth-centred x, y, z in metres of the place at `x`, `y` (source units), `height` metres above the geoid.
    ///
    /// # Errors
    /// [`NotPlaced::System`] if the place is outside the range of the projection, [`NotPlaced::Height`] if it is outside the geoid's.
    pub fn place(&self, x: f64, y: f64, height: f64) -> Result<[f64; 3], NotPlaced> {
        let offset = self.height_of_geoid(self.geographic(x, y)?)?;
        self.place_above_ellipsoid(x, y, height + offset)
    }

    /// Returns the earth-centred place at `x`, `y` (source units), `height` metres above the ellipsoid.
    ///
    /// # Errors
    /// [`NotPlaced::System`] if the place is outside the range of the projection.
    pub fn place_above_ellipsoid(&self, x: f64, y: f64, height: f64) -> Result<[f64; 3], NotPlaced> {
        let [longitude, latitude] = self.geographic(x, y)?;
        let (sin, cos) = libm::sincos(latitude);
        let normal = SEMI_MAJOR / (1.0 - ECCENTRICITY_2 * sin * sin).sqrt();
        let around = (normal + height) * cos;
        let (east, north) = libm::sincos(longitude);
        Ok([around * north, around * east, (normal * (1.0 - ECCENTRICITY_2) + height) * sin])
    }

    /// Returns the longitude and latitude of a place (source units) in radians.
    ///
    /// # Errors
    /// A sentence if the place is outside the range of the projection.
    pub fn geographic(&self, x: f64, y: f64) -> Result<[f64; 2], String> {
        (self.way)([x, y]).ok_or_else(|| "out of range".into())
    }

    /// Returns the metres to add to heights at a place (source units).
    ///
    /// # Errors
    /// As [`Globe::place`].
    pub fn height_offset(&self, x: f64, y: f64) -> Result<f64, NotPlaced> {
        self.height_of_geoid(self.geographic(x, y)?)
    }

    /// Returns what [`Globe::height_offset`] does, by longitude and latitude in radians.
    ///
    /// # Errors
    /// [`NotPlaced::Height`] if the place is outside the range of the geoid.
    pub fn height_of_geoid(&self, place: [f64; 2]) -> Result<f64, NotPlaced> {
        // By multiplication alone, not by a function of the machine.
        let [longitude, latitude] = place.map(|radians| radians * (180.0 / std::f64::consts::PI));
        self.geoid.at(longitude, latitude).map_err(NotPlaced::Height)
    }

    /// Returns the name of the geoid's model; `None` for a number of metres.
    pub fn geoid_model(&self) -> Option<&str> {
        self.geoid.model()
    }

    /// Returns the linear map from metres east, north and up of (`x`, `y`, `height`) to earth-centred metres that is exact to first
    /// order there, column by column as in 3D Tiles.
    ///
    /// # Errors
    /// As [`Globe::place`].
    pub fn tangent(&self, x: f64, y: f64, height: f64) -> Result<[f64; 16], NotPlaced> {
        let (origin, offset) = (self.place(x, y, height)?, self.height_offset(x, y)?);
        /// Metres. Differences over this distance lose little to rounding and little to the curvature.
        const STEP: f64 = 10.0;
        let along = |dx: f64, dy: f64| -> Result<[f64; 3], NotPlaced> {
            let (dx, dy) = (dx * STEP / self.metres_per_unit, dy * STEP / self.metres_per_unit);
            // Beside the middle of a tile, the geoid's grid may end. The tile does not tilt with it then.
            let beside = |sign: f64| match self.place(x + sign * dx, y + sign * dy, height) {
                Err(NotPlaced::Height(_)) => self.place_above_ellipsoid(x + sign * dx, y + sign * dy, height + offset),
                place => place,
            };
            let (ahead, behind) = (beside(1.0)?, beside(-1.0)?);
            Ok([0, 1, 2].map(|k| (ahead[k] - behind[k]) / (2.0 * STEP)))
        };
        let up = self.place(x, y, height + 1.0)?;
        let up = [0, 1, 2].map(|k| up[k] - origin[k]);
        let (east, north) = (along(1.0, 0.0)?, along(0.0, 1.0)?);
        let mut columns = [0.0; 16];
        for (at, column) in [east, north, up, origin].into_iter().enumerate() {
            columns[4 * at..4 * at + 3].copy_from_slice(&column);
        }
        columns[15] = 1.0;
        Ok(columns)
    }
}

/// Returns the place in metres to which `transform` maps a place of the tileset.
pub fn transform_point(transform: &[f64; 16], place: [f64; 3]) -> [f64; 3] {
    affine(transform).transform_point3(place.into()).into()
}

/// Returns `transform` behind the linear map with these columns.
pub(super) fn after_linear(transform: &[f64; 16], columns: [[f64; 3]; 3]) -> [f64; 16] {
    let mut transform = affine(transform);
    transform.matrix3 *= DMat3::from_cols_array_2d(&columns);
    DMat4::from(transform).to_cols_array()
}

/// Returns the transform that, followed by `outer`, leads to the same place as `inner`. `outer` must have an inverse.
pub fn relative_transform(outer: &[f64; 16], inner: &[f64; 16]) -> [f64; 16] {
    let (outer, inner) = (affine(outer), affine(inner));
    let back = outer.matrix3.inverse();
    // Earth-centred places are far longer than their difference, so it is taken first.
    let translation = back * (inner.translation - outer.translation);
    DMat4::from(DAffine3 { matrix3: back * inner.matrix3, translation }).to_cols_array()
}

/// Returns the place of the tileset that `transform`, which must have an inverse, maps to `place` in metres.
pub fn relative_place(transform: &[f64; 16], place: [f64; 3]) -> [f64; 3] {
    let transform = affine(transform);
    // Earth-centred places are far longer than their difference, so it is taken first.
    (transform.matrix3.inverse() * (DVec3::from(place) - transform.translation)).into()
}

fn affine(transform: &[f64; 16]) -> DAffine3 {
    DAffine3::from_mat4(DMat4::from_cols_array(transform))
}
