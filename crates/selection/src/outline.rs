//! Points along the outline of a cloud, where it bends inwards.
//!
//! Without them, few vertices are left along a bay of flat ground, and triangles over it are as large as it is. The rule for slivers along the hull would
//! keep those.

use crate::lattice_cells::LatticeCells;
use delaunay::geometry::predicates::orient2d;
use delaunay::geometry::{Bounds, Site};
use std::collections::HashMap;

/// A cell has so many points on average, or up to four times as many. So points along the outline are some 25 to 50 spacings of the box apart.
const POINTS_PER_CELL: u64 = 512;

/// The cells of a cloud, some of which are marked, such as those with points.
#[derive(Clone, Debug)]
pub(crate) struct MarkedCells {
    cells: LatticeCells,
    bounds: Bounds<2>,
    /// The column and the row of the first cell, southwest of the box.
    first: [i32; 2],
    /// The number of columns and rows, which lead beyond the box on each side.
    count: [usize; 2],
    /// One bit for each cell, row by row.
    marks: Vec<u64>,
}

impl MarkedCells {
    /// Returns the cells of `points` points in `bounds` on a lattice with this `offset`, without marks.
    pub(crate) fn none(bounds: Bounds<2>, points: u64, offset: [i64; 2]) -> MarkedCells {
        let longest = bounds.extent(0).max(bounds.extent(1));
        let cells = |wanted: u64| LatticeCells::new(bounds, points, wanted, offset);
        // Points along a line have no more cells than the same number in a square.
        let is_wide_enough = |cells: &LatticeCells| {
            let side = u128::from(cells.side().unsigned_abs());
            side * u128::from(points) >= u128::from(longest.unsigned_abs()) * u128::from(POINTS_PER_CELL)
        };
        let found = (0..30).map(|times| cells(POINTS_PER_CELL << times)).find(is_wide_enough);
        let cells = found.unwrap_or_else(|| cells(u64::MAX));
        let [first, last] = [bounds.min, bounds.max].map(|[x, y]| cells.of(x, y));
        let count = [0, 1].map(|axis| (last[axis] - first[axis]) as usize + 3);
        let marks = vec![0; (count[0] * count[1]).div_ceil(64)];
        MarkedCells { cells, bounds, first: first.map(|first| first - 1), count, marks }
    }

    /// Marks the cells of points.
    pub(crate) fn add(&mut self, points: &[[i32; 3]]) {
        points.iter().for_each(|&[x, y, _]| _ = self.mark(self.cells.of(x, y)));
    }

    /// Returns the cells of bays, of which these are the cells with points. A bay is at least two cells wide, connected to what is around the box,
    /// and the middles of its cells lie in the `hull` of the points.
    pub(crate) fn bays(&self, hull: &[[i32; 3]]) -> MarkedCells {
        let hull: Vec<Site> = hull.iter().map(|[x, y, _]| [*x, *y]).collect();
        let (outside, mut bays) = (self.outside(), self.without_marks());
        for cell in self.all() {
            let square = [0, 1, 2, 3].map(|corner| [cell[0] + corner % 2, cell[1] + corner / 2]);
            if square.iter().all(|cell| outside.has(*cell)) {
                for cell in square {
                    if !bays.has(cell) && self.is_in_hull(cell, &hull) {
                        bays.mark(cell);
                    }
                }
            }
        }
        bays
    }

    /// Returns the cells without marks that are connected to those just around the box.
    fn outside(&self) -> MarkedCells {
        let (mut outside, mut next) = (self.without_marks(), vec![self.first]);
        outside.mark(self.first);
        while let Some(cell) = next.pop() {
            for cell in beside(cell) {
                if self.number(cell).is_some() && !self.has(cell) && outside.mark(cell) {
                    next.push(cell);
                }
            }
        }
        outside
    }

    fn without_marks(&self) -> MarkedCells {
        MarkedCells { marks: vec![0; self.marks.len()], ..*self }
    }

    fn all(&self) -> impl Iterator<Item = [i32; 2]> {
        let [columns, rows] = self.count.map(|count| 0..count as i32);
        let [first_column, first_row] = self.first;
        rows.flat_map(move |row| columns.clone().map(move |column| [first_column + column, first_row + row]))
    }

