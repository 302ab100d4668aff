//! The vertices of a terrain by the cells of a grid, to find those inside a simplified triangle.

use crate::lod::cell_grid::CellGrid;
use delaunay::geometry::Site;
use delaunay::geometry::predicates::orient2d;

/// Vertices that are looked at for a simplified triangle, on average, before the search gives up.
const VERTICES_PER_TRIANGLE: u64 = 2048;

/// The vertices, sorted by cell.
pub(crate) struct VertexCells {
    cells: CellGrid,
    /// The vertices of cell c are `sorted[starts[c]..starts[c + 1]]`.
    starts: Vec<u32>,
    sorted: Vec<[i32; 3]>,
}

impl VertexCells {
    /// Sorts these `vertices`, numbers of `positions`.
    pub(crate) fn new(positions: &[[i32; 3]], vertices: &[u32]) -> VertexCells {
        let positions: Vec<[i32; 3]> = vertices.iter().map(|&v| positions[v as usize]).collect();
        let cells = CellGrid::new(&positions, positions.len() + 1);
        let cell_of = cells.of_all(&positions);
        let mut starts = vec![0; cells.count() + 1];
        cell_of.iter().for_each(|&cell| starts[cell as usize] += 1);
        let mut end = 0;
        for start in &mut starts {
            end += *start;
            *start = end;
        }
        let mut sorted = vec![[0; 3]; cell_of.len()];
        for (p, &cell) in positions.iter().zip(&cell_of).rev() {
            let at = &mut starts[cell as usize];
            *at -= 1;
            sorted[*at as usize] = *p;
        }
        VertexCells { cells, starts, sorted }
    }

    /// Returns the number of vertices that may be looked at for this number of triangles. Terrains need far fewer.
    pub(crate) fn steps_for(triangles: usize) -> u64 {
        VERTICES_PER_TRIANGLE * (triangles as u64 + 1000)
    }

    /// Returns the greatest vertical distance between a triangle with these corners and a vertex over or under it. `None` if that means to look
    /// at more than `steps` vertices.
    pub(crate) fn furthest_inside(&self, corners: &[[i32; 3]; 3], steps: &mut u64) -> Option<f64> {
        let ys = corners.map(|p| p[1]);
        let (first, last) = (ys[0].min(ys[1]).min(ys[2]), ys[0].max(ys[1]).max(ys[2]));
        let mut greatest = 0.0f64;
        for row in self.cells.row(first as f64)..=self.cells.row(last as f64) {
            let [west, east] = self.cells.span(corners, row);
            let [start, end] = [self.cells.at(row, west), self.cells.at(row, east) + 1].map(|cell| self.starts[cell]);
            *steps = steps.checked_sub(u64::from(end.saturating_sub(start)))?;
            for &vertex in &self.sorted[start as usize..end as usize] {
                greatest = greatest.max(vertical_distance(corners, vertex));
            }
        }
        Some(greatest)
    }
}

/// Returns the vertical distance between `p` and a counterclockwise triangle, or 0 if `p` is neither over nor under it.
pub(crate) fn vertical_distance(corners: &[[i32; 3]; 3], p: [i32; 3]) -> f64 {
    let [a, b, c] = *corners;
    let weight = |from, to| orient2d(plane(from), plane(to), plane(p));
    let of_a = weight(b, c);
    if of_a < 0 {
        return 0.0;
    }
    let of_b = weight(c, a);
    if of_b < 0 {
        return 0.0;
    }
    let weights = [of_a, of_b, weight(a, b)];
    if weights[2] < 0 {
        return 0.0;
    }
    let total: f64 = weights.iter().map(|&w| w as f64).sum();
    let height = |k: usize| weights[k] as f64 * (corners[k][2] as f64 - p[2] as f64);
    ((height(0) + height(1) + height(2)) / total).abs()
}

/// Returns the x and y of a lattice point.
pub(crate) fn plane(point: [i32; 3]) -> Site {
    [point[0], point[1]]
}
