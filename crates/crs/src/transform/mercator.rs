//! Mercator's projection on the ellipsoid, and on the sphere as maps in browsers have it.

use crate::transform::ellipsoid::Ellipsoid;

/// No map goes nearer to a pole, in radians: 89.9 degrees.
const NORTHMOST: f64 = 1.569;

/// A Mercator projection without false origin.
#[derive(Clone, Debug)]
pub(crate) struct Mercator {
    /// That of the latitudes on the map.
    ellipsoid: Ellipsoid,
    /// Metres on the map for a radian of longitude.
    radius: f64,
}

impl Mercator {
    pub(crate) fn new(ellipsoid: Ellipsoid, scale: f64) -> Mercator {
        Mercator { ellipsoid, radius: ellipsoid.a * scale }
    }

    /// Returns the projection that takes latitudes on the ellipsoid for those on a sphere.
    pub(crate) fn web(ellipsoid: Ellipsoid) -> Mercator {
        Mercator { ellipsoid: ellipsoid.sphere(), radius: ellipsoid.a }
    }

    pub(crate) fn forward(&self, [longitude, latitude]: [f64; 2]) -> Option<[f64; 2]> {
        (latitude.abs() <= NORTHMOST)
            .then(|| [self.radius * longitude, self.radius * self.ellipsoid.isometric(latitude)])
    }

    pub(crate) fn inverse(&self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let place = [x / self.radius, self.ellipsoid.latitude_of_isometric(y / self.radius)];
        (place[1].abs() <= NORTHMOST + 1e-9).then_some(place)
    }
}
