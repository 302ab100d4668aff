//! Proves that points which are no vertices lie within a bound of the mesh along the vertical: `[output] max_error`.
//!
//! The plane is cut into square cells. A triangle goes to every cell that it may meet, a point to the one that it lies in, and what meets in
//! a cell is compared; a cell with many of both is divided. Whether a point lies in a triangle is decided with `robust`, and its distance in integers.

use std::collections::HashSet;
use std::path::Path;
use std::sync::{Mutex, OnceLock, PoisonError};

use bytemuck::{Pod, Zeroable, bytes_of};
use rayon::prelude::*;
use robust::{Coord, orient2d};
use rust_decimal::Decimal;
use xxhash_rust::xxh3::xxh3_64;

use crate::breaklines::DroppedZones;
use crate::keyed_records::{KeyedRecord, KeyedRecords};
use sys::Result;

/// A cell has so many triangles, more or less.
const TRIANGLES_PER_CELL: f64 = 32.0;

/// A cell with more pairs of a triangle and a point is divided: where points are crowded, the side that suits the first mesh is far too long.
const MOST_PAIRS: usize = 1 << 15;

/// About so many smaller cells lie along its side.
const DIVISIONS: i64 = 8;

/// It stays whole if its triangles are in more of them than this, on average.
const MOST_COPIES: usize = 4;

/// A triangle or a point in a cell.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Pod, Zeroable)]
struct Piece {
    cell: [i32; 2],
    /// [`TRIANGLE`] or [`POINT`].
    kind: i32,
    /// The corners of the triangle one after the other, or the point three times.
    corners: [[i32; 3]; 3],
}

const TRIANGLE: i32 = 0;
const POINT: i32 = 1;

impl Piece {
    /// Returns a point as a piece of the cell of this side that it lies in.
    fn of_point(point: [i32; 3], side: i64) -> Piece {
        let cell = [point[0], point[1]].map(|along| i64::from(along).div_euclid(side) as i32);
        Piece { cell, kind: POINT, corners: [point; 3] }
    }
}

impl KeyedRecord for Piece {
    fn key_hash(&self) -> u64 {
        xxh3_64(bytes_of(&self.cell))
    }
}

/// The bound on distances as a fraction of lattice steps of height.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bound {
    steps: i128,
    per: i128,
}

impl Bound {
    /// Returns `bound / step`; `None` if that has too many digits.
    pub(super) fn new(bound: Decimal, step: Decimal) -> Option<Bound> {
        let digits = bound.scale().max(step.scale());
        let whole = |value: Decimal| value.mantissa().checked_mul(10i128.checked_pow(digits - value.scale())?);
        let (steps, per) = (whole(bound)?, whole(step)?);
        let mut divisor = [steps, per];
        while divisor[1] != 0 {
            divisor = [divisor[1], divisor[0] % divisor[1]];
        }
        let [steps, per] = [steps, per].map(|value| value / divisor[0].max(1));
        // As the job did it: rounded down where the fraction has many digits.
        let [steps, per] = match per < 1 << 32 {
            true => [steps, per],
            false => [steps.checked_mul(1 << 20)? / per, 1 << 20],
        };
        // So the comparison cannot overflow: distances are below 2^33 steps, twice the area of a triangle below 2^62.
        (steps >= 0 && per > 0).then_some(Bound { steps: steps.min(1 << 64), per })
    }
}

/// What comparing points with the mesh has shown.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SurfaceProof {
    /// The points beyond the bound, and the first of them in order.
    pub(super) beyond: u64,
    pub(super) first_beyond: Option<[i32; 3]>,
    /// The points that no triangle holds, and the first of them in order.
    pub(super) uncovered: u64,
    pub(super) first_uncovered: Option<[i32; 3]>,
    /// The points beyond it, or outside, where the job may have dropped them at breaklines.
    pub(super) excused: u64,
    /// The greatest distance of any other, in lattice steps of height.
    pub(super) greatest: f64,
}

