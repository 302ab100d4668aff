//! Places a terrain in a projected coordinate system on the WGS 84 ellipsoid.
//!
//! The sines of this file and of `proj4rs` come from the machine's mathematics library, so the last digits of a transform may differ
//! between machines.

use glam::{DAffine3, DMat4, DVec3};
use proj4rs::Proj;
use proj4rs::transform::transform;

/// The greater half axis of the WGS 84 ellipsoid in metres.
const SEMI_MAJOR: f64 = 6_378_137.0;

/// The square of the eccentricity of the WGS 84 ellipsoid.
const ECCENTRICITY_2: f64 = 0.006_694_379_990_141_317;

/// The map from a projected system to the ellipsoid.
pub struct Globe {
    from: Proj,
    to: Proj,
    /// Metres in a unit of x and y.
    metres_per_unit: f64,
}

impl Globe {
    /// Returns the map from the system that `definition` describes in the form of PROJ.4.
    ///
    /// # Errors
    /// A sentence that says why there is no such map.
    pub fn new(definition: &str, metres_per_unit: f64) -> Result<Globe, String> {
        let parse = |text: &str| Proj::from_proj_string(text).map_err(|e| format!("{text}: {e}"));
        let from = parse(definition)?;
        if from.is_latlong() || from.is_geocent() {
            return Err("it is not a projected system".into());
        }
        Ok(Globe { from, to: parse("+proj=longlat +datum=WGS84 +no_defs")?, metres_per_unit })
    }

    /// Returns the earth-centred x, y, z in metres of the place at `x`, `y` (source units), `height` metres above the ellipsoid.
    ///
    /// # Errors
    /// A sentence if the place is outside the range of the projection.
    pub fn place(&self, x: f64, y: f64, height: f64) -> Result<[f64; 3], String> {
        let [longitude, latitude] = self.geographic(x, y)?;
        let (sin, cos) = latitude.sin_cos();
        let normal = SEMI_MAJOR / (1.0 - ECCENTRICITY_2 * sin * sin).sqrt();
        let around = (normal + height) * cos;
        Ok([around * longitude.cos(), around * longitude.sin(), (normal * (1.0 - ECCENTRICITY_2) + height) * sin])
    }

    /// Returns the longitude and latitude of a place (source units) in radians.
    ///
    /// # Errors
    /// As [`Globe::place`].
    pub fn geographic(&self, x: f64, y: f64) -> Result<[f64; 2], String> {
        let mut point = (x, y, 0.0);
        transform(&self.from, &self.to, &mut point).map_err(|e| e.to_string())?;
        if point.0.is_finite() && point.1.is_finite() { Ok([point.0, point.1]) } else { Err("out of range".into()) }
    }

    /// Returns the linear map from metres east, north and up of (`x`, `y`, `height`) to earth-centred metres that is exact to first
    /// order there, column by column as in 3D Tiles.
    ///
    /// # Errors
    /// As [`Globe::place`].
    pub fn tangent(&self, x: f64, y: f64, height: f64) -> Result<[f64; 16], String> {
        let origin = self.place(x, y, height)?;
        /// Metres. Differences over this distance lose little to rounding and little to the curvature.
        const STEP: f64 = 10.0;
        let along = |dx: f64, dy: f64| -> Result<[f64; 3], String> {
            let (dx, dy) = (dx * STEP / self.metres_per_unit, dy * STEP / self.metres_per_unit);
            let (ahead, behind) = (self.place(x + dx, y + dy, height)?, self.place(x - dx, y - dy, height)?);
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

/// Returns the place of the tileset that `transform`, which must have an inverse, maps to `place` in metres.
pub fn relative_place(transform: &[f64; 16], place: [f64; 3]) -> [f64; 3] {
    let transform = affine(transform);
    // Earth-centred places are far longer than their difference, so it is taken first.
    (transform.matrix3.inverse() * (DVec3::from(place) - transform.translation)).into()
}

fn affine(transform: &[f64; 16]) -> DAffine3 {
    DAffine3::from_mat4(DMat4::from_cols_array(transform))
}