    /// Returns the number of a cell; `None` if it is too far from the box.
    fn number(&self, cell: [i32; 2]) -> Option<usize> {
        let [column, row] = [0, 1].map(|axis| (cell[axis] - self.first[axis]) as usize);
        (column < self.count[0] && row < self.count[1]).then(|| row * self.count[0] + column)
    }

    fn has(&self, cell: [i32; 2]) -> bool {
        self.number(cell).is_some_and(|number| self.marks[number / 64] >> (number % 64) & 1 == 1)
    }

    /// Marks a cell. Tells whether it had no mark.
    fn mark(&mut self, cell: [i32; 2]) -> bool {
        let Some(number) = self.number(cell) else { return false };
        let (marks, mark) = (&mut self.marks[number / 64], 1 << (number % 64));
        let is_new = *marks & mark == 0;
        *marks |= mark;
        is_new
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

/// The points of a cell that are farthest west, east, south and north.
type Outermost = [[i32; 3]; 4];

/// What may be the outline of a cloud, or of a part of it.
#[derive(Clone, Debug)]
pub(crate) struct Outline {
    cells: LatticeCells,
    /// Those with points.
    known: HashMap<[i32; 2], Outermost>,
}

impl Outline {
    /// Returns the outline without points, of a cloud with these cells.
    pub(crate) fn none(cells: &MarkedCells) -> Outline {
        Outline { cells: cells.cells, known: HashMap::new() }
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

    /// Marks the cells with points.
    pub(crate) fn mark(&self, cells: &mut MarkedCells) {
        self.known.keys().for_each(|cell| _ = cells.mark(*cell));
    }

    /// Returns the points that are nearest to one of the `bays`, one for each side on which a cell with points meets it.
    pub(crate) fn points(&self, bays: &MarkedCells) -> Vec<[i32; 3]> {
        let towards_bays = |(cell, outermost): (&[i32; 2], &Outermost)| {
            let beside = beside(*cell).zip(*outermost);
            beside.filter(|(cell, _)| bays.has(*cell)).map(|(_, point)| point).collect::<Vec<_>>()
        };
        self.known.iter().flat_map(towards_bays).collect()
    }
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

    fn cells(points: &[[i32; 3]]) -> MarkedCells {
        let bounds = Bounds::of_points(points.iter().map(|[x, y, _]| [*x, *y])).unwrap();
        MarkedCells::none(bounds, points.len() as u64, [0; 2])
    }

    fn outline(blocks: &[&[[i32; 3]]]) -> Vec<[i32; 3]> {
        let all = blocks.concat();
        let mut cells = cells(&all);
        let mut outline = Outline::none(&cells);
        for block in blocks {
            let mut of_block = Outline::none(&cells);
            of_block.add(block);
            outline.join(of_block);
        }
        outline.mark(&mut cells);
        let mut points = outline.points(&cells.bays(&hull_corners(all)));
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
        let mut cells = cells(&points);
        cells.add(&points);
        let count = |cells: &MarkedCells| cells.marks.iter().map(|marks| marks.count_ones()).sum::<u32>();
        assert!((1..=20).contains(&count(&cells)) && cells.all().count() <= 80);
        assert_eq!(count(&cells.outside()) as usize + count(&cells) as usize, cells.all().count());
    }

    #[test]
    fn the_outline_is_that_of_all_blocks() {
        let points = arms(90);
        let (first, second) = points.split_at(points.len() / 3);
        assert_eq!(outline(&[&points]), outline(&[second, first]));
        // That of each part, if the bays are known.
        let mut cells = cells(&points);
        [second, first].iter().for_each(|points| cells.add(points));
        let bays = cells.bays(&hull_corners(points.clone()));
        let of_part = |points: &[[i32; 3]]| {
            let mut outline = Outline::none(&bays);
            outline.add(points);
            outline.points(&bays)
        };
        let of_parts = [of_part(first), of_part(second)].concat();
        assert!(outline(&[&points]).iter().all(|point| of_parts.contains(point)));
        assert!(of_parts.len() < 2 * outline(&[&points]).len());
        assert!(!outline(&[&points]).is_empty());
    }
}
