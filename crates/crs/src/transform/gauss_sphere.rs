//! The conformal sphere of Gauss that touches an ellipsoid at a place (EPSG Guidance Note 7-2, methods 9809, 9812, 9815 and 9819). Oblique
//! projections of the ellipsoid are projections of this sphere.

use crate::transform::ellipsoid::{Ellipsoid, secant, sin_cos};

/// The conformal sphere.
#[derive(Clone, Debug)]
pub(crate) struct GaussSphere {
    ellipsoid: Ellipsoid,
    /// Longitudes on the sphere for those on the ellipsoid.
    stretch: f64,
    /// What is added to isometric latitudes on the sphere.
    shift: f64,
    /// The sine and the cosine of the latitude, on the sphere, of the place where it touches.
    pub(crate) origin: [f64; 2],
    /// In metres.
    pub(crate) radius: f64,
}

impl GaussSphere {
    /// Returns the sphere that touches at a latitude; `None` if that is a pole.
    pub(crate) fn new(ellipsoid: Ellipsoid, latitude: f64) -> Option<GaussSphere> {
        let ([sin, cos], e2) = (sin_cos(latitude), ellipsoid.e2);
        let stretch = (1.0 + e2 * (cos * cos) * (cos * cos) / (1.0 - e2)).sqrt();
        let radius = ellipsoid.a * (1.0 - e2).sqrt() / (1.0 - e2 * sin * sin);
        let on_sphere = sin / stretch;
        let shift = libm::atanh(on_sphere) - stretch * ellipsoid.isometric(latitude);
        let origin = [on_sphere, ((1.0 - on_sphere) * (1.0 + on_sphere)).sqrt()];
        let is_place = cos > 1e-6 && shift.is_finite();
        is_place.then_some(GaussSphere { ellipsoid, stretch, shift, origin, radius })
    }

    /// Returns the sine and the cosine of a place's latitude on the sphere, and those of its longitude.
    pub(crate) fn angles(&self, [longitude, latitude]: [f64; 2]) -> [[f64; 2]; 2] {
        let tangent = libm::sinh(self.stretch * self.ellipsoid.isometric(latitude) + self.shift);
        let cos = 1.0 / secant(tangent);
        [[tangent * cos, cos], sin_cos(self.stretch * longitude)]
    }

    /// Returns a place on the unit sphere, seen from the place of the central meridian whose latitude has this sine and cosine: how far
    /// in its direction, to its east and to its north.
    pub(crate) fn seen_from(&self, [sin_0, cos_0]: [f64; 2], place: [f64; 2]) -> [f64; 3] {
        let [[sin, cos], [east, ahead]] = self.angles(place);
        [sin * sin_0 + cos * cos_0 * ahead, cos * east, sin * cos_0 - cos * sin_0 * ahead]
    }

    /// Returns the longitude and latitude of what [`GaussSphere::seen_from`] returns.
    pub(crate) fn place(&self, [sin_0, cos_0]: [f64; 2], [ahead, east, north]: [f64; 3]) -> [f64; 2] {
        let (sin, outward) = (ahead * sin_0 + north * cos_0, ahead * cos_0 - north * sin_0);
        let isometric = (libm::asinh(sin / libm::hypot(east, outward)) - self.shift) / self.stretch;
        [libm::atan2(east, outward) / self.stretch, self.ellipsoid.latitude_of_isometric(isometric)]
    }
}