impl SurfaceProof {
    fn join(self, other: SurfaceProof) -> SurfaceProof {
        let first = |a: Option<[i32; 3]>, b: Option<[i32; 3]>| a.into_iter().chain(b).min();
        SurfaceProof {
            beyond: self.beyond + other.beyond,
            first_beyond: first(self.first_beyond, other.first_beyond),
            uncovered: self.uncovered + other.uncovered,
            first_uncovered: first(self.first_uncovered, other.first_uncovered),
            excused: self.excused + other.excused,
            greatest: self.greatest.max(other.greatest),
        }
    }
}

/// The triangles of the mesh, and the points that are to be compared with them.
pub(super) struct Surface {
    pieces: Mutex<KeyedRecords<Piece>>,
    /// Triangles that would meet very many cells, such as those along the hull. They are few.
    large: Mutex<Vec<[[i32; 3]; 3]>>,
    /// The side of a cell, which the first mesh decides.
    side: OnceLock<i64>,
}

impl Surface {
    /// Returns an empty collection that takes up to `memory` bytes and then writes to temporary files in `directory`.
    pub(super) fn new(directory: &Path, memory: u64) -> Surface {
        let pieces = KeyedRecords::new(directory.to_path_buf(), memory);
        Surface { pieces: Mutex::new(pieces), large: Mutex::default(), side: OnceLock::new() }
    }

    /// Adds triangles between vertices, given as lattice integers.
    pub(super) fn add_triangles(&self, vertices: &[[i32; 3]], triangles: &[[u32; 3]]) -> Result<()> {
        let corners = |triangle: &[u32; 3]| triangle.map(|v| vertices[v as usize]);
        let side = *self.side.get_or_init(|| side_for(triangles.iter().map(corners)));
        let mut pieces = Vec::with_capacity(2 * triangles.len());
        let (small, large) =
            triangles.iter().map(corners).partition::<Vec<_>, _>(|corners| meets_few_cells(corners, side));
        self.large.lock().unwrap_or_else(PoisonError::into_inner).extend(large);
        for corners in small {
            cells_of(corners, side, [[i64::MIN; 2], [i64::MAX; 2]], |cell| {
                pieces.push(Piece { cell, kind: TRIANGLE, corners })
            });
        }
        self.add(&pieces)
    }

    /// Adds points that are no vertices.
    pub(super) fn add_points(&self, points: &[[i32; 3]]) -> Result<()> {
        let side = *self.side.get_or_init(|| 1);
        let pieces: Vec<Piece> = points.iter().map(|point| Piece::of_point(*point, side)).collect();
        self.add(&pieces)
    }

    fn add(&self, pieces: &[Piece]) -> Result<()> {
        self.pieces.lock().unwrap_or_else(PoisonError::into_inner).extend(pieces)
    }

    /// Compares all points with the triangles. In `zones` a job may have dropped points.
    pub(super) fn check(self, bound: Bound, zones: Option<&DroppedZones>) -> Result<SurfaceProof> {
        let mut proof = SurfaceProof::default();
        let large = &self.large.into_inner().unwrap_or_else(PoisonError::into_inner);
        let pieces = self.pieces.into_inner().unwrap_or_else(PoisonError::into_inner);
        let side = self.side.into_inner().unwrap_or(1);
        let comparison = Comparison { large, bound, zones };
        pieces.for_each_bucket(|bucket| proof = proof.join(comparison.of_cells(bucket, side)))?;
        Ok(proof)
    }
}

/// Returns the side of cells for triangles like these.
fn side_for(triangles: impl ExactSizeIterator<Item = [[i32; 3]; 3]>) -> i64 {
    let count = triangles.len().max(1) as f64;
    let area: f64 = triangles.map(|[a, b, c]| cross(a, b, c) as f64 / 2.0).sum();
    ((area / count * TRIANGLES_PER_CELL).sqrt() as i64).clamp(1, 1 << 29)
}

