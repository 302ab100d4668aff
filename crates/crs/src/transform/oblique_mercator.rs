//! The oblique Mercator projection: Hotine's with its variants A and B (EPSG methods 9812 and 9815), and that of Switzerland and Hungary,
//! which is variant B with a line to the east. All of them are Mercator's projection of the conformal sphere, around the great circle along
//! the initial line.

use crate::transform::ellipsoid::{Ellipsoid, sin_cos};
use crate::transform::gauss_sphere::GaussSphere;
use std::f64::consts::FRAC_PI_2;

/// The farthest from the initial line that is projected: 45 degrees of arc, and that in radii of the sphere on the map.
const FARTHEST: [f64; 2] = [0.707_2, 0.881_5];

/// An oblique Mercator projection without false origin.
#[derive(Clone, Debug)]
pub(crate) struct ObliqueMercator {
    sphere: GaussSphere,
    /// The sine and the cosine of the azimuth of the initial line in the centre.
    line: [f64; 2],
    /// Those of the angle from the rectified to the skew grid.
    grid: [f64; 2],
    /// The radius of the sphere, times the scale.
    radius: f64,
    /// Metres along the initial line from the origin of the grid to the centre.
    centre: f64,
}

impl ObliqueMercator {
    /// Returns variant B, whose grid counts from the centre, with this azimuth of the initial line and this angle from the rectified to the
    /// skew grid. Returns `None` if the line does not lead to the north, or straight to the east: programs do not agree what such a line is.
    pub(crate) fn around_centre(
        ellipsoid: Ellipsoid,
        latitude: f64,
        [azimuth, angle]: [f64; 2],
        scale: f64,
    ) -> Option<ObliqueMercator> {
        let sphere = GaussSphere::new(ellipsoid, latitude)?;
        let (line, grid, radius) = (sin_cos(azimuth), sin_cos(angle), sphere.radius * scale);
        (line[1] >= -1e-9).then_some(ObliqueMercator { sphere, line, grid, radius, centre: 0.0 })
    }

    /// Returns variant A, whose grid counts from where the initial line crosses the equator of the sphere. Returns `None` if the line is
    /// none of variant B, or if it leads to the east, where it may not cross the equator.
    pub(crate) fn around_crossing(
        ellipsoid: Ellipsoid,
        latitude: f64,
        angles: [f64; 2],
        scale: f64,
    ) -> Option<ObliqueMercator> {
        let mut projection = ObliqueMercator::around_centre(ellipsoid, latitude, angles, scale)?;
        let [sin, cos] = projection.sphere.origin;
        projection.centre = projection.radius * libm::atan2(sin, cos * projection.line[1]);
        (projection.line[1] > 1e-6).then_some(projection)
    }

    pub(crate) fn forward(&self, place: [f64; 2]) -> Option<[f64; 2]> {
        let [ahead, east, north] = self.sphere.seen_from(self.sphere.origin, place);
        let ([sin, cos], [grid_sin, grid_cos]) = (self.line, self.grid);
        let (along, across) = (east * sin + north * cos, east * cos - north * sin);
        // The half of the earth around the centre.
        if ahead < 0.0 || across.abs() > FARTHEST[0] {
            return None;
        }
        let u = self.radius * libm::atan2(along, ahead) + self.centre;
        let v = self.radius * libm::atanh(across);
        Some([v * grid_cos + u * grid_sin, u * grid_cos - v * grid_sin])
    }

    pub(crate) fn inverse(&self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let ([sin, cos], [grid_sin, grid_cos]) = (self.line, self.grid);
        let u = (y * grid_cos + x * grid_sin - self.centre) / self.radius;
        let v = (x * grid_cos - y * grid_sin) / self.radius;
        if u.abs() > FRAC_PI_2 * 1.000_001 || v.abs() > FARTHEST[1] {
            return None;
        }
        let (across, shrink, [along, ahead]) = (libm::tanh(v), 1.0 / libm::cosh(v), sin_cos(u));
        let along = along * shrink;
        let seen = [ahead * shrink, along * sin + across * cos, along * cos - across * sin];
        Some(self.sphere.place(self.sphere.origin, seen))
    }
}
