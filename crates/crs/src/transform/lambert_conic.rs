//! Lambert's conformal conic projection, with one or two standard parallels.

use crate::transform::ellipsoid::{Ellipsoid, sin_cos};

/// A conformal conic projection without false origin.
#[derive(Clone, Debug)]
pub(crate) struct LambertConic {
    ellipsoid: Ellipsoid,
    /// How far the cone turns for a radian of longitude; below 0 for a cone over the south.
    turn: f64,
    /// The isometric latitude of the first parallel, and its distance from the tip of the cone on the map.
    first: [f64; 2],
    /// The distance of the origin from the tip.
    origin: f64,
}

impl LambertConic {
    /// Returns the projection with these standard parallels; `None` if they make no cone.
    pub(crate) fn new(ellipsoid: Ellipsoid, latitude: f64, parallels: [f64; 2], scale: f64) -> Option<LambertConic> {
        let [radius, other_radius] = parallels.map(|parallel| ellipsoid.parallel(sin_cos(parallel)));
        let [isometric, other] = parallels.map(|parallel| ellipsoid.isometric(parallel));
        let turn = if (parallels[0] - parallels[1]).abs() < 1e-10 {
            libm::sin(parallels[0])
        } else {
            libm::log(radius / other_radius) / (other - isometric)
        };
        if !turn.is_finite() || turn.abs() < 1e-8 || radius < 1e-8 {
            return None;
        }
        let first = [isometric, ellipsoid.a * scale * radius / turn];
        let mut cone = LambertConic { ellipsoid, turn, first, origin: 0.0 };
        cone.origin = cone.distance(latitude);
        cone.origin.is_finite().then_some(cone)
    }

    /// Returns the distance of a latitude from the tip of the cone; below 0 for a cone over the south.
    fn distance(&self, latitude: f64) -> f64 {
        self.first[1] * libm::exp(self.turn * (self.first[0] - self.ellipsoid.isometric(latitude)))
    }

    pub(crate) fn forward(&self, [longitude, latitude]: [f64; 2]) -> Option<[f64; 2]> {
        let distance = self.distance(latitude);
        let [sin, cos] = sin_cos(self.turn * longitude);
        Some([distance * sin, self.origin - distance * cos])
    }

    pub(crate) fn inverse(&self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let sign = if self.turn < 0.0 { -1.0 } else { 1.0 };
        let (east, south) = (sign * x, sign * (self.origin - y));
        let distance = sign * libm::hypot(east, south);
        let isometric = self.first[0] - libm::log(distance / self.first[1]) / self.turn;
        let longitude = libm::atan2(east, south) / self.turn;
        // The map has a gap behind the cone.
        (longitude.abs() <= std::f64::consts::PI).then(|| [longitude, self.ellipsoid.latitude_of_isometric(isometric)])
    }
}
