//! Projections of equal area: Albers' conic, and Lambert's azimuthal and cylindrical ones.

use crate::transform::ellipsoid::{Ellipsoid, sin_cos};

/// Albers' conic projection without false origin.
#[derive(Clone, Debug)]
pub(crate) struct Albers {
    ellipsoid: Ellipsoid,
    turn: f64,
    /// The square of the distance from the tip, where q is 0, over the square of the greater half axis, times the square of `turn`.
    whole: f64,
    origin: f64,
}

impl Albers {
    /// Returns the projection with these standard parallels; `None` if they make no cone.
    pub(crate) fn new(ellipsoid: Ellipsoid, latitude: f64, parallels: [f64; 2]) -> Option<Albers> {
        let [first, second] = parallels.map(sin_cos);
        let [m1, m2] = [first, second].map(|parallel| ellipsoid.parallel(parallel));
        let [q1, q2] = [first, second].map(|[sin, _]| ellipsoid.authalic(sin));
        let is_one = (parallels[0] - parallels[1]).abs() < 1e-10;
        let turn = if is_one { first[0] } else { (m1 * m1 - m2 * m2) / (q2 - q1) };
        if !turn.is_finite() || turn.abs() < 1e-8 {
            return None;
        }
        let mut cone = Albers { ellipsoid, turn, whole: m1 * m1 + turn * q1, origin: 0.0 };
        cone.origin = cone.distance(latitude)?;
        Some(cone)
    }

    fn distance(&self, latitude: f64) -> Option<f64> {
        let left = self.whole - self.turn * self.ellipsoid.authalic(libm::sin(latitude));
        (left >= 0.0).then(|| self.ellipsoid.a * left.sqrt() / self.turn)
    }

    pub(crate) fn forward(&self, [longitude, latitude]: [f64; 2]) -> Option<[f64; 2]> {
        let distance = self.distance(latitude)?;
        let [sin, cos] = sin_cos(self.turn * longitude);
        Some([distance * sin, self.origin - distance * cos])
    }

    pub(crate) fn inverse(&self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let sign = if self.turn < 0.0 { -1.0 } else { 1.0 };
        let (east, south) = (sign * x, sign * (self.origin - y));
        let distance = libm::hypot(east, south) * self.turn / self.ellipsoid.a;
        let latitude = self.ellipsoid.latitude_of_authalic((self.whole - distance * distance) / self.turn)?;
        let longitude = libm::atan2(east, south) / self.turn;
        (longitude.abs() <= std::f64::consts::PI).then_some([longitude, latitude])
    }
}

/// Lambert's azimuthal projection without false origin.
#[derive(Clone, Debug)]
pub(crate) struct LambertAzimuthal {
    ellipsoid: Ellipsoid,
    /// q at the pole.
    pole: f64,
    /// The sine and the cosine of the authalic latitude of the origin.
    origin: [f64; 2],
    /// The radius of the sphere of equal area.
    radius: f64,
    /// What makes the map true to scale along both axes at the origin.
    stretch: f64,
}

impl LambertAzimuthal {
    pub(crate) fn new(ellipsoid: Ellipsoid, latitude: f64) -> LambertAzimuthal {
        let (pole, place) = (ellipsoid.authalic(1.0), sin_cos(latitude));
        let radius = ellipsoid.a * (pole / 2.0).sqrt();
        let sin = (ellipsoid.authalic(place[0]) / pole).clamp(-1.0, 1.0);
        let mut origin = [sin, ((1.0 - sin) * (1.0 + sin)).sqrt()];
        let mut stretch = ellipsoid.a * ellipsoid.parallel(place) / (radius * origin[1]);
        // At the pole both the parallel and the cosine are 0.
        if place[1] < 1e-9 {
            origin = [if sin < 0.0 { -1.0 } else { 1.0 }, 0.0];
            stretch = 1.0;
        }
        LambertAzimuthal { ellipsoid, pole, origin, radius, stretch }
    }

    pub(crate) fn forward(&self, [longitude, latitude]: [f64; 2]) -> Option<[f64; 2]> {
        let sin = (self.ellipsoid.authalic(libm::sin(latitude)) / self.pole).clamp(-1.0, 1.0);
        let cos = ((1.0 - sin) * (1.0 + sin)).sqrt();
        let ([east, ahead], [sin_0, cos_0]) = (sin_cos(longitude), self.origin);
        let facing = 1.0 + sin_0 * sin + cos_0 * cos * ahead;
        // Nothing beyond 150 degrees of arc: the other side of the earth has no place.
        if facing < 0.13 {
            return None;
        }
        let scale = self.radius * (2.0 / facing).sqrt();
        Some([scale * self.stretch * cos * east, scale / self.stretch * (cos_0 * sin - sin_0 * cos * ahead)])
    }

    pub(crate) fn inverse(&self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let (u, v) = (x / self.stretch / self.radius, y * self.stretch / self.radius);
        let square = u * u + v * v;
        if square > 3.75 {
            return None;
        }
        // The place on the unit sphere, seen from the origin.
        let (ahead, shrink) = (1.0 - square / 2.0, (1.0 - square / 4.0).sqrt());
        let (east, north, [sin_0, cos_0]) = (u * shrink, v * shrink, self.origin);
        let sin = ahead * sin_0 + north * cos_0;
        let latitude = self.ellipsoid.latitude_of_authalic(sin * self.pole)?;
        Some([libm::atan2(east, ahead * cos_0 - north * sin_0), latitude])
    }
}

/// Lambert's cylindrical projection (EPSG method 9835) without false origin.
#[derive(Clone, Debug)]
pub(crate) struct LambertCylindrical {
    ellipsoid: Ellipsoid,
    /// Metres on the map for a radian of longitude, and for q.
    size: [f64; 2],
}

impl LambertCylindrical {
    /// Returns the projection that is true to scale at a parallel; `None` if that is a pole.
    pub(crate) fn new(ellipsoid: Ellipsoid, parallel: f64) -> Option<LambertCylindrical> {
        let scale = ellipsoid.parallel(sin_cos(parallel));
        (scale > 1e-6)
            .then(|| LambertCylindrical { ellipsoid, size: [ellipsoid.a * scale, ellipsoid.a / (2.0 * scale)] })
    }

    pub(crate) fn forward(&self, [longitude, latitude]: [f64; 2]) -> Option<[f64; 2]> {
        Some([self.size[0] * longitude, self.size[1] * self.ellipsoid.authalic(libm::sin(latitude))])
    }

    pub(crate) fn inverse(&self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        Some([x / self.size[0], self.ellipsoid.latitude_of_authalic(y / self.size[1])?])
    }
}
