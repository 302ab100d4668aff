//! A grid of cells over some points of the plane, all of one size, to find what lies near a triangle.
//!
//! Unlike [`delaunay::geometry::square_grid::SquareGrid`] it fits a number of cells to the points: cells are as wide as the points'
//! box divided by whole numbers, and not square.

use multiversion::multiversion;

use delaunay::geometry::{Bounds, bounds_of};

/// The cells, numbered row by row.
pub(crate) struct CellGrid {
    low: [f64; 2],
    /// Cells in a lattice step along each axis.
    scale: [f64; 2],
    columns: usize,
    rows: usize,
}

impl CellGrid {
    /// Returns about `about` cells over `positions` (lattice x, y, z).
    pub(crate) fn new(positions: &[[i32; 3]], about: usize) -> CellGrid {
        let bounds = bounds_of(positions).unwrap_or(Bounds::of_point([0; 3]));
        let [low, high] = [bounds.min, bounds.max].map(|p| [f64::from(p[0]), f64::from(p[1])]);
        let size = [0, 1].map(|k| (high[k] - low[k]).max(1.0));
        let about = about.max(1) as f64;
        let columns = (about * size[0] / size[1]).sqrt().ceil().clamp(1.0, about);
        let rows = (about / columns).ceil();
        let scale = [columns / (size[0] + 1.0), rows / (size[1] + 1.0)];
        CellGrid { low, scale, columns: columns as usize, rows: rows as usize }
    }

    /// Returns the number of cells.
    pub(crate) fn count(&self) -> usize {
        self.columns * self.rows
    }

    /// Returns the number of the cell in this row and column.
    pub(crate) fn at(&self, row: usize, column: usize) -> usize {
        row * self.columns + column
    }

    /// Returns the number of columns and of rows.
    pub(crate) fn lines(&self) -> [usize; 2] {
        [self.columns, self.rows]
    }

    /// Returns a number of lattice steps along each axis: points that are no further apart are in the same cell or in cells side by side.
    pub(crate) fn reach(&self) -> [u32; 2] {
        // A hundredth is more than rounding can move a point.
        self.scale.map(|scale| (0.99 / scale) as u32)
    }

    /// Returns the number of the cell around a point.
    #[inline(always)]
    pub(crate) fn of(&self, p: &[i32; 3]) -> u32 {
        self.at(self.row(p[1] as f64), self.column(p[0] as f64)) as u32
    }

    /// Returns the numbers of the cells around points.
    pub(crate) fn of_all(&self, points: &[[i32; 3]]) -> Vec<u32> {
        cells_of(self, points)
    }

    /// Returns the column at `x`, or the outermost one on that side.
    #[inline(always)]
    pub(crate) fn column(&self, x: f64) -> usize {
        line((x - self.low[0]) * self.scale[0], self.columns)
    }

    /// Returns the row at `y`, or the outermost one on that side.
    #[inline(always)]
    pub(crate) fn row(&self, y: f64) -> usize {
        line((y - self.low[1]) * self.scale[1], self.rows)
    }

    /// Returns the first and the last column that the triangle touches in `row`. Rounding may add one column at either end.
    pub(crate) fn span(&self, corners: &[[i32; 3]; 3], row: usize) -> [usize; 2] {
        let y_of = |row: f64| self.low[1] + row / self.scale[1];
        let (south, north) = (y_of(row as f64 - 0.01), y_of(row as f64 + 1.01));
        let mut span = [f64::INFINITY, f64::NEG_INFINITY];
        for k in 0..3 {
            let [a, b] = [corners[k], corners[(k + 1) % 3]].map(|p| [p[0] as f64, p[1] as f64]);
            let [a, b] = if a[1] <= b[1] { [a, b] } else { [b, a] };
            if a[1] > north || b[1] < south {
                continue;
            }
            let x_at = |y: f64| if a[1] == b[1] { a[0] } else { a[0] + (b[0] - a[0]) * ((y - a[1]) / (b[1] - a[1])) };
            let ends = [x_at(south.max(a[1])), if b[1] <= north { b[0] } else { x_at(north) }];
            span = [span[0].min(ends[0]).min(ends[1]), span[1].max(ends[0]).max(ends[1])];
        }
        let spare = 0.01 / self.scale[0];
        [span[0] - spare, span[1] + spare].map(|x| self.column(x))
    }
}

/// Returns the line, of so many, in which a coordinate in lines lies; the outermost one on its side for others.
#[inline(always)]
fn line(at: f64, lines: usize) -> usize {
    // There are fewer than 2^31 lines, and these steps work on several numbers at a time.
    at.max(0.0).min((lines - 1) as f64) as i32 as usize
}

#[multiversion(targets("x86_64+avx2"))]
fn cells_of(grid: &CellGrid, points: &[[i32; 3]]) -> Vec<u32> {
    points.iter().map(|p| grid.of(p)).collect()
}
