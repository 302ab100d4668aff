//! Finding the pairs of triangles that may overlap.
//!
//! The common rectangle of two meshes is cut into cells, and what meets in a cell is compared. A cell with many triangles is cut again, so
//! that meshes may be dense in one place and sparse in another. A pair that meets in several cells is visited in one of them alone: the
//! one that holds the lower left corner of the rectangle that their rectangles have in common. A triangle whose rectangle covers many cells
//! goes only to those that it meets, and so need not be in that one: pairs of such triangles are collected, and visited once at
//! the end.

use crate::mesh::{Point, TriangleMesh};
use crate::pair::is_same_place;
use crate::rectangle::Rectangle;

/// A grid has about one cell for this many triangles.
const TRIANGLES_PER_CELL: usize = 8;

/// The most columns or rows of a grid.
const MOST_CELLS: usize = 1 << 10;

/// A triangle is large if its rectangle covers more cells than this.
const FEW_CELLS: usize = 9;

/// A cell with more pairs than this is cut again.
const FEW_PAIRS: usize = 1 << 12;

/// Calls `visit` once for each triangle of `first` and each of `second` whose rectangles overlap. A pair may be left out if one of its
/// triangles has the same corners as another of the other mesh: then the two have no area in common.
pub(crate) fn for_each_pair(first: &TriangleMesh, second: &TriangleMesh, visit: impl FnMut(u32, u32)) {
    let within = first.bounds().common(second.bounds());
    let in_reach = |mesh: &TriangleMesh| {
        let numbers = 0..u32::try_from(mesh.len()).unwrap_or(u32::MAX);
        numbers.filter(|t| mesh.rectangle(*t).overlaps(&within)).collect::<Vec<u32>>()
    };
    if !first.bounds().overlaps(&second.bounds()) {
        return;
    }
    let mut join = Join { meshes: [first, second], cells: Vec::new(), of_large: Vec::new(), visit };
    join.join(&[in_reach(first), in_reach(second)].each_ref().map(Vec::as_slice), within);
    join.visit_large();
}

struct Join<'a, F> {
    meshes: [&'a TriangleMesh; 2],
    /// The cells around the current one, the outermost first.
    cells: Vec<(Grid, usize)>,
    /// Pairs of which one is large somewhere; they may repeat.
    of_large: Vec<(u32, u32)>,
    visit: F,
}

impl<F: FnMut(u32, u32)> Join<'_, F> {
    fn join(&mut self, lists: &[&[u32]; 2], within: Rectangle) {
        if lists.iter().any(|list| list.is_empty()) {
            return;
        }
        let grid = Grid::new(within, lists[0].len() + lists[1].len());
        let [first, second] = [0, 1].map(|m| Cells::new(&grid, self.meshes[m], lists[m]));
        let all = lists[0].len().saturating_mul(lists[1].len());
        for cell in 0..grid.count() {
            let in_cell = [first.of(cell), second.of(cell)];
            let pairs = in_cell[0].len().saturating_mul(in_cell[1].len());
            if pairs == 0 {
                continue;
            }
            self.cells.push((grid, cell));
            // Cutting does not help where all triangles meet in one place.
            if pairs > FEW_PAIRS && pairs < all / 2 {
                self.join(&in_cell, grid.rectangle(cell).common(within));
            } else {
                self.compare_all(&in_cell);
            }
            self.cells.pop();
        }
    }

    fn compare_all(&mut self, lists: &[&[u32]; 2]) {
        let [first, second] = self.meshes;
        for &a in lists[0] {
            let (rectangle, corners) = (*first.rectangle(a), first.corners(a));
            let is_same = |b: u32| *second.rectangle(b) == rectangle && is_same_place(&corners, &second.corners(b));
            if let Some(&b) = lists[1].iter().find(|b| is_same(**b)) {
                self.found(a, b);
                continue;
            }
            for &b in lists[1] {
                if second.rectangle(b).overlaps(&rectangle) {
                    self.found(a, b);
                }
            }
        }
    }

    #[inline]
    fn found(&mut self, a: u32, b: u32) {
        let boxes = [self.meshes[0].rectangle(a), self.meshes[1].rectangle(b)];
        let lower_left = [0, 1].map(|k| boxes[0].min[k].max(boxes[1].min[k]));
        let mut is_large = false;
        for (grid, cell) in &self.cells {
            if boxes.iter().any(|rectangle| grid.is_large(rectangle)) {
                is_large = true;
            } else if grid.cell_of(lower_left) != *cell {
                return;
            }
        }
        if is_large {
            self.of_large.push((a, b));
        } else {
            (self.visit)(a, b);
        }
    }

    fn visit_large(&mut self) {
        self.of_large.sort_unstable();
        self.of_large.dedup();
        for (a, b) in std::mem::take(&mut self.of_large) {
            (self.visit)(a, b);
        }
    }
}

/// Square cells over a rectangle. The outermost ones reach to infinity.
#[derive(Clone, Copy, Debug)]
struct Grid {
    origin: [i64; 2],
    side: i64,
    /// 1 / side.
    per_step: f64,
    size: [usize; 2],
}

