//! Where a terrain in a projected coordinate system lies on the WGS 84 ellipsoid.

use glam::{DAffine3, DMat4};
use proj4rs::Proj;
use proj4rs::transform::transform;

/// Half axes of the WGS 84 ellipsoid: the greater in metres, and the square of its eccentricity.
const SEMI_MAJOR: f64 = 6_378_137.0;
const ECCENTRICITY_2: f64 = 0.006_694_379_990_141_317;

/// The way from a projected system to the ellipsoid.
pub struct Globe {
    from: Proj,
    to: Proj,
    /// Metres of one unit of x and y.
    metres: f64,
}

impl Globe {
    /// For the system that `definition` describes in the way of PROJ.4; a sentence where that cannot be done.
    pub fn new(definition: &str, metres_per_unit: f64) -> Result<Globe, String> {
        let parse = |text: &str| Proj::from_proj_string(text).map_err(|e| format!("{text}: {e}"));
        let from = parse(definition)?;
        if from.is_latlong() || from.is_geocent() {
            return Err("it is not a projected system".into());
        }
        Ok(Globe { from, to: parse("+proj=longlat +datum=WGS84 +no_defs")?, metres: metres_per_unit })
    }

    /// Earth-centred x, y, z in metres of the place at `x`, `y` (source units) `height` metres above the ellipsoid.
    pub fn place(&self, x: f64, y: f64, height: f64) -> Result<[f64; 3], String> {
        let [longitude, latitude] = self.geographic(x, y)?;
        let (sin, cos) = latitude.sin_cos();
        let normal = SEMI_MAJOR / (1.0 - ECCENTRICITY_2 * sin * sin).sqrt();
        let around = (normal + height) * cos;
        Ok([around * longitude.cos(), around * longitude.sin(), (normal * (1.0 - ECCENTRICITY_2) + height) * sin])
    }

    /// Longitude and latitude in radians.
    pub fn geographic(&self, x: f64, y: f64) -> Result<[f64; 2], String> {
        let mut point = (x, y, 0.0);
        transform(&self.from, &self.to, &mut point).map_err(|e| e.to_string())?;
        if point.0.is_finite() && point.1.is_finite() { Ok([point.0, point.1]) } else { Err("out of range".into()) }
    }

    /// The linear map, column by column as in 3D Tiles, of metres east, north and up from (`x`, `y`, `height`) to earth-centred
    /// ones that is exact to first order there.
    pub fn tangent(&self, x: f64, y: f64, height: f64) -> Result<[f64; 16], String> {
        let origin = self.place(x, y, height)?;
        // Differences over so far lose neither to rounding nor to the curvature.
        const STEP: f64 = 10.0;
        let along = |dx: f64, dy: f64| -> Result<[f64; 3], String> {
            let (dx, dy) = (dx * STEP / self.metres, dy * STEP / self.metres);
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

/// Where `transform` puts a place of the tileset, metres.
pub fn applied(transform: &[f64; 16], place: [f64; 3]) -> [f64; 3] {
    affine(transform).transform_point3(place.into()).into()
}

/// The transform that leads to where `inner` does when `outer` comes after it. `outer` must not be flat.
pub fn relative(outer: &[f64; 16], inner: &[f64; 16]) -> [f64; 16] {
    let (outer, inner) = (affine(outer), affine(inner));
    let back = outer.matrix3.inverse();
    // Earth-centred places differ by far less than they are long: the difference first.
    let translation = back * (inner.translation - outer.translation);
    DMat4::from(DAffine3 { matrix3: back * inner.matrix3, translation }).to_cols_array()
}

fn affine(transform: &[f64; 16]) -> DAffine3 {
    DAffine3::from_mat4(DMat4::from_cols_array(transform))
}
