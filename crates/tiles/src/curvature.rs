//! The curve of the earth in the scene of a wide terrain.
//!
//! A map projection is flat, and the earth is not: 24 km across, its ends lie 11 m below the plane that touches it in the middle. So
//! the scene of a wide terrain is bent: each vertex is moved from its place on the plane to where it lies on the earth, seen from
//! the middle. Then one transform puts all tiles on the globe. A vertex has the same place in every tile that has it, exact or
//! coarser, so tiles meet exactly whatever a viewer shows side by side.
//!
//! The displacement is a polynomial that the files carry. It is computed with plain IEEE operations, so every reader computes the same
//! bits. It changes so slowly from place to place that the lattice point can be found from where it was moved to.

use delaunay::geometry::Bounds;
use serde::{Deserialize, Serialize};

/// The metres in a unit of the coefficients. Rounding to it hides the last digits in which mathematics libraries differ.
const UNIT: f64 = 1.0 / 1024.0;

/// The greatest degree.
pub(crate) const MOST_DEGREE: usize = 12;

/// Rounds of looking for the flat place. Each divides the error by the steepness of the displacement, which is far below one.
const ROUNDS: usize = 40;

/// A displacement (x east, y north, z up, in metres) that depends on the lattice point.
///
/// With u, v, w the x, y, z of the point as `(lattice - centre) / half`, but within -1 and 1, the displacement along axis a is
/// 1/1024 metre times the sum of `(c[a] + w * c[3 + a]) * u^i * v^j` over the terms c with i + j up to `degree`: (0, 0), (0, 1), ...,
/// (0, degree), (1, 0), ...
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Written", into = "Written")]
pub struct Curvature {
    written: Written,
    /// The sizes of the lattice box.
    half: [f64; 3],
}

/// What files say.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Written {
    /// The lattice point in the middle.
    centre: [i32; 3],
    /// Half the sizes of the lattice box in which the displacement varies.
    half: [i32; 3],
    /// The degree.
    degree: usize,
    /// The terms: whole numbers.
    coefficients: Vec<[f64; 6]>,
}

impl From<Curvature> for Written {
    fn from(curvature: Curvature) -> Written {
        curvature.written
    }
}

impl TryFrom<Written> for Curvature {
    type Error = &'static str;

    fn try_from(written: Written) -> Result<Curvature, &'static str> {
        let Written { half, degree, coefficients, .. } = &written;
        let is_whole = |c: &f64| c.is_finite() && c.fract() == 0.0 && c.abs() < 1e15;
        if *degree > MOST_DEGREE || coefficients.len() != terms(*degree) || half.iter().any(|&half| half <= 0) {
            return Err("a curvature has another number of terms than its degree, or no size");
        }
        if !coefficients.as_flattened().iter().all(is_whole) {
            return Err("a term of a curvature is not a whole number");
        }
        Ok(Curvature { half: written.half.map(f64::from), written })
    }
}

/// Returns the number of terms of a polynomial of two variables.
pub(crate) fn terms(degree: usize) -> usize {
    (degree + 1) * (degree + 2) / 2
}

impl Curvature {
    /// Returns the displacement with these terms in metres, rounded. `None` if a term is too large or `half` is not positive.
    pub(crate) fn new(centre: [i32; 3], half: [i32; 3], degree: usize, metres: &[[f64; 6]]) -> Option<Curvature> {
        let coefficients = metres.iter().map(|term| term.map(|c| (c / UNIT).round() + 0.0)).collect();
        Curvature::try_from(Written { centre, half, degree, coefficients }).ok()
    }

    /// Returns the lattice box in which the displacement varies.
    pub fn bounds(&self) -> Bounds<3> {
        let Written { centre, half, .. } = &self.written;
        let end = |sign: i32| std::array::from_fn(|k| centre[k].saturating_add(half[k].saturating_mul(sign)));
        Bounds { min: end(-1), max: end(1) }
    }

    /// Tells whether everything is moved along the vertical alone, whatever its height.
    pub fn is_vertical(&self) -> bool {
        self.written.coefficients.iter().all(|term| (0..6).all(|a| a == 2 || term[a] == 0.0))
    }

    /// Returns the displacement in metres of a place on the lattice, whole or not.
    pub fn displacement(&self, point: [f64; 3]) -> [f64; 3] {
        let along = |k: usize| ((point[k] - f64::from(self.written.centre[k])) / self.half[k]).clamp(-1.0, 1.0);
        let [u, v, w] = [along(0), along(1), along(2)];
        let degree = self.written.degree;
        let mut terms = self.written.coefficients.iter().rev();
        let mut sum = [0.0; 3];
        for i in (0..=degree).rev() {
            let mut row = [0.0; 3];
            for term in terms.by_ref().take(degree - i + 1) {
                (0..3).for_each(|a| row[a] = row[a] * v + (term[a] + w * term[3 + a]));
            }
            (0..3).for_each(|a| sum[a] = sum[a] * u + row[a]);
        }
        sum.map(|metres| metres * UNIT)
    }

