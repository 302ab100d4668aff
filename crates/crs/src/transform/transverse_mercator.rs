//! The transverse Mercator projection by Krueger's series to the sixth order (Karney, "Transverse Mercator with an accuracy of a few
//! nanometers", 2011): nanometres up to some thousand kilometres from the central meridian.

use crate::transform::ellipsoid::{Ellipsoid, coefficients, secant, sin_cos};

/// The farthest from the central meridian that is projected, in radii of the earth on the map: 45 degrees of arc.
const FARTHEST: f64 = 0.8814;

/// The farthest along the central meridian from the equator, in radians of the map: 45 degrees of arc beyond a pole.
const NORTHMOST: f64 = 0.75 * std::f64::consts::PI;

/// The polynomials in n of the coefficients from the sphere to the map, from the least power of n that they have.
const FORWARD: [&[f64]; 6] = [
    &[1.0 / 2.0, -2.0 / 3.0, 5.0 / 16.0, 41.0 / 180.0, -127.0 / 288.0, 7891.0 / 37800.0],
    &[13.0 / 48.0, -3.0 / 5.0, 557.0 / 1440.0, 281.0 / 630.0, -1983433.0 / 1935360.0],
    &[61.0 / 240.0, -103.0 / 140.0, 15061.0 / 26880.0, 167603.0 / 181440.0],
    &[49561.0 / 161280.0, -179.0 / 168.0, 6601661.0 / 7257600.0],
    &[34729.0 / 80640.0, -3418889.0 / 1995840.0],
    &[212378941.0 / 319334400.0],
];

/// Those of the way back.
const BACK: [&[f64]; 6] = [
    &[1.0 / 2.0, -2.0 / 3.0, 37.0 / 96.0, -1.0 / 360.0, -81.0 / 512.0, 96199.0 / 604800.0],
    &[1.0 / 48.0, 1.0 / 15.0, -437.0 / 1440.0, 46.0 / 105.0, -1118711.0 / 3870720.0],
    &[17.0 / 480.0, -37.0 / 840.0, -209.0 / 4480.0, 5569.0 / 90720.0],
    &[4397.0 / 161280.0, -11.0 / 504.0, -830251.0 / 7257600.0],
    &[4583.0 / 161280.0, -108847.0 / 3991680.0],
    &[20648693.0 / 638668800.0],
];

/// A transverse Mercator projection without false origin.
#[derive(Clone, Debug)]
pub(crate) struct TransverseMercator {
    ellipsoid: Ellipsoid,
    /// Metres on the map for a radian of the meridian.
    radius: f64,
    forward: [f64; 6],
    back: [f64; 6],
    /// Where the latitude of the origin lies on the meridian, in radians of the map.
    origin: f64,
}

impl TransverseMercator {
    pub(crate) fn new(ellipsoid: Ellipsoid, latitude: f64, scale: f64) -> TransverseMercator {
        let n = ellipsoid.n;
        let n2 = n * n;
        let radius = ellipsoid.a / (1.0 + n) * (1.0 + n2 * (1.0 / 4.0 + n2 * (1.0 / 64.0 + n2 / 256.0)));
        let mut projection = TransverseMercator {
            ellipsoid,
            radius: radius * scale,
            forward: coefficients(&FORWARD, n),
            back: coefficients(&BACK, n).map(|c| -c),
            origin: 0.0,
        };
        let sphere = libm::atan(ellipsoid.conformal(libm::tan(latitude)));
        projection.origin = add_series(&projection.forward, [sphere, 0.0])[0];
        projection
    }

    /// Returns x and y in metres of a place east of the central meridian.
    pub(crate) fn forward(&self, [longitude, latitude]: [f64; 2]) -> Option<[f64; 2]> {
        let conformal = self.ellipsoid.conformal(libm::tan(latitude));
        let [sin, cos] = sin_cos(longitude);
        let sphere = [libm::atan2(conformal, cos), libm::asinh(sin / (conformal * conformal + cos * cos).sqrt())];
        if sphere[1].abs() > FARTHEST || sphere[0].abs() > NORTHMOST {
            return None;
        }
        let [north, east] = add_series(&self.forward, sphere);
        Some([self.radius * east, self.radius * (north - self.origin)])
    }

    /// Returns the longitude from the central meridian and the latitude of a place on the map.
    pub(crate) fn inverse(&self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let map = [y / self.radius + self.origin, x / self.radius];
        if map[1].abs() > FARTHEST * 1.01 || map[0].abs() > NORTHMOST * 1.01 {
            return None;
        }
        let [north, east] = add_series(&self.back, map);
        let (sinh, [sin, cos]) = (libm::sinh(east), sin_cos(north));
        let conformal = sin / (sinh * sinh + cos * cos).sqrt();
        Some([libm::atan2(sinh, cos), self.ellipsoid.latitude_of_conformal(conformal)])
    }
}

/// Returns `[u, v]` with the series c[k] sin(2 (k + 1) (u + iv)) added, by Clenshaw's rule.
fn add_series(c: &[f64; 6], [u, v]: [f64; 2]) -> [f64; 2] {
    let ([sin, cos], sinh) = (sin_cos(2.0 * u), libm::sinh(2.0 * v));
    let cosh = secant(sinh);
    // Twice the complex cosine of 2 (u + iv).
    let (re, im) = (2.0 * cos * cosh, -2.0 * sin * sinh);
    let (mut one, mut two) = ([0.0; 2], [0.0; 2]);
    for c in c.iter().rev() {
        let next = [re * one[0] - im * one[1] - two[0] + c, re * one[1] + im * one[0] - two[1]];
        (two, one) = (one, next);
    }
    // Times the complex sine.
    let (s, t) = (sin * cosh, cos * sinh);
    [u + s * one[0] - t * one[1], v + s * one[1] + t * one[0]]
}