impl Grid {
    fn new(within: Rectangle, triangles: usize) -> Grid {
        let extent = [0, 1].map(|k| (within.max[k] - within.min[k]).max(1) as f64);
        let cells = (triangles / TRIANGLES_PER_CELL).max(1) as f64;
        let side = (extent[0] * extent[1] / cells).sqrt().max(extent[0].max(extent[1]) / MOST_CELLS as f64);
        let side = (side as i64).max(1);
        let per_step = 1.0 / side as f64;
        let size = extent.map(|extent| ((extent * per_step) as usize + 1).min(MOST_CELLS));
        Grid { origin: within.min, side, per_step, size }
    }

    fn count(&self) -> usize {
        self.size[0] * self.size[1]
    }

    /// Returns the column (axis 0) or row (axis 1) of a coordinate. It never falls as the coordinate grows.
    #[inline(always)]
    fn place(&self, coordinate: i64, axis: usize) -> usize {
        let from_origin = (coordinate - self.origin[axis]) as f64 * self.per_step;
        (from_origin.max(0.0) as usize).min(self.size[axis] - 1)
    }

    #[inline(always)]
    fn cell_of(&self, place: [i64; 2]) -> usize {
        self.place(place[1], 1) * self.size[0] + self.place(place[0], 0)
    }

    /// Returns about the rectangle of a cell: rounding may put what is a step beyond it into the cell.
    fn rectangle(&self, cell: usize) -> Rectangle {
        let at = [cell % self.size[0], cell / self.size[0]];
        let min = [0, 1].map(|k| self.origin[k] + at[k] as i64 * self.side);
        Rectangle { min, max: min.map(|least| least + self.side) }
    }

    /// Returns the first and the last column, and the first and the last row, that a rectangle covers.
    #[inline(always)]
    fn covered(&self, rectangle: &Rectangle) -> [[usize; 2]; 2] {
        [0, 1].map(|axis| [self.place(rectangle.min[axis], axis), self.place(rectangle.max[axis], axis)])
    }

    #[inline(always)]
    fn is_large(&self, rectangle: &Rectangle) -> bool {
        let [columns, rows] = self.covered(rectangle).map(|[first, last]| last - first + 1);
        columns * rows > FEW_CELLS
    }

    /// Calls `visit` for each cell that a triangle may meet.
    #[inline(always)]
    fn cells_of(&self, rectangle: &Rectangle, corners: impl Fn() -> [Point; 3], mut visit: impl FnMut(usize)) {
        let [columns, rows] = self.covered(rectangle);
        let is_large = (columns[1] - columns[0] + 1) * (rows[1] - rows[0] + 1) > FEW_CELLS;
        for row in rows[0]..=rows[1] {
            let [west, east] = if is_large { self.columns_in_row(&corners(), row, columns) } else { columns };
            (west..=east).for_each(|column| visit(row * self.size[0] + column));
        }
    }

    /// Returns the first and the last column, among `columns`, in which a triangle may meet a row.
    fn columns_in_row(&self, corners: &[Point; 3], row: usize, columns: [usize; 2]) -> [usize; 2] {
        // Rounding is made up for by some steps.
        const MARGIN: i64 = 2;
        let south = if row == 0 { i64::MIN / 4 } else { self.origin[1] + row as i64 * self.side - MARGIN };
        let is_last = row + 1 == self.size[1];
        let north = if is_last { i64::MAX / 4 } else { self.origin[1] + (row as i64 + 1) * self.side + MARGIN };
        let [south, north] = [south, north].map(|y| y as f64);
        let (mut west, mut east) = (f64::INFINITY, f64::NEG_INFINITY);
        for k in 0..3 {
            let [from, to] = [&corners[k], &corners[(k + 1) % 3]].map(|p| [p[0] as f64, p[1] as f64]);
            if from[1].max(to[1]) < south || from[1].min(to[1]) > north {
                continue;
            }
            let rise = to[1] - from[1];
            for y in [from[1].clamp(south, north), to[1].clamp(south, north)] {
                let x = if rise == 0.0 {
                    [from[0], to[0]]
                } else {
                    [from[0] + (to[0] - from[0]) * ((y - from[1]) / rise); 2]
                };
                west = west.min(x[0].min(x[1]));
                east = east.max(x[0].max(x[1]));
            }
        }
        if west > east {
            return [1, 0];
        }
        let [first, last] = [self.place(west as i64 - MARGIN, 0), self.place(east as i64 + MARGIN, 0)];
        [first.max(columns[0]), last.min(columns[1])]
    }
}

/// The triangles in each cell of a grid.
struct Cells {
    /// Where the triangles of each cell begin, and at the end their number.
    starts: Vec<u32>,
    triangles: Vec<u32>,
}

impl Cells {
    fn new(grid: &Grid, mesh: &TriangleMesh, list: &[u32]) -> Cells {
        let mut starts = vec![0u32; grid.count() + 1];
        for &t in list {
            grid.cells_of(mesh.rectangle(t), || mesh.corners(t), |cell| starts[cell] += 1);
        }
        let mut sum = 0;
        for start in &mut starts {
            sum += *start;
            *start = sum;
        }
        let mut triangles = vec![0; sum as usize];
        for &t in list {
            grid.cells_of(
                mesh.rectangle(t),
                || mesh.corners(t),
                |cell| {
                    starts[cell] -= 1;
                    triangles[starts[cell] as usize] = t;
                },
            );
        }
        Cells { starts, triangles }
    }

    fn of(&self, cell: usize) -> &[u32] {
        &self.triangles[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }
}
