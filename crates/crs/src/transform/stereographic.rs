//! Stereographic projections: around a pole, and around any place by way of the conformal sphere.

use crate::transform::ellipsoid::{Ellipsoid, sin_cos};
use crate::transform::gauss_sphere::GaussSphere;

/// A polar stereographic projection without false origin.
#[derive(Clone, Debug)]
pub(crate) struct PolarStereographic {
    ellipsoid: Ellipsoid,
    /// 1 for the north pole, -1 for the south pole.
    side: f64,
    /// The distance of the equator from the pole on the map.
    radius: f64,
}

impl PolarStereographic {
    /// Returns the projection around a pole with this scale there.
    pub(crate) fn with_scale(ellipsoid: Ellipsoid, side: f64, scale: f64) -> PolarStereographic {
        let e = ellipsoid.e;
        let shape = libm::exp(((1.0 + e) * libm::log1p(e) + (1.0 - e) * libm::log1p(-e)) / 2.0);
        PolarStereographic { ellipsoid, side, radius: 2.0 * ellipsoid.a * scale / shape }
    }

    /// Returns the projection that is true to scale at a parallel, around the pole that is nearer to it.
    pub(crate) fn with_parallel(ellipsoid: Ellipsoid, parallel: f64, scale: f64) -> PolarStereographic {
        let side = if parallel < 0.0 { -1.0 } else { 1.0 };
        let around = ellipsoid.a * scale * ellipsoid.parallel(sin_cos(parallel.abs()));
        PolarStereographic { ellipsoid, side, radius: around * libm::exp(ellipsoid.isometric(parallel.abs())) }
    }

    pub(crate) fn forward(&self, [longitude, latitude]: [f64; 2]) -> Option<[f64; 2]> {
        let latitude = latitude * self.side;
        let distance = self.radius * libm::exp(-self.ellipsoid.isometric(latitude));
        let [sin, cos] = sin_cos(longitude);
        (latitude >= 0.0).then(|| [distance * sin, -self.side * distance * cos])
    }

    pub(crate) fn inverse(&self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let distance = libm::hypot(x, y);
        if distance > self.radius * 1.000_001 {
            return None;
        }
        if distance == 0.0 {
            return Some([0.0, self.side * std::f64::consts::FRAC_PI_2]);
        }
        let latitude = self.ellipsoid.latitude_of_isometric(-libm::log(distance / self.radius));
        Some([libm::atan2(x, -self.side * y), self.side * latitude])
    }
}

/// The oblique stereographic projection as a double one (EPSG method 9809), without false origin.
#[derive(Clone, Debug)]
pub(crate) struct ObliqueStereographic {
    sphere: GaussSphere,
    /// Twice the radius of the sphere, times the scale.
    diameter: f64,
}

impl ObliqueStereographic {
    /// Returns the projection around a place; `None` if that is a pole.
    pub(crate) fn new(ellipsoid: Ellipsoid, latitude: f64, scale: f64) -> Option<ObliqueStereographic> {
        let sphere = GaussSphere::new(ellipsoid, latitude)?;
        let diameter = 2.0 * sphere.radius * scale;
        Some(ObliqueStereographic { sphere, diameter })
    }

    pub(crate) fn forward(&self, place: [f64; 2]) -> Option<[f64; 2]> {
        let ([[sin, cos], [east, ahead]], [sin_0, cos_0]) = (self.sphere.angles(place), self.sphere.origin);
        let facing = sin * sin_0 + cos * cos_0 * ahead;
        let scale = self.diameter / (1.0 + facing);
        // The half of the earth around the origin.
        (facing >= 0.0).then_some([scale * cos * east, scale * (sin * cos_0 - cos * sin_0 * ahead)])
    }

    pub(crate) fn inverse(&self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let (u, v) = (x / self.diameter, y / self.diameter);
        let square = u * u + v * v;
        if square > 1.000_001 {
            return None;
        }
        // The place on the unit sphere, seen from the origin.
        let ahead = (1.0 - square) / (1.0 + square);
        let [east, north] = [u, v].map(|value| 2.0 * value / (1.0 + square));
        Some(self.sphere.place(self.sphere.origin, [ahead, east, north]))
    }
}
