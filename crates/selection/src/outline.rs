//! Points along the outline of a cloud, where it bends inwards.
//!
//! Without them, few vertices are left along a bay of flat ground, and triangles over it are as large as it is. The rule for slivers along the hull would
//! keep those.

use crate::lattice_cells::LatticeCells;
use delaunay::geometry::predicates::orient2d;
use delaunay::geometry::{Bounds, Site};
use std::collections::{HashMap, HashSet};

/// A cell has so many points on average, or up to four times as many. So points along the outline are some 25 to 50 spacings of the box apart.
const POINTS_PER_CELL: u64 = 512;

/// The points of a cell that are farthest west, east, south and north.
type Outermost = [[i32; 3]; 4];

/// The outline of a cloud, or of a part of it.
#[derive(Clone, Debug)]
pub(crate) struct Outline {
    cells: LatticeCells,
    bounds: Bounds<2>,
    /// The cells with points.
    known: HashMap<[i32; 2], Outermost>,
}

impl Outline {
    /// Returns the outline without points, of `points` points in `bounds` on a lattice with this `offset`.
    pub(crate) fn none(bounds: Bounds<2>, points: u64, offset: [i64; 2]) -> Outline {
        let longest = bounds.extent(0).max(bounds.extent(1));
        let cells = |wanted: u64| LatticeCells::new(bounds, points, wanted, offset);
        // Points along a line have no more cells than the same number in a square.
        let is_wide_enough = |cells: &LatticeCells| {
            let side = u128::from(cells.side().unsigned_abs());
            side * u128::from(points) >= u128::from(longest.unsigned_abs()) * u128::from(POINTS_PER_CELL)
        };
        let found = (0..30).map(|times| cells(POINTS_PER_CELL << times)).find(is_wide_enough);
        let cells = found.unwrap_or_else(|| cells(u64::MAX));
        Outline { cells, bounds, known: HashMap::new() }
    }

    /// Adds points.
    pub(crate) fn add(&mut self, points: &[[i32; 3]]) {
        let cells = self.cells;
        let cell = |[x, y, _]: [i32; 3]| cells.of(x, y);
        // Neighbours one after the other mostly lie in one cell.
        for points in points.chunk_by(|a, b| cell(*a) == cell(*b)) {
            if let Some(outermost) = points.iter().map(|point| [*point; 4]).reduce(outer) {
                self.offer(cell(points[0]), outermost);
            }
        }
    }

    fn offer(&mut self, cell: [i32; 2], outermost: Outermost) {
        let known = self.known.entry(cell).or_insert(outermost);
        *known = outer(*known, outermost);
    }

    /// Adds the points of another one.
    pub(crate) fn join(&mut self, other: Outline) {
        other.known.into_iter().for_each(|(cell, outermost)| self.offer(cell, outermost));
    }

    /// Returns the points that are nearest to a bay, one for each side on which a cell with points meets it. A bay is made of cells outside whose middles lie
    /// in the `hull`, and is at least two cells wide.
    pub(crate) fn points(&self, hull: &[[i32; 3]]) -> Vec<[i32; 3]> {
        let hull: Vec<Site> = hull.iter().map(|[x, y, _]| [*x, *y]).collect();
        let (outside, mut points) = (wide(&self.outside()), Vec::new());
        for (cell, outermost) in &self.known {
            let towards_outside = beside(*cell).zip(outermost);
            let wanted = towards_outside.filter(|(cell, _)| outside.contains(cell) && self.is_in_hull(*cell, &hull));
            points.extend(wanted.map(|(_, point)| *point));
        }
        points
    }

    /// Returns the cells without points that are connected to the border of the box, and those just around the box.
    fn outside(&self) -> HashSet<[i32; 2]> {
        let [first, last] = [self.bounds.min, self.bounds.max].map(|[x, y]| self.cells.of(x, y));
        let is_near = |cell: &[i32; 2]| (0..2).all(|axis| (first[axis] - 1..=last[axis] + 1).contains(&cell[axis]));
        let corner = [first[0] - 1, first[1] - 1];
        let (mut outside, mut next) = (HashSet::from([corner]), vec![corner]);
        while let Some(cell) = next.pop() {
            for cell in beside(cell).filter(is_near) {
                if !self.known.contains_key(&cell) && outside.insert(cell) {
                    next.push(cell);
                }
            }
        }
        outside
    }

