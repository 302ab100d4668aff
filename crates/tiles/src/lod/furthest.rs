//! For each triangle of a simplified terrain the vertex of the surface with the greatest vertical distance from it.

use crate::lod::cell_grid::CellGrid;
use crate::lod::filling::Filling;
use crate::lod::vertex_cells::vertical_distance;

/// Steps of the walks to the vertices, on average, before the search gives up. Terrains need far fewer.
const STEPS_PER_VERTEX: u64 = 64;

/// Triangles in a cell, from one of which a walk starts.
const TRIANGLES_PER_CELL: usize = 4;

/// A vertex of the surface that is over or under a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FarVertex {
    /// The vertical distance in steps of z.
    pub(crate) distance: f64,
    pub(crate) vertex: u32,
    pub(crate) triangle: u32,
}

/// The vertices with the greatest distances, at most one for each triangle.
pub(crate) struct Furthest {
    vertices: Vec<FarVertex>,
    /// The mean distance in steps of z, over all triangles.
    pub(crate) mean: f64,
}

impl Furthest {
    /// Compares the triangles of `filling` with the surface of a terrain at `positions`, whose `heights` are those of one of every `every`
    /// vertices. Only vertices that are not `kept`, so that the filling does not have them, are among the results.
    ///
    /// Stops looking where that would take far longer than usual: where nearly all triangles are slivers.
    pub(crate) fn find(
        positions: &[[i32; 3]],
        heights: &[i32],
        kept: &[bool],
        filling: &Filling,
        every: usize,
    ) -> Furthest {
        let mut furthest = vec![(0.0, 0); filling.triangles()];
        let mut steps = steps_for(positions.len() / every);
        let starts = StartCells::new(filling);
        for (v, &height) in (0..).step_by(every).zip(heights).filter(|&(v, _)| !kept[v]) {
            let [x, y, _] = positions[v];
            let start = starts.near(&positions[v]);
            let Some(triangle) = filling.locate(v as u32, start, &mut steps) else { break };
            let Some(corners) = filling.corners(triangle) else { continue };
            let distance = vertical_distance(&corners.map(|site| filling.positions[site as usize]), [x, y, height]);
            if distance > furthest[triangle].0 {
                furthest[triangle] = (distance, v as u32);
            }
        }
        let at_corner = |site: u32| {
            let v = filling.vertices[site as usize] as usize;
            match v.is_multiple_of(every) {
                true => f64::from(filling.positions[site as usize][2].abs_diff(heights[v / every])),
                false => 0.0,
            }
        };
        let (mut sum, mut within, mut vertices) = (0.0, 0u64, Vec::new());
        for (triangle, (distance, vertex)) in furthest.into_iter().enumerate() {
            let Some(corners) = filling.corners(triangle) else { continue };
            sum += corners.map(at_corner).into_iter().fold(distance, f64::max);
            within += 1;
            if distance > 0.0 {
                vertices.push(FarVertex { distance, vertex, triangle: triangle as u32 });
            }
        }
        Furthest { vertices, mean: sum / within.max(1) as f64 }
    }

    /// Returns those of the vertices that are wanted, the first `count` by their distance, in the order of their triangles.
    pub(crate) fn first(self, count: usize, is_wanted: impl Fn(usize) -> bool) -> Vec<FarVertex> {
        let wanted = self.vertices.into_iter().filter(|far| is_wanted(far.vertex as usize));
        let mut wanted: Vec<FarVertex> = wanted.collect();
        if count < wanted.len() {
            // Distances are not negative, so their bits are in the same order.
            wanted.select_nth_unstable_by_key(count, |far| std::cmp::Reverse((far.distance.to_bits(), far.vertex)));
            wanted.truncate(count);
            wanted.sort_unstable_by_key(|far| far.triangle);
        }
        wanted
    }
}

/// A triangle for every place, from which it is not far to the one that holds the place.
struct StartCells {
    cells: CellGrid,
    /// A triangle with a corner in each cell, or near it.
    triangles: Vec<u32>,
}

impl StartCells {
    /// Notes the triangles of `filling` that lie within the boundary.
    fn new(filling: &Filling) -> StartCells {
        let cells = CellGrid::new(&filling.positions, filling.triangles() / TRIANGLES_PER_CELL + 1);
        let mut triangles = vec![u32::MAX; cells.count()];
        for triangle in 0..filling.triangles() {
            if let Some([corner, ..]) = filling.corners(triangle) {
                triangles[cells.of(&filling.positions[corner as usize]) as usize] = triangle as u32;
            }
        }
        // Where a cell has none, that of the cell before it must do.
        let mut last = triangles.iter().copied().find(|&triangle| triangle != u32::MAX).unwrap_or(0);
        for triangle in &mut triangles {
            if *triangle == u32::MAX {
                *triangle = last;
            }
            last = *triangle;
        }
        StartCells { cells, triangles }
    }

    fn near(&self, place: &[i32; 3]) -> usize {
        self.triangles[self.cells.of(place) as usize] as usize
    }
}

/// Returns the steps that walks to so many vertices may take.
pub(crate) fn steps_for(vertices: usize) -> u64 {
    STEPS_PER_VERTEX * (vertices as u64 + 1000)
}