/// Tells whether a triangle meets no more than some thousand cells.
fn meets_few_cells(corners: &[[i32; 3]; 3], side: i64) -> bool {
    const MANY: i128 = 4096;
    let [a, b, c] = *corners;
    let spans = [0, 1].map(|axis| {
        let along = [a, b, c].map(|corner| i64::from(corner[axis]));
        (along.into_iter().max().unwrap_or(0) - along.into_iter().min().unwrap_or(0)) / side
    });
    let (side, border) = (i128::from(side), i128::from(spans[0] + spans[1]));
    cross(a, b, c) / (2 * side * side) + border <= MANY
}

/// Calls `visit` for each cell from the first to the last of these that a triangle may meet: row by row, from its least x there to its greatest.
fn cells_of(corners: [[i32; 3]; 3], side: i64, [first, last]: [[i64; 2]; 2], mut visit: impl FnMut([i32; 2])) {
    let ys = corners.map(|p| i64::from(p[1]));
    let (low, high) = (ys.into_iter().min().unwrap_or(0), ys.into_iter().max().unwrap_or(0));
    for row in low.div_euclid(side).max(first[1])..=high.div_euclid(side).min(last[1]) {
        let [south, north] = [row * side, (row + 1) * side].map(|y| y as f64);
        let (mut west, mut east) = (f64::INFINITY, f64::NEG_INFINITY);
        for k in 0..3 {
            let (from, to) = (corners[k].map(f64::from), corners[(k + 1) % 3].map(f64::from));
            // Where the side enters the row and leaves it. Rounding is made up for by a step.
            for y in [from[1].clamp(south, north), to[1].clamp(south, north)] {
                let is_in_row = from[1].min(to[1]) <= north && from[1].max(to[1]) >= south;
                let rise = to[1] - from[1];
                let x = if rise == 0.0 {
                    [from[0], to[0]]
                } else {
                    [from[0] + (to[0] - from[0]) * ((y - from[1]) / rise); 2]
                };
                if is_in_row {
                    west = west.min(x[0].min(x[1]) - 1.0);
                    east = east.max(x[0].max(x[1]) + 1.0);
                }
            }
        }
        if west <= east {
            let column = |x: f64| (x / side as f64).floor() as i64;
            (column(west).max(first[0])..=column(east).min(last[0]))
                .for_each(|column| visit([column as i32, row as i32]));
        }
    }
}

/// What points are compared with, beside the triangles of their cell.
struct Comparison<'a> {
    /// Triangles that are in no cell.
    large: &'a [[[i32; 3]; 3]],
    bound: Bound,
    zones: Option<&'a DroppedZones<'a>>,
}