    /// Returns the place on the lattice that is moved to `moved` (metres east, north and up from lattice point 0, 0, 0), on a lattice with these
    /// `steps` in metres. Whole numbers are not met exactly, but to far less than half a step.
    pub fn flat(&self, moved: [f64; 3], steps: [f64; 3]) -> [f64; 3] {
        let mut place = [0, 1, 2].map(|k| moved[k] / steps[k]);
        for _ in 0..ROUNDS {
            let displacement = self.displacement(place);
            let next = [0, 1, 2].map(|k| (moved[k] - displacement[k]) / steps[k]);
            let is_found = (0..3).all(|k| (next[k] - place[k]).abs() < 1e-5);
            place = next;
            if is_found {
                break;
            }
        }
        place
    }

    /// Returns at places all over the box how much the displacement along axis a changes in a metre along axis b, as `[a][b]`: the greatest of all.
    pub(crate) fn steepness(&self, steps: [f64; 3]) -> [[f64; 3]; 3] {
        let mut greatest = [[0.0f64; 3]; 3];
        for place in self.places(6) {
            for b in 0..3 {
                // Towards the middle, because nothing changes beyond the box.
                let mut inner = place;
                inner[b] += (f64::from(self.written.centre[b]) - place[b]).signum() * self.half[b] / 16.0;
                let [from, to] = [place, inner].map(|p| self.displacement(p));
                let distance = (inner[b] - place[b]).abs() * steps[b];
                for a in 0..3 {
                    greatest[a][b] = greatest[a][b].max((to[a] - from[a]).abs() / distance);
                }
            }
        }
        greatest
    }

    /// Returns the greatest displacement along each axis in metres, at places all over the box.
    pub fn greatest(&self) -> [f64; 3] {
        self.places(8)
            .map(|p| self.displacement(p))
            .fold([0.0; 3], |most, d| [0, 1, 2].map(|k| most[k].max(d[k].abs())))
    }

    /// Returns the place on the lattice, whole or not, at these shares of the way from the middle to the sides of the box.
    pub(crate) fn place(&self, share: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|k| f64::from(self.written.centre[k]) + share[k] * self.half[k])
    }

    /// Returns lattice places in rows of `count` + 1 along each axis of the box, with its ends.
    fn places(&self, count: usize) -> impl Iterator<Item = [f64; 3]> {
        let side = count + 1;
        (0..side * side * side).map(move |i| {
            let number = [i % side, i / side % side, i / side / side];
            self.place([0, 1, 2].map(|k| 2.0 * number[k] as f64 / count as f64 - 1.0))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The sag of a sphere over 24 km on a lattice of centimetres, with a displacement to the side that grows with the height.
    pub(crate) fn sphere() -> Curvature {
        let sag = -12_000.0f64.powi(2) / (2.0 * 6.371e6);
        let mut terms = [[0.0; 6]; 6];
        terms[2][2] = sag;
        terms[5][2] = sag;
        (terms[3][3], terms[1][4]) = (0.5, 0.5);
        Curvature::new([1000, -2000, 0], [1_200_000, 1_200_000, 30_000], 2, &terms).unwrap()
    }

    #[test]
    fn terms_stand_in_the_order_that_is_written_down() {
        let curvature = sphere();
        let [_, _, down] = curvature.displacement([1_201_000.0, -2000.0, 0.0]);
        assert!((down + 11.30).abs() < 0.01, "{down}");
        let corner = curvature.displacement([1_201_000.0, 1_198_000.0, 30_000.0]);
        assert!((corner[2] + 22.60).abs() < 0.01 && (corner[0] - 0.5).abs() < 1e-3 && (corner[1] - 0.5).abs() < 1e-3);
        // Beyond the box nothing changes any more.
        assert_eq!(curvature.displacement([1e9, 1_198_000.0, 30_000.0]), corner);
    }

    #[test]
    fn what_is_written_is_read_back_or_refused() {
        let text = serde_json::to_string(&sphere()).unwrap();
        assert_eq!(serde_json::from_str::<Curvature>(&text).unwrap(), sphere());
        for (from, to) in [("\"degree\":2", "\"degree\":3"), ("[1200000,", "[0,"), ("512.0", "0.5")] {
            assert!(text.contains(from));
            assert!(serde_json::from_str::<Curvature>(&text.replace(from, to)).is_err(), "{from}");
        }
    }

    proptest! {
        #[test]
        fn the_lattice_point_is_found_again(x in -2_000_000..2_000_000i32, y in -2_000_000..2_000_000i32, z in -99_000..99_000i32) {
            let (curvature, point) = (sphere(), [x, y, z].map(f64::from));
            let displacement = curvature.displacement(point);
            let moved = [0, 1, 2].map(|k| point[k] * 0.01 + displacement[k]);
            let found = curvature.flat(moved, [0.01; 3]);
            prop_assert!((0..3).all(|k| (found[k] - point[k]).abs() < 1e-3), "{:?}", found);
        }
    }
}
