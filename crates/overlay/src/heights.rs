//! The heights of meshes at places.
//!
//! Which triangle holds a place is decided in whole numbers. On an edge, and at a corner, the height comes from the ends of the edge in the order of
//! their coordinates, or from the corner alone. So all triangles that meet there give the same bits, whichever comes first.

use crate::mesh::{Point, TriangleMesh};
use crate::rectangle::Rectangle;

/// About how many places lie in a cell.
const IN_A_CELL: usize = 2;

/// The most columns, and rows, of cells.
const MOST_CELLS: i64 = 2048;

/// Places in the cells of a grid.
#[derive(Clone, Debug)]
pub struct Places {
    places: Vec<[i64; 2]>,
    bounds: Rectangle,
    /// The side of a cell.
    side: i64,
    columns: usize,
    /// Where the numbers of each cell begin in `numbers`, and where those of the last one end.
    starts: Vec<usize>,
    /// Numbers of places, cell by cell.
    numbers: Vec<usize>,
}

impl Places {
    /// Returns these places, which are within [`REACH`](crate::REACH).
    pub fn new(places: Vec<[i64; 2]>) -> Places {
        let bounds = Rectangle::around(places.iter().copied());
        let mut grid = Places { places, bounds, side: 1, columns: 1, starts: Vec::new(), numbers: Vec::new() };
        if grid.places.is_empty() {
            return grid;
        }
        let [width, height] = [0, 1].map(|axis| (bounds.max[axis] - bounds.min[axis]) as f64 + 1.0);
        let area_of_cell = width * height / (grid.places.len().div_ceil(IN_A_CELL)) as f64;
        let least = bounds.extent() / MOST_CELLS + 1;
        grid.side = (area_of_cell.sqrt().ceil() as i64).max(least);
        let [columns, rows] = [0, 1].map(|axis| grid.cell(bounds.max[axis], axis) + 1);
        grid.columns = columns;
        grid.starts = vec![0; columns * rows + 1];
        let cells: Vec<usize> = grid.places.iter().map(|place| grid.cell_of(*place)).collect();
        cells.iter().for_each(|cell| grid.starts[cell + 1] += 1);
        for cell in 1..grid.starts.len() {
            grid.starts[cell] += grid.starts[cell - 1];
        }
        let mut next = grid.starts.clone();
        grid.numbers = vec![0; cells.len()];
        for (number, cell) in cells.into_iter().enumerate() {
            grid.numbers[next[cell]] = number;
            next[cell] += 1;
        }
        grid
    }

    /// Returns the smallest rectangle around all places.
    pub fn bounds(&self) -> Rectangle {
        self.bounds
    }

    /// Returns the number of places.
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// Tells whether there is no place.
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// Puts the height of `mesh` in steps at each place that one of its triangles holds into `heights`, by the number of the place.
    pub fn find_heights(&self, mesh: &TriangleMesh, heights: &mut [Option<f64>]) {
        for t in (0..).take(mesh.len()) {
            let rectangle = mesh.rectangle(t);
            if !rectangle.meets(&self.bounds) {
                continue;
            }
            let corners = SortedCorners::new(mesh.corners(t));
            let common = rectangle.common(self.bounds);
            let range = |axis: usize| self.cell(common.min[axis], axis)..=self.cell(common.max[axis], axis);
            for row in range(1) {
                for cell in range(0).map(|column| row * self.columns + column) {
                    for number in &self.numbers[self.starts[cell]..self.starts[cell + 1]] {
                        if let Some(height) = corners.height(self.places[*number]) {
                            heights[*number] = Some(height);
                        }
                    }
                }
            }
        }
    }

    fn cell(&self, coordinate: i64, axis: usize) -> usize {
        usize::try_from((coordinate - self.bounds.min[axis]) / self.side).unwrap_or(0)
    }

    fn cell_of(&self, place: [i64; 2]) -> usize {
        self.cell(place[1], 1) * self.columns + self.cell(place[0], 0)
    }
}

/// The corners of a triangle by ascending (x, y).
struct SortedCorners {
    corners: [Point; 3],
    /// 1, or -1 where the corners in their order go clockwise.
    turn: i128,
    area: f64,
}

