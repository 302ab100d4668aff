//! The least and greatest height of a terrain in each cell of a grid. They bound how far a simplified triangle can be from the terrain, and
//! the cells tell which triangles of the terrain are near it.

use std::ops::RangeInclusive;

use crate::output::lod::cell_grid::CellGrid;

/// Vertices of the terrain in a cell, on average.
const VERTICES_PER_CELL: usize = 8;

/// A triangle in more cells than this counts everywhere, so that a fan of slivers takes no longer than other terrains.
const MOST_CELLS: usize = 64;

/// A simplified triangle whose box has more cells than this is compared with the heights of the whole terrain.
const MOST_CELLS_COMPARED: usize = 1 << 12;

/// The heights of a terrain, cell by cell.
pub(crate) struct HeightBounds {
    cells: CellGrid,
    /// The column and the row of the cell of each vertex.
    places: Vec<[u32; 2]>,
    /// The least and the greatest height in each cell.
    ranges: Vec<[i32; 2]>,
    /// The least and the greatest height of triangles that are in more than [`MOST_CELLS`].
    everywhere: [i32; 2],
    /// The least and the greatest height of the terrain.
    all: [i32; 2],
}

/// The range that holds no height.
const NONE: [i32; 2] = [i32::MAX, i32::MIN];

/// The cells that a triangle's box touches.
#[derive(Clone, Copy)]
struct CellBox {
    /// The first and the last column.
    columns: [u32; 2],
    /// The first and the last row.
    rows: [u32; 2],
}

impl CellBox {
    #[inline(always)]
    fn around([a, b, c]: [[u32; 2]; 3]) -> CellBox {
        let ends = |k: usize| [a[k].min(b[k]).min(c[k]), a[k].max(b[k]).max(c[k])];
        CellBox { columns: ends(0), rows: ends(1) }
    }

    /// Tells whether the box has at most two columns and two rows.
    #[inline(always)]
    fn is_small(&self) -> bool {
        self.columns[1] - self.columns[0] < 2 && self.rows[1] - self.rows[0] < 2
    }

    /// Returns the first cell of the box.
    #[inline(always)]
    fn first(&self, grid: &CellGrid) -> usize {
        grid.at(self.rows[0] as usize, self.columns[0] as usize)
    }

    #[inline(always)]
    fn cells(&self) -> usize {
        let count = |ends: [u32; 2]| (ends[1] - ends[0]) as usize + 1;
        count(self.columns) * count(self.rows)
    }

    /// Returns the cells of `grid` in each row of the box.
    #[inline(always)]
    fn runs<'a>(&self, grid: &'a CellGrid) -> impl Iterator<Item = RangeInclusive<usize>> + use<'a> {
        let [west, east] = self.columns.map(|column| column as usize);
        (self.rows[0]..=self.rows[1]).map(move |row| grid.at(row as usize, west)..=grid.at(row as usize, east))
    }
}

/// Returns the least and the greatest height of a triangle.
#[inline(always)]
fn heights(corners: &[[i32; 3]; 3]) -> [i32; 2] {
    let [a, b, c] = corners.map(|p| p[2]);
    [a.min(b).min(c), a.max(b).max(c)]
}

#[inline(always)]
fn union(a: [i32; 2], b: [i32; 2]) -> [i32; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}

impl HeightBounds {
    /// Returns the heights of the terrain with the triangles `fine`, whose corners are `positions` (lattice x, y, z).
    pub(crate) fn new(positions: &[[i32; 3]], fine: &[[u32; 3]]) -> HeightBounds {
        let cells = CellGrid::new(positions, positions.len() / VERTICES_PER_CELL + 1);
        let places = positions.iter().map(|p| cells.place(p)).collect();
        let ranges = vec![NONE; cells.count()];
        let mut bounds = HeightBounds { cells, places, ranges, everywhere: NONE, all: NONE };
        fine.iter().for_each(|triangle| bounds.add(triangle, heights(&triangle.map(|v| positions[v as usize]))));
        bounds.spread();
        bounds.all = bounds.ranges.iter().copied().fold(bounds.everywhere, union);
        bounds
    }

    /// Returns the cells around a triangle between the vertices.
    #[inline(always)]
    fn around(&self, triangle: &[u32; 3]) -> CellBox {
        CellBox::around(triangle.map(|v| self.places[v as usize]))
    }

    /// Adds the `range` of heights of a triangle to every cell that holds a point of it. Most triangles are in a small box, and only its
    /// first cell gets the range: see [`HeightBounds::spread`].
    #[inline(always)]
    fn add(&mut self, triangle: &[u32; 3], range: [i32; 2]) {
        let around = self.around(triangle);
        if around.is_small() {
            let known = &mut self.ranges[around.first(&self.cells)];
            *known = union(*known, range);
        } else if around.cells() > MOST_CELLS {
            self.everywhere = union(self.everywhere, range);
        } else {
            for run in around.runs(&self.cells) {
                self.ranges[run].iter_mut().for_each(|known| *known = union(*known, range));
            }
        }
    }

    /// Adds the range of each cell to the cells next to it in the next column and the next row.
    fn spread(&mut self) {
        for cell in (0..self.ranges.len()).rev() {
            let before = self.cells.neighbours_before(cell).map(|before| self.ranges[before]);
            self.ranges[cell] = before.into_iter().fold(self.ranges[cell], union);
        }
    }

    /// Returns a number of z steps: no point of this triangle between the vertices is further above or below the terrain, if its corners have
    /// these heights.
    pub(crate) fn error_bound(&self, triangle: &[u32; 3], corners: &[[i32; 3]; 3]) -> u64 {
        let [low, high] = heights(corners);
        let around = self.around(triangle);
        let mut terrain = self.everywhere;
        if around.cells() > MOST_CELLS_COMPARED {
            terrain = self.all;
        } else {
            for run in around.runs(&self.cells) {
                terrain = self.ranges[run].iter().copied().fold(terrain, union);
            }
        }
        let above = high as i64 - terrain[0] as i64;
        let below = terrain[1] as i64 - low as i64;
        above.max(below).max(0) as u64
    }

    /// Returns what of the terrain is near some triangles between its vertices: the numbers of all vertices and those of its triangles `fine`
    /// that have a point in a cell around one of them, and some more.
    pub(crate) fn near(
        &self,
        fine: &[[u32; 3]],
        triangles: impl Iterator<Item = [u32; 3]>,
    ) -> (Vec<u32>, Vec<[u32; 3]>) {
        let mut is_near = vec![false; self.cells.count()];
        for triangle in triangles {
            self.around(&triangle).runs(&self.cells).for_each(|run| is_near[run].fill(true));
        }
        // The first cell of a small box then tells for the whole box.
        for cell in 0..is_near.len() {
            is_near[cell] |= self.cells.neighbours_after(cell).into_iter().any(|after| is_near[after]);
        }
        let touches = |triangle: &&[u32; 3]| {
            let around = self.around(triangle);
            if around.is_small() {
                return is_near[around.first(&self.cells)];
            }
            around.cells() > MOST_CELLS || around.runs(&self.cells).any(|run| is_near[run].contains(&true))
        };
        let near = |place: &[u32; 2]| is_near[self.cells.at(place[1] as usize, place[0] as usize)];
        let vertices = (0..).zip(&self.places).filter(|(_, place)| near(place)).map(|(v, _)| v).collect();
        (vertices, fine.iter().filter(touches).copied().collect())
    }
}