    fn is_in_hull(&self, cell: [i32; 2], hull: &[Site]) -> bool {
        let Bounds { min, max } = self.bounds;
        let [x, y] = self.cells.middle(cell);
        let is_within = |value: i64, axis: usize| (i64::from(min[axis])..=i64::from(max[axis])).contains(&value);
        if hull.len() < 3 || !is_within(x, 0) || !is_within(y, 1) {
            return false;
        }
        let middle = [x as i32, y as i32];
        (0..hull.len()).all(|k| orient2d(hull[k], hull[(k + 1) % hull.len()], middle) > 0)
    }
}

/// Returns the cells that are part of a square of four such cells.
fn wide(cells: &HashSet<[i32; 2]>) -> HashSet<[i32; 2]> {
    let square = |[column, row]: [i32; 2]| [0, 1, 2, 3].map(|corner| [column + corner % 2, row + corner / 2]);
    let squares =
        cells.iter().map(|cell| square(*cell)).filter(|square| square.iter().all(|cell| cells.contains(cell)));
    squares.flatten().collect()
}

/// Returns the cells beside one in the west, the east, the south and the north.
fn beside([column, row]: [i32; 2]) -> impl Iterator<Item = [i32; 2]> {
    [[-1, 0], [1, 0], [0, -1], [0, 1]].into_iter().map(move |[east, north]| [column + east, row + north])
}

/// Returns the outermost points of two cells that are one.
fn outer(a: Outermost, b: Outermost) -> Outermost {
    let inwards = |side: usize, [x, y, _]: [i32; 3]| [x, -x, y, -y][side];
    [0, 1, 2, 3].map(|side| std::cmp::min_by_key(a[side], b[side], |point| (inwards(side, *point), *point)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hull::hull_corners;

    /// Points one step apart in an L whose arms are `width` wide and 256 long.
    fn arms(width: i32) -> Vec<[i32; 3]> {
        let all = (0..256).flat_map(|y| (0..256).map(move |x| [x, y, 7]));
        all.filter(|[x, y, _]| *x < width || *y < width).collect()
    }

    fn outline(blocks: &[&[[i32; 3]]]) -> Vec<[i32; 3]> {
        let all = blocks.concat();
        let bounds = Bounds::of_points(all.iter().map(|[x, y, _]| [*x, *y])).unwrap();
        let mut outline = Outline::none(bounds, all.len() as u64, [0; 2]);
        for block in blocks {
            let mut of_block = Outline::none(bounds, all.len() as u64, [0; 2]);
            of_block.add(block);
            outline.join(of_block);
        }
        let mut points = outline.points(&hull_corners(all));
        points.sort_unstable();
        points
    }

    #[test]
    fn a_bay_has_points_along_it() {
        // 30,940 points on 65,025 steps: 512 have 1,076 of them, so a cell is 64 wide.
        let points = arms(70);
        let found = outline(&[&points]);
        // The second cell of each arm is its last with points, but for where the other arm is.
        assert!(found.iter().all(|&[x, y, _]| x == 69 && y >= 128 || y == 69 && x >= 128), "{found:?}");
        assert!(found.iter().any(|p| p[0] == 69) && found.iter().any(|p| p[1] == 69), "{found:?}");
    }

    #[test]
    fn what_is_convex_has_none_and_a_lake_neither() {
        let mut points = arms(256);
        assert_eq!(outline(&[&points]), [[0; 3]; 0]);
        points.retain(|[x, y, _]| !(64..192).contains(x) || !(64..192).contains(y));
        assert_eq!(outline(&[&points]), [[0; 3]; 0]);
        // A bay, once it is open.
        points.retain(|[x, y, _]| !(64..192).contains(x) || *y < 192);
        assert!(outline(&[&points]).contains(&[64, 63, 7]));
    }

    #[test]
    fn along_a_line_there_are_few_cells() {
        let points: Vec<[i32; 3]> = (0..10_000).map(|i| [i * 50_000, i % 2, 0]).collect();
        let bounds = Bounds::of_points(points.iter().map(|[x, y, _]| [*x, *y])).unwrap();
        let mut outline = Outline::none(bounds, points.len() as u64, [0; 2]);
        outline.add(&points);
        assert!(outline.known.len() <= 20 && outline.outside().len() <= 60);
    }

    #[test]
    fn the_outline_is_that_of_all_blocks() {
        let points = arms(90);
        let (first, second) = points.split_at(points.len() / 3);
        assert_eq!(outline(&[&points]), outline(&[second, first]));
        assert!(!outline(&[&points]).is_empty());
    }
}
