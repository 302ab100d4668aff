//! An ellipsoid, and the latitudes on it that projections count with.
//!
//! All sines, logarithms and the like of this folder are those of the crate `libm`: they give the same bits on every machine.

/// The most rounds of Newton's method. It needs three or four; near a pole the last digits may go to and fro.
const ROUNDS: usize = 12;

/// The series from the conformal latitude to the geographic one is as good as floating point up to this third flattening. That of the
/// earth is 0.0017.
const FLAT_ENOUGH: f64 = 0.002;

/// The polynomials in n of the coefficients of that series, from the least power of n that they have.
const FROM_CONFORMAL: [&[f64]; 6] = [
    &[2.0, -2.0 / 3.0, -2.0, 116.0 / 45.0, 26.0 / 45.0, -2854.0 / 675.0],
    &[7.0 / 3.0, -8.0 / 5.0, -227.0 / 45.0, 2704.0 / 315.0, 2323.0 / 945.0],
    &[56.0 / 15.0, -136.0 / 35.0, -1262.0 / 105.0, 73814.0 / 2835.0],
    &[4279.0 / 630.0, -332.0 / 35.0, -399572.0 / 14175.0],
    &[4174.0 / 315.0, -144838.0 / 6237.0],
    &[601676.0 / 22275.0],
];

/// The half axes of the ellipsoid of WGS 84 in metres.
pub(crate) const WGS84: [f64; 2] = [6_378_137.0, 6_356_752.314_245_179];

/// An ellipsoid of revolution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ellipsoid {
    /// The greater half axis in metres.
    pub(crate) a: f64,
    /// The eccentricity.
    pub(crate) e: f64,
    /// Its square.
    pub(crate) e2: f64,
    /// The third flattening: (a - b) / (a + b).
    pub(crate) n: f64,
    /// The coefficients of the series from the conformal latitude.
    from_conformal: [f64; 6],
}

impl Ellipsoid {
    /// Returns the ellipsoid with these half axes; `None` if the second is not the lesser one.
    pub(crate) fn of([a, b]: [f64; 2]) -> Option<Ellipsoid> {
        let (e2, n) = ((a - b) * (a + b) / (a * a), (a - b) / (a + b));
        let from_conformal = coefficients(&FROM_CONFORMAL, n);
        (b > 0.0 && a >= b && a.is_finite()).then(|| Ellipsoid { a, e: e2.sqrt(), e2, n, from_conformal })
    }

    /// Returns the sphere with the greater half axis.
    pub(crate) fn sphere(&self) -> Ellipsoid {
        Ellipsoid { a: self.a, e: 0.0, e2: 0.0, n: 0.0, from_conformal: [0.0; 6] }
    }

    /// Returns the radius of the parallel at a latitude with this sine and cosine, over the greater half axis.
    pub(crate) fn parallel(&self, [sin, cos]: [f64; 2]) -> f64 {
        cos / (1.0 - self.e2 * sin * sin).sqrt()
    }

    /// Returns the tangent of the conformal latitude to that of a latitude.
    pub(crate) fn conformal(&self, tangent: f64) -> f64 {
        let secant = secant(tangent);
        let shift = libm::sinh(self.e * libm::atanh(self.e * tangent / secant));
        (1.0 + shift * shift).sqrt() * tangent - shift * secant
    }

    /// Returns the latitude in radians to the tangent of a conformal latitude.
    pub(crate) fn latitude_of_conformal(&self, conformal: f64) -> f64 {
        if self.n > FLAT_ENOUGH {
            return libm::atan(self.tangent_of_conformal(conformal));
        }
        // The sine and the cosine of twice the angle. Near a pole the square is beyond all numbers that count.
        let square = conformal * conformal;
        let (sin, cos) = (2.0 * conformal / (1.0 + square), 2.0 / (1.0 + square) - 1.0);
        let (mut one, mut two) = (0.0, 0.0);
        for c in self.from_conformal.iter().rev() {
            (two, one) = (one, 2.0 * cos * one - two + c);
        }
        libm::atan(conformal) + sin * one
    }

    /// Returns the tangent of the latitude to that of a conformal latitude, by Newton's method.
    fn tangent_of_conformal(&self, conformal: f64) -> f64 {
        /// Beyond this tangent, the ratio of the two is that at the pole.
        const POLE: f64 = 1e8;
        let rest = 1.0 - self.e2;
        let at_pole = libm::exp(self.e * libm::atanh(self.e));
        if conformal.abs() > POLE {
            return conformal * at_pole;
        }
        let mut tangent = if conformal.abs() > 70.0 { conformal * at_pole } else { conformal / rest };
        for _ in 0..ROUNDS {
            let found = self.conformal(tangent);
            let slope = rest * secant(tangent) * secant(found) / (1.0 + rest * tangent * tangent);
            let step = (conformal - found) / slope;
            tangent += step;
            if step.abs() <= 1e-16 * tangent.abs().max(1.0) {
                break;
            }
        }
        tangent
    }

