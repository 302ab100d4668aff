//! A grid of square cells over a part of the plane.

use multiversion::multiversion;

use crate::geometry::bounds::Bounds;

/// Square cells over a box, numbered row by row from its least corner. A point outside belongs to the nearest cell.
///
/// With a whole number of lattice steps to a side the cells are exact: the quotient of two 32-bit integers is further from a whole
/// number than double precision rounds.
#[derive(Clone, Copy, Debug)]
pub struct SquareGrid {
    low: [f64; 2],
    /// The side of a cell in lattice steps.
    side: f64,
    columns: usize,
    rows: usize,
}

impl SquareGrid {
    /// Returns the cells with sides of `side` lattice steps over the lattice points of `bounds`, but at most
    /// `most_lines` rows and `most_lines` columns.
    pub fn new(bounds: Bounds<2>, side: f64, most_lines: f64) -> SquareGrid {
        let lines = |axis: usize| ((bounds.extent(axis) + 1) as f64 / side).ceil().clamp(1.0, most_lines) as usize;
        SquareGrid { low: bounds.min.map(f64::from), side, columns: lines(0), rows: lines(1) }
    }

    /// Returns the number of cells.
    #[inline]
    pub fn cells(&self) -> usize {
        self.columns * self.rows
    }

    /// Returns the number of cells in a row.
    #[inline]
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Returns the cell of the point at `x` and `y`.
    #[inline]
    pub fn cell(&self, x: i32, y: i32) -> usize {
        let line = |value: i32, low: f64| ((f64::from(value) - low) / self.side) as usize;
        line(y, self.low[1]).min(self.rows - 1) * self.columns + line(x, self.low[0]).min(self.columns - 1)
    }

    /// Returns how far a point is from the middle of its cell along the axis on which it is further: 2^31 is the side of a cell, and the
    /// greatest number stands for twice that and more.
    #[inline(always)]
    pub fn distance_from_middle(&self, p: &[i32; 3]) -> u32 {
        let along = |axis: usize, lines: usize| {
            let at = (f64::from(p[axis]) - self.low[axis]) / self.side;
            (at - at.floor().clamp(0.0, (lines - 1) as f64) - 0.5).abs()
        };
        (along(0, self.columns).max(along(1, self.rows)) * f64::from(1u32 << 31)) as u32
    }

    /// Returns the cell of every point, as [`SquareGrid::cell`] does, of grids with fewer than 2^31 cells.
    pub fn cells_of(&self, points: &[[i32; 3]]) -> Vec<u32> {
        cells_of(self, points)
    }
}

#[multiversion(targets("x86_64+avx2"))]
fn cells_of(grid: &SquareGrid, points: &[[i32; 3]]) -> Vec<u32> {
    let last = [grid.columns, grid.rows].map(|lines| (lines - 1) as f64);
    let line = |p: &[i32; 3], axis: usize| {
        let line = (f64::from(p[axis]) - grid.low[axis]) / grid.side;
        line.max(0.0).min(last[axis]) as i32 as u32
    };
    points.iter().map(|p| line(p, 1).wrapping_mul(grid.columns as u32).wrapping_add(line(p, 0))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_of_whole_steps_are_exact() {
        let bounds = Bounds { min: [i32::MIN, i32::MIN], max: [i32::MAX, i32::MAX] };
        for side in [3i64, 49, 1000, 65_537, 1 << 30, (1 << 31) + 1] {
            let grid = SquareGrid::new(bounds, side as f64, f64::INFINITY);
            assert_eq!(grid.columns() as i64, (1i64 << 32).div_euclid(side) + i64::from((1i64 << 32) % side > 0));
            for line in [0, 1, 2, ((1i64 << 32) - 2) / side] {
                for along in [line * side - 1, line * side, line * side + 1].map(|along| along.clamp(0, (1 << 32) - 1))
                {
                    let x = (along + i64::from(i32::MIN)) as i32;
                    assert_eq!(grid.cell(x, i32::MIN) as i64, along / side, "{along} by {side}");
                }
            }
        }
    }

    #[test]
    fn points_outside_are_in_the_outermost_cells() {
        let grid = SquareGrid::new(Bounds { min: [10, 20], max: [29, 29] }, 7.5, 100.0);
        assert_eq!((grid.columns(), grid.cells()), (3, 6));
        let points = [[-5, -5, 0], [99, 99, 0], [17, 21, 9], [18, 21, 9]];
        assert_eq!(points.map(|[x, y, _]| grid.cell(x, y)), [0, 5, 0, 1]);
        assert_eq!(grid.cells_of(&points), [0, 5, 0, 1]);
        assert_eq!(SquareGrid::new(Bounds { min: [0, 0], max: [999, 0] }, 1.0, 10.0).cells(), 10);
        let square = SquareGrid::new(Bounds { min: [0, 0], max: [39, 39] }, 10.0, 100.0);
        let distance = |x: i32, y: i32| square.distance_from_middle(&[x, y, 0]);
        assert_eq!([distance(15, 25), distance(20, 5), distance(15, 7)], [0, 1 << 30, (1u64 << 31) as u32 / 5]);
        assert_eq!([distance(45, 5), distance(-5_000, 5)], [1 << 31, u32::MAX]);
    }
}
