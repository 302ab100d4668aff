//! Krovak's projection with axes to the east and north (EPSG method 1041): Lambert's conformal cone on the conformal sphere, around a pole
//! of its own.

use crate::transform::ellipsoid::{Ellipsoid, sin_cos};
use crate::transform::gauss_sphere::GaussSphere;
use std::f64::consts::PI;

/// How far the axis of the cone leans, in degrees: a constant of the method.
const COLATITUDE: f64 = 30.0 + 17.0 / 60.0 + 17.303_11 / 3600.0;

/// The parallel of the cone, in degrees around its axis: likewise.
const PARALLEL: f64 = 78.5;

/// Krovak's projection.
#[derive(Clone, Debug)]
pub(crate) struct Krovak {
    sphere: GaussSphere,
    /// The sine and the cosine of the latitude of the cone's axis.
    axis: [f64; 2],
    /// How far the cone turns for a radian around its axis.
    turn: f64,
    /// The isometric latitude of the parallel around the axis, and its distance from the tip of the cone on the map.
    parallel: [f64; 2],
}

impl Krovak {
    /// Returns the projection; `None` if the origin is at a pole.
    pub(crate) fn new(ellipsoid: Ellipsoid, latitude: f64, scale: f64) -> Option<Krovak> {
        let sphere = GaussSphere::new(ellipsoid, latitude)?;
        let ([cos_axis, sin_axis], [sin, cos]) = (
            [COLATITUDE, 90.0 - COLATITUDE].map(|angle| libm::sin(angle.to_radians())),
            sin_cos(PARALLEL.to_radians()),
        );
        let parallel = [libm::atanh(sin), sphere.radius * scale * cos / sin];
        Some(Krovak { sphere, axis: [sin_axis, cos_axis], turn: sin, parallel })
    }

    pub(crate) fn forward(&self, place: [f64; 2]) -> Option<[f64; 2]> {
        let [ahead, east, north] = self.sphere.seen_from(self.axis, place);
        let isometric = libm::asinh(ahead / libm::hypot(east, north));
        let distance = self.parallel[1] * libm::exp(self.turn * (self.parallel[0] - isometric));
        let [west, south] = sin_cos(self.turn * libm::atan2(-east, -north));
        // The half of the earth around the axis.
        (ahead >= 0.0).then_some([-distance * west, -distance * south])
    }

    pub(crate) fn inverse(&self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let distance = libm::hypot(x, y);
        let isometric = self.parallel[0] - libm::log(distance / self.parallel[1]) / self.turn;
        let around = libm::atan2(-x, -y) / self.turn;
        // The map has a gap behind the cone.
        if around.abs() > PI * 1.000_001 || isometric < -1e-6 {
            return None;
        }
        let (shrink, [west, south]) = (1.0 / libm::cosh(isometric), sin_cos(around));
        Some(self.sphere.place(self.axis, [libm::tanh(isometric), -shrink * west, -shrink * south]))
    }
}