impl Comparison<'_> {
    /// Compares the points of cells of this side with the triangles of the same cells.
    fn of_cells(&self, pieces: &mut [Piece], side: i64) -> SurfaceProof {
        pieces.par_sort_unstable();
        let cells: Vec<&[Piece]> = pieces.chunk_by(|a, b| a.cell == b.cell).collect();
        let of_cells = cells.into_par_iter().map(|cell| self.of_cell(cell, side));
        of_cells.reduce(SurfaceProof::default, SurfaceProof::join)
    }

    /// Compares the points of a cell with its triangles, which come first, or else with those that are large.
    fn of_cell(&self, pieces: &[Piece], side: i64) -> SurfaceProof {
        let (triangles, points) = pieces.split_at(pieces.partition_point(|piece| piece.kind == TRIANGLE));
        let is_crowded = triangles.len() > 1 && triangles.len().saturating_mul(points.len()) > MOST_PAIRS;
        let finer = (side / DIVISIONS).max(1);
        if is_crowded
            && side > 1
            && let Some(mut pieces) = divided(triangles, points, side, finer)
        {
            return self.of_cells(&mut pieces, finer);
        }
        let mut proof = SurfaceProof::default();
        for point in points.iter().map(|piece| piece.corners[0]) {
            let site = |p: [i32; 3]| [p[0], p[1]];
            let is_excused = |triangle: Option<[[i32; 3]; 3]>| {
                self.zones.is_some_and(|zones| zones.hold(site(point), triangle.map(|corners| corners.map(site))))
            };
            let mut all = triangles.iter().map(|piece| &piece.corners).chain(self.large);
            let Some(triangle) = all.find(|corners| holds(corners, point)) else {
                if is_excused(None) {
                    proof.excused += 1;
                    continue;
                }
                proof.uncovered += 1;
                proof.first_uncovered = proof.first_uncovered.or(Some(point));
                continue;
            };
            let [a, b, c] = *triangle;
            // The height of the triangle below the point, times twice its area.
            let [of_a, of_b, of_c] = [cross(b, c, point), cross(c, a, point), cross(a, b, point)];
            let area = of_a + of_b + of_c;
            let height = of_a * i128::from(a[2]) + of_b * i128::from(b[2]) + of_c * i128::from(c[2]);
            let distance = (height - area * i128::from(point[2])).abs();
            let is_beyond = distance * self.bound.per > self.bound.steps * area;
            if is_beyond && is_excused(Some(*triangle)) {
                proof.excused += 1;
                continue;
            }
            proof.greatest = proof.greatest.max(distance as f64 / area as f64);
            if is_beyond {
                proof.beyond += 1;
                proof.first_beyond = proof.first_beyond.or(Some(point));
            }
        }
        proof
    }
}

/// Returns the pieces of a cell by smaller cells: its points, and its triangles where there are points. `None` if that does not help, because the
/// triangles meet many of them.
fn divided(triangles: &[Piece], points: &[Piece], side: i64, finer: i64) -> Option<Vec<Piece>> {
    let mut pieces: Vec<Piece> = points.iter().map(|piece| Piece::of_point(piece.corners[0], finer)).collect();
    let with_points: HashSet<[i32; 2]> = pieces.iter().map(|piece| piece.cell).collect();
    for &Piece { cell, corners, .. } in triangles {
        let first = cell.map(|along| (i64::from(along) * side).div_euclid(finer));
        let last = cell.map(|along| ((i64::from(along) + 1) * side - 1).div_euclid(finer));
        cells_of(corners, finer, [first, last], |cell| {
            if with_points.contains(&cell) {
                pieces.push(Piece { cell, kind: TRIANGLE, corners });
            }
        });
        if pieces.len() > points.len() + MOST_COPIES * triangles.len() {
            return None;
        }
    }
    Some(pieces)
}

fn holds(corners: &[[i32; 3]; 3], point: [i32; 3]) -> bool {
    let at = |p: [i32; 3]| Coord { x: f64::from(p[0]), y: f64::from(p[1]) };
    (0..3).all(|k| orient2d(at(corners[k]), at(corners[(k + 1) % 3]), at(point)) >= 0.0)
}