    /// Returns the isometric latitude in radians. It is infinite at no latitude that floating point has.
    pub(crate) fn isometric(&self, latitude: f64) -> f64 {
        libm::asinh(self.conformal(libm::tan(latitude)))
    }

    /// Returns the latitude in radians to an isometric latitude.
    pub(crate) fn latitude_of_isometric(&self, isometric: f64) -> f64 {
        self.latitude_of_conformal(libm::sinh(isometric))
    }

    /// Returns what the area between the equator and a latitude with this sine grows by: q in the formulas of equal area.
    pub(crate) fn authalic(&self, sin: f64) -> f64 {
        let rest = if self.e == 0.0 { sin } else { libm::atanh(self.e * sin) / self.e };
        (1.0 - self.e2) * (sin / (1.0 - self.e2 * sin * sin) + rest)
    }

    /// Returns the latitude in radians at which [`Ellipsoid::authalic`] is `q`; `None` if it is nowhere so great.
    pub(crate) fn latitude_of_authalic(&self, q: f64) -> Option<f64> {
        let share = q / self.authalic(1.0);
        if share.abs() > 1.0 + 1e-12 || share.is_nan() {
            return None;
        }
        let mut latitude = libm::asin(share.clamp(-1.0, 1.0));
        for _ in 0..ROUNDS {
            let (sin, cos) = (libm::sin(latitude), libm::cos(latitude));
            let below = 1.0 - self.e2 * sin * sin;
            let step = below * below * (q - self.authalic(sin)) / (2.0 * cos * (1.0 - self.e2));
            // At the pole itself there is no slope.
            if cos < 1e-9 || step.abs() <= 1e-16 {
                break;
            }
            latitude += step;
        }
        Some(latitude)
    }
}

/// Returns the secant of an angle by its tangent.
pub(crate) fn secant(tangent: f64) -> f64 {
    (1.0 + tangent * tangent).sqrt()
}

/// Returns the values of polynomials in n, of which the first begins with n, the second with its square, and so on.
pub(crate) fn coefficients(polynomials: &[&[f64]; 6], n: f64) -> [f64; 6] {
    let mut power = 1.0;
    polynomials.map(|polynomial| {
        power *= n;
        power * polynomial.iter().rev().fold(0.0, |sum, c| sum * n + c)
    })
}

/// Returns the sine and the cosine of an angle in radians.
pub(crate) fn sin_cos(angle: f64) -> [f64; 2] {
    [libm::sin(angle), libm::cos(angle)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn latitudes_are_found_again() {
        let shapes = [[6_378_137.0, 6_356_752.314_14], [6_378_206.4, 6_356_583.8], [6_370_997.0, 6_370_997.0]];
        for ellipsoid in shapes.map(|axes| Ellipsoid::of(axes).unwrap()) {
            for step in -899..=899 {
                let latitude = f64::from(step) * 0.1 * std::f64::consts::PI / 180.0;
                let again = ellipsoid.latitude_of_isometric(ellipsoid.isometric(latitude));
                assert!((again - latitude).abs() < 1e-15, "{step}: {again} {latitude}");
                let again = ellipsoid.latitude_of_authalic(ellipsoid.authalic(libm::sin(latitude))).unwrap();
                // Near a pole, the area hardly changes with the latitude.
                assert!((again - latitude).abs() * libm::cos(latitude) < 4e-16, "{step}: {again} {latitude}");
            }
            assert_eq!(ellipsoid.latitude_of_authalic(2.1), None);
        }
        assert_eq!(Ellipsoid::of([6.0, 7.0]), None);
    }

    #[test]
    fn the_series_gives_what_newtons_method_gives() {
        let earth = Ellipsoid::of([6_378_249.145, 6_356_514.87]).unwrap();
        for step in -8999..=8999 {
            let conformal = libm::tan(f64::from(step) * 0.01 * std::f64::consts::PI / 180.0);
            let (series, newton) = (earth.latitude_of_conformal(conformal), earth.tangent_of_conformal(conformal));
            assert!((series - libm::atan(newton)).abs() < 1e-15, "{step}: {series} {}", libm::atan(newton));
        }
        // An ellipsoid far from the earth's.
        let flat = Ellipsoid::of([7.0, 6.0]).unwrap();
        let again = flat.latitude_of_conformal(flat.conformal(libm::tan(0.7)));
        assert!((again - 0.7).abs() < 1e-15, "{again}");
    }
}
