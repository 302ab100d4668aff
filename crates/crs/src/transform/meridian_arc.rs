//! Projections whose central meridian is true to scale: that of Cassini and Soldner (EPSG method 9806), and the American polyconic one
//! (EPSG method 9818). Their inverses are found by Newton's method, so that they lead back to the same place.

use crate::transform::ellipsoid::{Ellipsoid, sin_cos};
use crate::transform::transverse_mercator::TransverseMercator;

/// No map goes nearer to a pole, in radians: 85.9 degrees.
const NORTHMOST: f64 = 1.5;

/// The farthest from the central meridian that is projected, in radians: 10 degrees of arc, and 30 degrees of longitude.
const FARTHEST: [f64; 2] = [0.1746, 0.5237];

/// The most rounds of Newton's method. It needs three to five.
const ROUNDS: usize = 12;

/// Half the distance in radians over which the slopes are taken.
const STEP: f64 = 1e-5;

/// The projection of Cassini and Soldner, by their series, without false origin.
#[derive(Clone, Debug)]
pub(crate) struct Cassini {
    ellipsoid: Ellipsoid,
    meridian: TransverseMercator,
}

impl Cassini {
    pub(crate) fn new(ellipsoid: Ellipsoid, latitude: f64) -> Cassini {
        Cassini { ellipsoid, meridian: TransverseMercator::new(ellipsoid, latitude, 1.0) }
    }

    pub(crate) fn forward(&self, place: [f64; 2]) -> Option<[f64; 2]> {
        self.shows(place).then(|| self.map(place))?
    }

    pub(crate) fn inverse(&self, map: [f64; 2]) -> Option<[f64; 2]> {
        let [_, latitude] = self.meridian.inverse([0.0, map[1]])?;
        let start = [map[0] / (self.ellipsoid.a * libm::cos(latitude)), latitude];
        place_of(|place| self.map(place), start, map).filter(|place| self.shows(*place))
    }

    fn shows(&self, [longitude, latitude]: [f64; 2]) -> bool {
        latitude.abs() <= NORTHMOST && (longitude * libm::cos(latitude)).abs() <= FARTHEST[0]
    }

    fn map(&self, [longitude, latitude]: [f64; 2]) -> Option<[f64; 2]> {
        let ([sin, cos], e2) = (sin_cos(latitude), self.ellipsoid.e2);
        let (across, tangent) = (longitude * cos, sin / cos);
        let (t, c, square) = (tangent * tangent, e2 * cos * cos / (1.0 - e2), across * across);
        let normal = self.ellipsoid.a / (1.0 - e2 * sin * sin).sqrt();
        let east = across * (1.0 - square * t * (1.0 / 6.0 + (8.0 - t + 8.0 * c) * square / 120.0));
        let north = tangent * square * (0.5 + (5.0 - t + 6.0 * c) * square / 24.0);
        let [_, arc] = self.meridian.forward([0.0, latitude])?;
        Some([normal * east, arc + normal * north])
    }
}

/// The American polyconic projection without false origin.
#[derive(Clone, Debug)]
pub(crate) struct Polyconic {
    ellipsoid: Ellipsoid,
    meridian: TransverseMercator,
}

impl Polyconic {
    pub(crate) fn new(ellipsoid: Ellipsoid, latitude: f64) -> Polyconic {
        Polyconic { ellipsoid, meridian: TransverseMercator::new(ellipsoid, latitude, 1.0) }
    }

    pub(crate) fn forward(&self, place: [f64; 2]) -> Option<[f64; 2]> {
        self.shows(place).then(|| self.map(place))?
    }

    pub(crate) fn inverse(&self, map: [f64; 2]) -> Option<[f64; 2]> {
        let [_, latitude] = self.meridian.inverse([0.0, map[1]])?;
        let [sin, cos] = sin_cos(latitude);
        let longitude = map[0] / (self.ellipsoid.a * cos);
        // The parallels bend to the poles: the place is nearer to the equator than the map is.
        let start = [longitude, latitude - longitude * longitude * sin * cos / 2.0];
        place_of(|place| self.map(place), start, map).filter(|place| self.shows(*place))
    }

    fn shows(&self, [longitude, latitude]: [f64; 2]) -> bool {
        latitude.abs() <= NORTHMOST && longitude.abs() <= FARTHEST[1]
    }

    fn map(&self, [longitude, latitude]: [f64; 2]) -> Option<[f64; 2]> {
        let [sin, cos] = sin_cos(latitude);
        let [_, arc] = self.meridian.forward([0.0, latitude])?;
        // At the equator the cone is a cylinder.
        if sin == 0.0 {
            return Some([self.ellipsoid.a * longitude, arc]);
        }
        let distance = self.ellipsoid.a * cos / (sin * (1.0 - self.ellipsoid.e2 * sin * sin).sqrt());
        let half = libm::sin(longitude * sin / 2.0);
        Some([distance * libm::sin(longitude * sin), arc + 2.0 * distance * half * half])
    }
}

/// Returns the place that `forward` maps to `map`, by Newton's method from a place near it; `None` if there is none.
fn place_of(forward: impl Fn([f64; 2]) -> Option<[f64; 2]>, start: [f64; 2], map: [f64; 2]) -> Option<[f64; 2]> {
    let mut place = start;
    for _ in 0..ROUNDS {
        let at = |east: f64, north: f64| forward([place[0] + east * STEP, place[1] + north * STEP]);
        let slope = |ahead: [f64; 2], behind: [f64; 2]| [0, 1].map(|k| (ahead[k] - behind[k]) / (2.0 * STEP));
        let (found, east, north) =
            (forward(place)?, slope(at(1.0, 0.0)?, at(-1.0, 0.0)?), slope(at(0.0, 1.0)?, at(0.0, -1.0)?));
        let off = [map[0] - found[0], map[1] - found[1]];
        let area = east[0] * north[1] - east[1] * north[0];
        let step = [(off[0] * north[1] - off[1] * north[0]) / area, (east[0] * off[1] - east[1] * off[0]) / area];
        place = [place[0] + step[0], place[1] + step[1]];
        if step[0].abs().max(step[1].abs()) <= 1e-15 {
            break;
        }
    }
    // A thousandth of a millimetre.
    let found = forward(place)?;
    (libm::hypot(map[0] - found[0], map[1] - found[1]) < 1e-6).then_some(place)
}
