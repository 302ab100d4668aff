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
use multiversion::multiversion;
use serde::{Deserialize, Serialize};

/// The metres in a unit of the coefficients. Rounding to it hides the last digits in which mathematics libraries differ.
const UNIT: f64 = 1.0 / 1024.0;

/// The greatest degree.
pub(crate) const MOST_DEGREE: usize = 12;

/// Places that are looked at together: processors compute several numbers at a time.
pub const AT_ONCE: usize = 64;

/// The coordinates of places, or how far they are moved, by axis.
pub type Places<const N: usize> = [[f64; N]; 3];

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
    /// What the displacement along each axis depends on.
    along: [DependsOn; 3],
}

/// What the displacement along an axis depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum DependsOn {
    /// Nothing is moved.
    Nothing,
    /// x and y.
    Ground,
    /// x, y and z.
    Height,
}

impl DependsOn {
    /// Returns what the displacement along axis `a` with these terms depends on.
    fn of(terms: &[[f64; 6]], a: usize) -> DependsOn {
        let is_zero = |k: usize| terms.iter().all(|term| term[k] == 0.0);
        match (is_zero(a), is_zero(3 + a)) {
            (true, true) => DependsOn::Nothing,
            (false, true) => DependsOn::Ground,
            (_, false) => DependsOn::Height,
        }
    }
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
        let along = [0, 1, 2].map(|a| DependsOn::of(coefficients, a));
        Ok(Curvature { half: written.half.map(f64::from), along, written })
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
        matches!(self.along, [DependsOn::Nothing, DependsOn::Nothing, DependsOn::Nothing | DependsOn::Ground])
    }

    /// Returns the displacement in metres of a place on the lattice, whole or not.
    pub fn displacement(&self, point: [f64; 3]) -> [f64; 3] {
        self.moved(&point.map(|coordinate| [coordinate])).map(|[metres]| metres)
    }

    /// Does what [`Curvature::displacement`] does, with the same bits, for many places.
    pub fn displacements(&self, places: &Places<AT_ONCE>) -> Places<AT_ONCE> {
        let mut moved = [[0.0; AT_ONCE]; 3];
        displacements(self, places, &mut moved);
        moved
    }

    #[inline(always)]
    fn moved<const N: usize>(&self, places: &Places<N>) -> Places<N> {
        let Written { centre, degree, coefficients, .. } = &self.written;
        let mut shares = [[0.0; N]; 3];
        for k in 0..3 {
            let (centre, half) = (f64::from(centre[k]), self.half[k]);
            for (share, place) in shares[k].iter_mut().zip(&places[k]) {
                *share = ((place - centre) / half).clamp(-1.0, 1.0);
            }
        }
        let mut moved = [[0.0; N]; 3];
        for a in 0..3 {
            match self.along[a] {
                DependsOn::Nothing => {}
                DependsOn::Ground => {
                    sums(coefficients, *degree, |row, term, i| row * shares[1][i] + term[a], &shares[0], &mut moved[a])
                }
                DependsOn::Height => sums(
                    coefficients,
                    *degree,
                    |row, term, i| row * shares[1][i] + (term[a] + shares[2][i] * term[3 + a]),
                    &shares[0],
                    &mut moved[a],
                ),
            }
        }
        moved
    }

    /// Returns the place on the lattice that is moved to `moved` (metres east, north and up from lattice point 0, 0, 0), on a lattice with these
    /// `steps` in metres. Whole numbers are not met exactly, but to far less than half a step.
    pub fn flat(&self, moved: [f64; 3], steps: [f64; 3]) -> [f64; 3] {
        let displaced = |places: &Places<1>| self.moved(places);
        flat_places(&moved.map(|metres| [metres]), steps, displaced).map(|[place]| place)
    }

    /// Does what [`Curvature::flat`] does for many places, as near or nearer.
    pub fn flat_places(&self, moved: &Places<AT_ONCE>, steps: [f64; 3]) -> Places<AT_ONCE> {
        flat_places(moved, steps, |places| self.displacements(places))
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

/// Returns place `i` of `places`.
#[inline(always)]
pub fn place_of<const N: usize>(places: &Places<N>, i: usize) -> [f64; 3] {
    [places[0][i], places[1][i], places[2][i]]
}

/// Sets `moved` to the displacements of `places`.
#[multiversion(targets("x86_64+avx2"))]
fn displacements(curvature: &Curvature, places: &Places<AT_ONCE>, moved: &mut Places<AT_ONCE>) {
    *moved = curvature.moved(places);
}

/// Sets `moved` to the metres along one axis of places whose shares along x are `shares`. `with_term` adds a term to the sum of a row, for
/// the place with the index that it gets.
#[inline(always)]
fn sums<const N: usize>(
    terms: &[[f64; 6]],
    degree: usize,
    with_term: impl Fn(f64, &[f64; 6], usize) -> f64,
    shares: &[f64; N],
    moved: &mut [f64; N],
) {
    let mut terms = terms.iter().rev();
    let mut sums = [0.0; N];
    for i in (0..=degree).rev() {
        let mut row = [0.0; N];
        for term in terms.by_ref().take(degree - i + 1) {
            (0..N).for_each(|i| row[i] = with_term(row[i], term, i));
        }
        (0..N).for_each(|i| sums[i] = sums[i] * shares[i] + row[i]);
    }
    *moved = sums.map(|metres| metres * UNIT);
}

/// Looks for the places that are `moved` to these ones, by the displacements that `displaced` returns, until all are found.
#[inline(always)]
fn flat_places<const N: usize>(
    moved: &Places<N>,
    steps: [f64; 3],
    displaced: impl Fn(&Places<N>) -> Places<N>,
) -> Places<N> {
    let mut places = *moved;
    (0..3).for_each(|k| places[k].iter_mut().for_each(|place| *place /= steps[k]));
    for _ in 0..ROUNDS {
        let displaced = displaced(&places);
        let mut is_found = true;
        for k in 0..3 {
            for i in 0..N {
                let next = (moved[k][i] - displaced[k][i]) / steps[k];
                is_found &= (next - places[k][i]).abs() < 1e-5;
                places[k][i] = next;
            }
        }
        if is_found {
            break;
        }
    }
    places
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
        fn many_places_are_moved_as_each_alone(seed in prop::array::uniform3(-3_000_000..3_000_000i32), step in 1..99_999i32) {
            let mut upwards = sphere().written;
            upwards.coefficients.iter_mut().for_each(|term| (term[3], term[4]) = (0.0, 0.0));
            for curvature in [sphere(), Curvature::try_from(upwards).unwrap()] {
                let place = |i: usize, k: usize| f64::from(seed[k]) + f64::from(step) * (i * (k + 1)) as f64 / 7.0;
                let places: Places<AT_ONCE> = std::array::from_fn(|k| std::array::from_fn(|i| place(i, k)));
                let moved = curvature.displacements(&places);
                let back: Places<AT_ONCE> = std::array::from_fn(|k| std::array::from_fn(|i| places[k][i] * 0.01 + moved[k][i]));
                let flat = curvature.flat_places(&back, [0.01; 3]);
                for i in 0..AT_ONCE {
                    let alone = places.map(|along| along[i]);
                    prop_assert_eq!(moved.map(|along| along[i].to_bits()), curvature.displacement(alone).map(f64::to_bits));
                    prop_assert!((0..3).all(|k| (flat[k][i] - alone[k]).abs() < 1e-3));
                }
            }
        }

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
