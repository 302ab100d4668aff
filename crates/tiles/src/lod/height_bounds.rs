//! The least and greatest height of a terrain around each cell of a grid. They bound how far a simplified triangle can be from the
//! terrain, and the cells tell which triangles of the terrain are near it.
//!
//! Nearly all triangles of a terrain are narrower than a cell. So a place has its height from vertices in its own cell and the eight cells
//! around it, and the heights of vertices are enough: no triangle must be drawn into cells. The few wide triangles are, each by itself.

use crate::lod::cell_grid::CellGrid;

/// Vertices of the terrain in a cell, on average.
const VERTICES_PER_CELL: usize = 12;

/// A wide triangle in more cells than this counts everywhere, so that a fan of slivers takes no longer than other terrains.
const MOST_CELLS: usize = 64;

/// A simplified triangle whose box has more cells than this is compared with the heights of the whole terrain.
const MOST_CELLS_COMPARED: usize = 1 << 12;

/// The heights of a terrain, cell by cell.
pub(crate) struct HeightBounds {
    cells: CellGrid,
    /// The cell of each vertex.
    cell_of: Vec<u32>,
    /// The least and the greatest height of the terrain in each cell and those next to it in the next column and the next row, and of some
    /// vertices around them.
    ranges: Vec<[i32; 2]>,
    /// The triangles of the terrain that are wider or higher than a cell.
    wide: Vec<u32>,
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
    columns: [usize; 2],
    /// The first and the last row.
    rows: [usize; 2],
}

impl CellBox {
    #[inline(always)]
    fn around(cells: &CellGrid, corners: &[[i32; 3]; 3]) -> CellBox {
        let ends = |k: usize| {
            let [a, b, c] = corners.map(|p| p[k]);
            [a.min(b).min(c), a.max(b).max(c)].map(f64::from)
        };
        CellBox { columns: ends(0).map(|x| cells.column(x)), rows: ends(1).map(|y| cells.row(y)) }
    }

    /// Tells whether the box has at most two columns and two rows.
    #[inline(always)]
    fn is_small(&self) -> bool {
        self.columns[1] - self.columns[0] < 2 && self.rows[1] - self.rows[0] < 2
    }

    fn count(&self) -> usize {
        [self.columns, self.rows].map(|ends| ends[1] - ends[0] + 1).iter().product()
    }

    /// Returns the cells in each row of the box.
    fn runs(self, cells: &CellGrid) -> impl Iterator<Item = std::ops::RangeInclusive<usize>> + use<'_> {
        let [west, east] = self.columns;
        (self.rows[0]..=self.rows[1]).map(move |row| cells.at(row, west)..=cells.at(row, east))
    }
}

