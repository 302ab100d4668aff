//! Where in a triangle points lie.

use crate::mesh_of_points::TriangleKey;
use delaunay::geometry::Site;
use delaunay::geometry::predicates::orient2d;

/// Each side of a triangle is cut into so many equal pieces, and the triangle into the square of that number.
const PIECES: i64 = 8;

/// A triangle and the points inside it. Those on its sides are not among them: they are as much in the triangle beside it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct HeldPoints {
    /// The corners in ascending order.
    pub corners: [Site; 3],
    /// How many points there are.
    pub count: u64,
    /// Of the [`HeldPoints::CELLS`] equal triangles that the triangle is made of, a bit for each that holds a point.
    cells: u64,
}

impl HeldPoints {
    /// The equal triangles that a triangle is made of.
    pub const CELLS: u32 = (PIECES * PIECES) as u32;

    /// Returns the triangle without points.
    pub(crate) fn none(corners: TriangleKey) -> HeldPoints {
        HeldPoints { corners, count: 0, cells: 0 }
    }

    /// Returns the triangle with those of the points that are inside it.
    pub fn of(corners: [Site; 3], points: impl IntoIterator<Item = Site>) -> HeldPoints {
        let mut held = HeldPoints::none(corners);
        points.into_iter().for_each(|point| held.add(point));
        held
    }

    /// Adds a point if it is inside.
    pub(crate) fn add(&mut self, point: Site) {
        let [a, b, c] = self.corners;
        let area = i128::from(orient2d(a, b, c));
        let shares = [[b, c], [c, a]].map(|[from, to]| i128::from(orient2d(from, to, point)) * area.signum());
        let area = area.abs();
        let last = area - shares[0] - shares[1];
        if shares[0] <= 0 || shares[1] <= 0 || last <= 0 {
            return;
        }
        let piece = |share: i128| (i128::from(PIECES) * share / area) as i64;
        let (row, column) = (piece(shares[0]), piece(shares[1]));
        // In a row, triangles that lie like the whole one take turns with others.
        let is_turned = row + column + piece(last) < PIECES - 1;
        let cell = row * (2 * PIECES - row) + 2 * column + i64::from(is_turned);
        self.count += 1;
        self.cells |= 1 << cell;
    }

    /// Returns how many of the equal triangles hold a point.
    pub fn occupied(&self) -> u32 {
        self.cells.count_ones()
    }

    /// Adds the points that another block holds in the same triangle.
    pub(crate) fn join(&mut self, other: &HeldPoints) {
        self.count += other.count;
        self.cells |= other.cells;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn every_cell_is_one_of_its_own() {
        let corners = [[0, 0], [0, 240], [240, 0]];
        let all = || (1..240).flat_map(|x| (1..240).map(move |y| [x, y]));
        let held = HeldPoints::of(corners, all());
        assert_eq!((held.occupied(), held.count), (HeldPoints::CELLS, 239 * 238 / 2));
        // Squares of 30 steps that lie in it have two cells, those on the diagonal one.
        for (x, y) in (0..8).flat_map(|x| (0..8).map(move |y| (x * 30, y * 30))) {
            let of_square =
                |[a, b]: &Site| (x + 1..x + 30).contains(a) && (y + 1..y + 30).contains(b) && (a + b) % 30 > 0;
            let cells = HeldPoints::of(corners, all().filter(of_square)).occupied();
            assert_eq!(cells, if x + y < 210 { 2 } else { u32::from(x + y == 210) }, "{x} {y}");
        }
        let row = HeldPoints::of(corners, all().filter(|p| p[1] < 30));
        assert_eq!(row.occupied(), 15);
    }

    proptest! {
        #[test]
        fn blocks_together_know_what_one_knows(
            mut corners in prop::array::uniform3(prop::array::uniform2(-(1i32 << 29)..1 << 29)),
            weights in prop::collection::vec(prop::array::uniform3(0i64..100), 1..60),
            cut in 0usize..60,
        ) {
            corners.sort_unstable();
            let at = |w: [i64; 3]| [0, 1].map(|k| {
                let sum = w.iter().sum::<i64>().max(1);
                ((0..3).map(|i| w[i] * i64::from(corners[i][k])).sum::<i64>() / sum) as i32
            });
            let points: Vec<Site> = weights.into_iter().map(at).collect();
            let whole = HeldPoints::of(corners, points.iter().copied());
            let (first, second) = points.split_at(cut.min(points.len()));
            let mut joined = HeldPoints::of(corners, first.iter().copied());
            joined.join(&HeldPoints::of(corners, second.iter().copied()));
            prop_assert_eq!(joined, whole);
            prop_assert!(u64::from(whole.occupied()) <= whole.count && whole.count <= points.len() as u64);
        }
    }
}
