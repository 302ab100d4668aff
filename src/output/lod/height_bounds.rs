//! The least and greatest height of a terrain in each cell of a grid. They bound how far a simplified triangle can be from the terrain.

use crate::output::lod::cell_grid::CellGrid;

/// Vertices of the terrain in a cell, on average.
const VERTICES_PER_CELL: usize = 8;

/// A triangle in more cells than this counts everywhere, so that a fan of slivers takes no longer than other terrains.
const MOST_CELLS: usize = 64;

/// A simplified triangle whose box has more cells than this is compared with the heights of the whole terrain.
const MOST_CELLS_COMPARED: usize = 1 << 12;

/// The heights of a terrain, cell by cell.
pub(crate) struct HeightBounds<'a> {
    positions: &'a [[i32; 3]],
    cells: CellGrid,
    /// The least and the greatest height in each cell.
    ranges: Vec<[i32; 2]>,
    /// The least and the greatest height of triangles that are in more than [`MOST_CELLS`].
    everywhere: [i32; 2],
    /// The least and the greatest height of the terrain.
    all: [i32; 2],
}

/// The range that holds no height.
const NONE: [i32; 2] = [i32::MAX, i32::MIN];

/// Returns the number of cells between the first and the last column and row.
fn cells_in(columns: [usize; 2], rows: [usize; 2]) -> usize {
    (columns[1] - columns[0] + 1) * (rows[1] - rows[0] + 1)
}

/// Returns the least and the greatest height of a triangle.
fn heights(corners: &[[i32; 3]; 3]) -> [i32; 2] {
    let [a, b, c] = corners.map(|p| p[2]);
    [a.min(b).min(c), a.max(b).max(c)]
}

fn union(a: [i32; 2], b: [i32; 2]) -> [i32; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}

impl<'a> HeightBounds<'a> {
    /// Returns the heights of the terrain with the triangles `fine`, whose corners are `positions` (lattice x, y, z).
    pub(crate) fn new(positions: &'a [[i32; 3]], fine: &[[u32; 3]]) -> HeightBounds<'a> {
        let cells = CellGrid::new(positions, positions.len() / VERTICES_PER_CELL + 1);
        let ranges = vec![NONE; cells.count()];
        let mut bounds = HeightBounds { positions, cells, ranges, everywhere: NONE, all: NONE };
        fine.iter().for_each(|triangle| bounds.add(triangle));
        bounds.all = bounds.ranges.iter().copied().fold(bounds.everywhere, union);
        bounds
    }

    /// Adds the heights of a triangle to every cell that holds a point of it.
    fn add(&mut self, triangle: &[u32; 3]) {
        let corners = triangle.map(|v| self.positions[v as usize]);
        let range = heights(&corners);
        let [columns, rows] = self.cells.around(&corners);
        if cells_in(columns, rows) > MOST_CELLS {
            self.everywhere = union(self.everywhere, range);
            return;
        }
        for row in rows[0]..=rows[1] {
            for known in &mut self.ranges[self.cells.at(row, columns[0])..=self.cells.at(row, columns[1])] {
                *known = union(*known, range);
            }
        }
    }

    /// Returns a number of z steps: no point of the triangle with these corners is further above or below the terrain.
    pub(crate) fn error_bound(&self, corners: &[[i32; 3]; 3]) -> u64 {
        let [low, high] = heights(corners);
        let [columns, rows] = self.cells.around(corners);
        let mut terrain = self.everywhere;
        if cells_in(columns, rows) > MOST_CELLS_COMPARED {
            terrain = self.all;
        } else {
            for row in rows[0]..=rows[1] {
                let ranges = &self.ranges[self.cells.at(row, columns[0])..=self.cells.at(row, columns[1])];
                terrain = ranges.iter().copied().fold(terrain, union);
            }
        }
        let above = high as i64 - terrain[0] as i64;
        let below = terrain[1] as i64 - low as i64;
        above.max(below).max(0) as u64
    }
}