#[inline(always)]
fn union(a: [i32; 2], b: [i32; 2]) -> [i32; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// Returns the least and the greatest height of a triangle.
#[inline(always)]
fn heights(corners: &[[i32; 3]; 3]) -> [i32; 2] {
    let [a, b, c] = corners.map(|p| p[2]);
    [a.min(b).min(c), a.max(b).max(c)]
}

impl HeightBounds {
    /// Returns the heights of the terrain with the triangles `fine`, whose corners are `positions` (lattice x, y, z).
    pub(crate) fn new(positions: &[[i32; 3]], fine: &[[u32; 3]]) -> HeightBounds {
        let cells = CellGrid::new(positions, positions.len() / VERTICES_PER_CELL + 1);
        let cell_of = cells.of_all(positions);
        let mut ranges = vec![NONE; cells.count()];
        for (p, &cell) in positions.iter().zip(&cell_of) {
            let known = &mut ranges[cell as usize];
            *known = union(*known, [p[2]; 2]);
        }
        let all = ranges.iter().copied().fold(NONE, union);
        let wide = wide_triangles(positions, fine, cells.reach());
        let mut bounds = HeightBounds { cells, cell_of, ranges, wide, everywhere: NONE, all };
        bounds.add_wide(positions, fine);
        bounds.spread();
        bounds
    }

    /// Adds the heights of every wide triangle to all cells of its box.
    fn add_wide(&mut self, positions: &[[i32; 3]], fine: &[[u32; 3]]) {
        for &triangle in &self.wide {
            let corners = fine[triangle as usize].map(|v| positions[v as usize]);
            let (around, range) = (CellBox::around(&self.cells, &corners), heights(&corners));
            if around.count() > MOST_CELLS {
                self.everywhere = union(self.everywhere, range);
                continue;
            }
            for run in around.runs(&self.cells) {
                self.ranges[run].iter_mut().for_each(|known| *known = union(*known, range));
            }
        }
    }

    /// Adds to the range of each cell those of the cells around it, where the corners of its triangles may be, and the same for the cells
    /// in the next column and the next row.
    fn spread(&mut self) {
        let [columns, rows] = self.cells.lines();
        (0..rows).for_each(|row| spread_along(&mut self.ranges[row * columns..(row + 1) * columns], 1));
        (0..columns).for_each(|column| spread_along(&mut self.ranges[column..], columns));
    }

    /// Returns a number of z steps: no point of a simplified triangle with these corners is further above or below the terrain.
    #[inline(always)]
    pub(crate) fn error_bound(&self, corners: &[[i32; 3]; 3]) -> u32 {
        let [low, high] = heights(corners);
        let around = CellBox::around(&self.cells, corners);
        let terrain = if around.is_small() {
            union(self.everywhere, self.ranges[self.cells.at(around.rows[0], around.columns[0])])
        } else {
            self.heights_within(around)
        };
        // The difference of two heights, so 32 bits hold it.
        let above = high as i64 - terrain[0] as i64;
        let below = terrain[1] as i64 - low as i64;
        above.max(below).clamp(0, u32::MAX.into()) as u32
    }

    /// Returns the least and the greatest height of the terrain in a box.
    #[inline(never)]
    fn heights_within(&self, around: CellBox) -> [i32; 2] {
        if around.count() > MOST_CELLS_COMPARED {
            return self.all;
        }
        let ranges = around.runs(&self.cells).flat_map(|run| &self.ranges[run]);
        ranges.copied().fold(self.everywhere, union)
    }

    /// Returns the difference between the greatest and the least height. No two terrains within this range are further apart.
    pub(crate) fn height_range(&self) -> f64 {
        let [low, high] = self.all;
        if low > high { 0.0 } else { high as f64 - low as f64 }
    }

    /// Returns what of the terrain is near some triangles with these corners: the numbers of all vertices and those of its triangles `fine`
    /// that have a point in a cell around one of them, and some more.
    pub(crate) fn near(
        &self,
        positions: &[[i32; 3]],
        fine: &[[u32; 3]],
        triangles: impl Iterator<Item = [[i32; 3]; 3]>,
    ) -> (Vec<u32>, Vec<[u32; 3]>) {
        let mut is_near = vec![false; self.cells.count()];
        for corners in triangles {
            CellBox::around(&self.cells, &corners).runs(&self.cells).for_each(|run| is_near[run].fill(true));
        }
        let vertices = (0..).zip(&self.cell_of).filter(|(_, cell)| is_near[**cell as usize]).map(|(v, _)| v).collect();
        // Any corner of a triangle that is not wide is at most one cell away from all of its points.
        let is_beside = self.beside(&is_near);
        let mut near: Vec<[u32; 3]> =
            fine.iter().filter(|t| is_beside[self.cell_of[t[0] as usize] as usize]).copied().collect();
        let others = self.wide.iter().map(|&wide| fine[wide as usize]);
        near.extend(others.filter(|t| {
            let around = CellBox::around(&self.cells, &t.map(|v| positions[v as usize]));
            !is_beside[self.cell_of[t[0] as usize] as usize]
                && (around.count() > MOST_CELLS || around.runs(&self.cells).any(|run| is_near[run].contains(&true)))
        }));
        (vertices, near)
    }

    /// Tells for each cell whether it is among the `chosen` or next to one of them.
    fn beside(&self, chosen: &[bool]) -> Vec<bool> {
        let [columns, rows] = self.cells.lines();
        let mut beside = vec![false; chosen.len()];
        for at in (0..chosen.len()).filter(|&at| chosen[at]) {
            let (row, column) = (at / columns, at % columns);
            let around = CellBox {
                columns: [column.saturating_sub(1), (column + 1).min(columns - 1)],
                rows: [row.saturating_sub(1), (row + 1).min(rows - 1)],
            };
            around.runs(&self.cells).for_each(|run| beside[run].fill(true));
        }
        beside
    }
}

/// Adds to each of the ranges that are so many, `step`, apart that of the one before and those of the next two.
fn spread_along(ranges: &mut [[i32; 2]], step: usize) {
    let mut before = NONE;
    for at in (0..ranges.len()).step_by(step) {
        let after = |count: usize| ranges.get(at + count * step).copied().unwrap_or(NONE);
        let (own, around) = (after(0), [before, after(1), after(2)]);
        ranges[at] = around.into_iter().fold(own, union);
        before = own;
    }
}

/// Returns the numbers of the triangles `fine` between `positions` that are wider or higher than so many lattice steps, `most`.
fn wide_triangles(positions: &[[i32; 3]], fine: &[[u32; 3]], most: [u32; 2]) -> Vec<u32> {
    let half = most.map(|most| most / 2);
    // Two corners that are at most half as far from the third prove most triangles narrow, with one comparison for each axis.
    let is_close =
        |a: [i32; 3], b: [i32; 3], k: usize| (b[k].wrapping_sub(a[k]) as u32).wrapping_add(half[k]) <= 2 * half[k];
    let is_wide = |corners: [[i32; 3]; 3]| {
        (0..2).any(|k| {
            let [a, b, c] = corners.map(|p| p[k]);
            a.max(b).max(c).abs_diff(a.min(b).min(c)) > most[k]
        })
    };
    let candidates = (0..).zip(fine.iter().map(|t| t.map(|v| positions[v as usize])));
    let wide = candidates.filter(|&(_, corners)| {
        let [a, b, c] = corners;
        let is_narrow = is_close(a, b, 0) & is_close(a, b, 1) & is_close(a, c, 0) & is_close(a, c, 1);
        !is_narrow && is_wide(corners)
    });
    wide.map(|(triangle, _)| triangle).collect()
}