impl SortedCorners {
    fn new(mut corners: [Point; 3]) -> SortedCorners {
        corners.sort_unstable();
        let area = cross(&corners[0], &corners[1], [corners[2][0], corners[2][1]]);
        SortedCorners { corners, turn: area.signum(), area: area.abs() as f64 }
    }

    /// Returns the height at a place; `None` outside of the triangle.
    fn height(&self, place: [i64; 2]) -> Option<f64> {
        let [a, b, c] = &self.corners;
        // Each weight is twice the area opposite the corner of its number.
        let weights = [cross(b, c, place), cross(c, a, place), cross(a, b, place)].map(|weight| weight * self.turn);
        if weights.iter().any(|weight| *weight < 0) {
            return None;
        }
        let heights = [a, b, c].map(|corner| corner[2] as f64);
        Some(match weights.map(|weight| weight == 0) {
            [false, false, false] => {
                let rise = |k: usize| weights[k] as f64 * (heights[k] - heights[0]);
                heights[0] + (rise(1) + rise(2)) / self.area
            }
            [true, false, false] => on_edge(b, c, place),
            [false, true, false] => on_edge(a, c, place),
            [false, false, true] => on_edge(a, b, place),
            [false, ..] => heights[0],
            [_, false, _] => heights[1],
            _ => heights[2],
        })
    }
}

/// Returns twice the area of the triangle between an edge and a place, above 0 if that is to its left.
fn cross(from: &Point, to: &Point, place: [i64; 2]) -> i128 {
    let along = |axis: usize| i128::from(to[axis] - from[axis]);
    let beside = |axis: usize| i128::from(place[axis] - from[axis]);
    along(0) * beside(1) - along(1) * beside(0)
}

/// Returns the height at a place on an edge, whose ends come in the order of their coordinates.
fn on_edge(from: &Point, to: &Point, place: [i64; 2]) -> f64 {
    let axis = usize::from(from[0] == to[0]);
    let part = (place[axis] - from[axis]) as f64 / (to[axis] - from[axis]) as f64;
    let [low, high] = [from[2] as f64, to[2] as f64];
    low + part * (high - low)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn heights(triangles: &[[Point; 3]], places: &[[i64; 2]]) -> Vec<Option<f64>> {
        let grid = Places::new(places.to_vec());
        let mut found = vec![None; places.len()];
        for corners in triangles {
            grid.find_heights(&TriangleMesh::new(corners.to_vec(), vec![[0, 1, 2]]).unwrap(), &mut found);
        }
        found
    }

    #[test]
    fn a_plane_has_its_heights_and_no_others() {
        let triangles = [[[0, 0, 5], [8, 0, 21], [8, 8, 29]], [[0, 0, 5], [8, 8, 29], [0, 8, 13]]];
        let places: Vec<[i64; 2]> = (-3..12).flat_map(|x| (-3..12).map(move |y| [x, y])).collect();
        for ([x, y], found) in places.iter().zip(heights(&triangles, &places)) {
            let is_inside = (0..=8).contains(x) && (0..=8).contains(y);
            assert_eq!(found, is_inside.then_some((5 + 2 * x + y) as f64), "{x} {y}");
        }
        assert_eq!(heights(&triangles, &[]), []);
    }

    proptest! {
        /// The edge from (0, 0) to a place with a common divisor has places on it, and both triangles there agree on their bits.
        #[test]
        fn triangles_agree_on_their_common_edge(
            end in prop::array::uniform2(1i64..40),
            heights_of in prop::array::uniform4(-1_000_000i64..1_000_000),
            part in 0i64..=7,
        ) {
            let [x, y] = end.map(|v| 7 * v);
            let [low, high, left, right] = heights_of;
            let [from, to] = [[0, 0, low], [x, y, high]];
            let place = [part * x / 7, part * y / 7];
            let on_left = heights(&[[from, to, [-y, x, left]]], &[place]);
            let on_right = heights(&[[to, from, [y, -x, right]]], &[place]);
            prop_assert_eq!(on_left[0].unwrap().to_bits(), on_right[0].unwrap().to_bits());
        }
    }
}