/// Returns twice the area of the triangle abc.
fn cross(a: [i32; 3], b: [i32; 3], c: [i32; 3]) -> i128 {
    let along = |p: [i32; 3], axis: usize| i128::from(p[axis]) - i128::from(a[axis]);
    along(b, 0) * along(c, 1) - along(b, 1) * along(c, 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::str::FromStr;

    fn proof_of(triangles: &[[[i32; 3]; 3]], points: &[[i32; 3]], bound: &str) -> SurfaceProof {
        let folder = tempfile::tempdir().unwrap();
        let surface = Surface::new(folder.path(), 1 << 20);
        let vertices: Vec<[i32; 3]> = triangles.iter().flatten().copied().collect();
        let numbers: Vec<[u32; 3]> = (0..triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        surface.add_triangles(&vertices, &numbers).unwrap();
        surface.add_points(points).unwrap();
        surface.check(Bound::new(Decimal::from_str(bound).unwrap(), Decimal::ONE).unwrap(), None).unwrap()
    }

    #[test]
    fn distances_are_compared_exactly() {
        let triangle = [[0, 0, 0], [3, 0, 1], [0, 3, 0]];
        // A third of a step below the triangle.
        for (bound, beyond) in [("0.3333", 1), ("0.3334", 0), ("1", 0)] {
            let proof = proof_of(&[triangle], &[[1, 1, 0]], bound);
            assert_eq!((proof.beyond, proof.uncovered), (beyond, 0), "{bound}");
            assert!((proof.greatest - 1.0 / 3.0).abs() < 1e-12);
        }
        let outside = proof_of(&[triangle], &[[2, 2, 0]], "1");
        assert_eq!((outside.uncovered, outside.first_uncovered), (1, Some([2, 2, 0])));
    }

    /// The first triangles are wide, so one cell holds the crowd.
    #[test]
    fn a_crowd_in_one_cell_is_compared_with_its_own_triangles() {
        let folder = tempfile::tempdir().unwrap();
        let surface = Surface::new(folder.path(), 1 << 20);
        let wide = [[0, 0, 0], [900_000, 0, 0], [0, 900_000, 0]];
        surface.add_triangles(&wide, &[[0, 1, 2]]).unwrap();
        let side = 70;
        let vertex = |i: i32| [-9_999 + i % side * 11, -9_999 + i / side * 11, i % 3];
        let vertices: Vec<[i32; 3]> = (0..side * side).map(vertex).collect();
        let squares = (0..side * (side - 1)).filter(|i| i % side < side - 1);
        let triangles: Vec<[u32; 3]> = squares
            .flat_map(|i| [[i, i + 1, i + side], [i + 1, i + side + 1, i + side]])
            .map(|t| t.map(|v| v as u32))
            .collect();
        surface.add_triangles(&vertices, &triangles).unwrap();
        let middle = |t: &[u32; 3]| {
            let corners = t.map(|v| vertices[v as usize]);
            let [x, y] = [0, 1].map(|k| corners.iter().map(|p| p[k]).sum::<i32>().div_euclid(3));
            [x, y, 1]
        };
        let mut points: Vec<[i32; 3]> = triangles.iter().map(middle).collect();
        points[77][2] = 500;
        points.push([-10_005, -9_999, 0]);
        surface.add_points(&points).unwrap();
        let proof = surface.check(Bound::new(Decimal::from(2), Decimal::ONE).unwrap(), None).unwrap();
        assert_eq!((proof.beyond, proof.first_beyond), (1, Some(points[77])));
        assert_eq!((proof.uncovered, proof.first_uncovered), (1, points.last().copied()));
        assert!((498.0..=500.0).contains(&proof.greatest), "{}", proof.greatest);
    }

    proptest! {
        /// Thin and large triangles among small ones, so that cells are small.
        #[test]
        fn every_point_meets_its_triangle(
            corners in prop::array::uniform3((-2000..2000i32, -2000..2000i32)),
            parts in prop::collection::vec((0..100i32, 0..100i32), 1..30),
        ) {
            let [a, b, c] = corners.map(|(x, y)| [x, y, 0]);
            let large = if cross(a, b, c) > 0 { [a, b, c] } else { [a, c, b] };
            prop_assume!(cross(large[0], large[1], large[2]) > 0);
            let mut triangles: Vec<[[i32; 3]; 3]> = (0..500).map(|i| [[i * 9, 9000, 0], [i * 9 + 9, 9000, 0], [i * 9, 9009, 0]]).collect();
            triangles.push(large);
            let point = |&(u, v): &(i32, i32)| {
                let (u, v) = if u + v > 100 { (100 - u, 100 - v) } else { (u, v) };
                [0, 1, 2].map(|k| (large[0][k] * (100 - u - v) + large[1][k] * u + large[2][k] * v) / 100)
            };
            let inside: Vec<[i32; 3]> = parts.iter().map(point).filter(|p| holds(&large, *p)).collect();
            prop_assert_eq!(proof_of(&triangles, &inside, "1").uncovered, 0);
        }
    }
}
