//! How low and how high the ground is, roughly and surely, by cells: a bound on how far a simplified triangle can be from it.

use crate::output::lod::cells::Cells;

/// Vertices of the terrain to a cell.
const VERTICES_PER_CELL: usize = 8;
/// A triangle in more cells than this counts for the whole plane, so that a fan of slivers takes no longer than other terrains.
const MOST_CELLS: usize = 64;

/// A terrain, roughly.
pub(crate) struct Relief<'a> {
    positions: &'a [[i32; 3]],
    cells: Cells,
    /// The least and the greatest height in each cell.
    ranges: Vec<[i32; 2]>,
    /// And that of triangles in very many cells.
    everywhere: [i32; 2],
}

/// The range of no height at all.
const NONE: [i32; 2] = [i32::MAX, i32::MIN];

fn wider(a: [i32; 2], b: [i32; 2]) -> [i32; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}

impl<'a> Relief<'a> {
    /// Of a terrain whose triangles are `fine`, corners of `positions` (lattice x, y, z).
    pub(crate) fn new(positions: &'a [[i32; 3]], fine: &[[u32; 3]]) -> Relief<'a> {
        let cells = Cells::new(positions, positions.len() / VERTICES_PER_CELL + 1);
        let ranges = vec![NONE; cells.count()];
        let mut relief = Relief { positions, cells, ranges, everywhere: NONE };
        fine.iter().for_each(|triangle| relief.add(triangle));
        relief
    }

    /// Every point of a triangle lies in a cell that knows its heights.
    fn add(&mut self, triangle: &[u32; 3]) {
        let (corners, range) = self.corners(triangle);
        let [columns, rows] = self.cells.around(&corners);
        if (columns[1] - columns[0] + 1) * (rows[1] - rows[0] + 1) > MOST_CELLS {
            self.everywhere = wider(self.everywhere, range);
            return;
        }
        for row in rows[0]..=rows[1] {
            for known in &mut self.ranges[self.cells.at(row, columns[0])..=self.cells.at(row, columns[1])] {
                *known = wider(*known, range);
            }
        }
    }

    fn corners(&self, triangle: &[u32; 3]) -> ([[i32; 3]; 3], [i32; 2]) {
        let corners = triangle.map(|v| self.positions[v as usize]);
        let [a, b, c] = corners.map(|p| p[2]);
        (corners, [a.min(b).min(c), a.max(b).max(c)])
    }

    /// Steps of z that no point of the triangle is further off the ground.
    pub(crate) fn bound(&self, triangle: &[u32; 3]) -> u64 {
        let (corners, [low, high]) = self.corners(triangle);
        let [columns, rows] = self.cells.around(&corners);
        let mut ground = self.everywhere;
        for row in rows[0]..=rows[1] {
            let ranges = &self.ranges[self.cells.at(row, columns[0])..=self.cells.at(row, columns[1])];
            ground = ranges.iter().copied().fold(ground, wider);
        }
        let above = high as i64 - ground[0] as i64;
        let below = ground[1] as i64 - low as i64;
        above.max(below).max(0) as u64
    }
}
