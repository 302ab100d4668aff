//! The height of a triangle at a point within it.
//!
//! Within the triangle it is `z0 + (w1 (z1 - z0) + w2 (z2 - z0)) / (w0 + w1 + w2)`, where the weights are whole numbers: the areas opposite
//! the corners. On an edge it is `z0 + t (z1 - z0)`, where t is the way from one end to the other along x, or along y if both ends have the
//! same x. At a corner it is the corner's height. Corners come in the order of (x, -y), whatever order a file has. So on an edge, and
//! at a vertex, all triangles that meet there give the same bits. The whole numbers are exact, every one of them is rounded to double
//! precision once, and only sums, differences, products and quotients follow, in this order.

use crate::raster::grid::Subunits;
use crate::raster::whole_numbers::WholeNumber;

/// The corners of a triangle: x, -y and z, by ascending (x, -y).
pub(crate) type Corners = [[i32; 3]; 3];

/// A triangle over the centres of cells.
pub(crate) struct HeightTriangle<'a, T> {
    subunits: &'a Subunits<T>,
    corners: Corners,
    heights: [f64; 3],
    /// 1, or -1 where the corners in their order go round the other way: weights are positive inside.
    turn: T,
    edges: [[T; 2]; 3],
    /// The sum of the weights.
    area: T,
}

#[expect(clippy::arithmetic_side_effects, reason = "T is i64 or i128")]
impl<'a, T: WholeNumber> HeightTriangle<'a, T> {
    /// Returns the triangle with these corners, in any order.
    pub(crate) fn new(subunits: &'a Subunits<T>, mut corners: Corners) -> HeightTriangle<'a, T> {
        corners.sort_unstable();
        // Each edge is opposite the corner of its number.
        let edges = [0, 1, 2].map(|k| difference(corners[(k + 1) % 3], corners[(k + 2) % 3]));
        let [opposite_first, opposite_second, _]: [[T; 2]; 3] = edges;
        let twice_area = opposite_first[0] * opposite_second[1] - opposite_first[1] * opposite_second[0];
        let turn = if twice_area < T::from(0i32) { T::from(-1i32) } else { T::from(1i32) };
        let heights = corners.map(|corner| f64::from(corner[2]));
        HeightTriangle { subunits, corners, heights, turn, edges, area: twice_area * turn * subunits.step }
    }

    /// Returns how much the weights grow from a column to the next.
    pub(crate) fn steps_along_row(&self) -> [T; 3] {
        self.edges.map(|edge| -(edge[1] * self.turn * self.subunits.pitch))
    }

    /// Returns the weights at the centre of a cell. The centre must be within the box of the triangle.
    pub(crate) fn weights(&self, column: u32, row: u32) -> [T; 3] {
        let center = [self.subunits.center(0, column), self.subunits.center(1, row)];
        [0, 1, 2].map(|k| {
            let from = self.corners[(k + 1) % 3];
            let [east, south] = [0, 1].map(|axis| center[axis] - self.place(from, axis));
            (self.edges[k][0] * south - self.edges[k][1] * east) * self.turn
        })
    }

    /// Returns the height in steps of the lattice at the centre of a cell with these weights, none of them negative.
    pub(crate) fn height(&self, weights: [T; 3], column: u32, row: u32) -> f64 {
        let zero = T::from(0i32);
        match weights.map(|weight| weight == zero) {
            [false, false, false] => {
                let [z0, z1, z2] = self.heights;
                let [_, w1, w2] = weights.map(T::nearest);
                z0 + (w1 * (z1 - z0) + w2 * (z2 - z0)) / self.area.nearest()
            }
            [true, false, false] => self.on_edge([1, 2], column, row),
            [false, true, false] => self.on_edge([0, 2], column, row),
            [false, false, true] => self.on_edge([0, 1], column, row),
            [false, ..] => self.heights[0],
            [_, false, _] => self.heights[1],
            _ => self.heights[2],
        }
    }

    fn on_edge(&self, ends: [usize; 2], column: u32, row: u32) -> f64 {
        let [from, to] = ends.map(|k| self.corners[k]);
        let axis = usize::from(from[0] == to[0]);
        let center = self.subunits.center(axis, [column, row][axis]);
        let (way, length) = (center - self.place(from, axis), self.place(to, axis) - self.place(from, axis));
        let [low, high] = ends.map(|k| self.heights[k]);
        low + way.nearest() / length.nearest() * (high - low)
    }

    fn place(&self, corner: [i32; 3], axis: usize) -> T {
        T::from(corner[axis]) * self.subunits.step
    }
}

/// Returns the way from one corner to another in the plane, in steps of the lattice.
#[expect(clippy::arithmetic_side_effects, reason = "T is i64 or i128")]
fn difference<T: WholeNumber>(from: [i32; 3], to: [i32; 3]) -> [T; 2] {
    [0, 1].map(|axis| T::from(to[axis]) - T::from(from[axis]))
}
