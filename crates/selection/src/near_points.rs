//! Small squares over the points of a block: which points and which triangles are near each other.

use crate::area::area_of;
use crate::sample::Sample;
use delaunay::geometry::Bounds;
use delaunay::geometry::square_grid::SquareGrid;

/// For each square of a block, the number of a triangle in or near it.
pub(crate) struct NearestTriangles {
    grid: SquareGrid,
    pub(crate) triangles: Vec<u32>,
}

impl NearestTriangles {
    /// A square has so many points, more or less.
    const POINTS: f64 = 24.0;

    pub(crate) fn new(bounds: Bounds<2>, points: usize) -> NearestTriangles {
        let grid = grid_of(bounds, points, NearestTriangles::POINTS);
        NearestTriangles { grid, triangles: vec![0; grid.cells()] }
    }

    /// Returns the bytes of memory that they take.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(&self.triangles[..])
    }

    pub(crate) fn of(&self, [x, y, _]: [i32; 3]) -> u32 {
        self.triangles[self.grid.cell(x, y)]
    }

    pub(crate) fn set(&mut self, [x, y, _]: [i32; 3], triangle: u32) {
        self.triangles[self.grid.cell(x, y)] = triangle;
    }
}

/// Returns square cells over `bounds` with `wanted` of the points in each.
fn grid_of(bounds: Bounds<2>, points: usize, wanted: f64) -> SquareGrid {
    SquareGrid::new(bounds, (area_of(bounds) * wanted / points.max(1) as f64).sqrt().ceil().max(1.0), 4096.0)
}

/// The points of a block row by row of small cells, to and fro.
pub(crate) struct PointsByPlace {
    /// Those of a sample.
    pub(crate) looked_at: Vec<[i32; 3]>,
    /// The others.
    pub(crate) later: Vec<[i32; 3]>,
}

impl PointsByPlace {
    pub(crate) fn of(points: &[[i32; 3]], bounds: Bounds<2>, sample: Sample) -> PointsByPlace {
        let grid = grid_of(bounds, points.len(), 4.0);
        let columns = grid.columns();
        let key = |(i, cell): (usize, u32)| {
            let (row, column) = (cell as usize / columns, cell as usize % columns);
            let column = if row.is_multiple_of(2) { column } else { columns - 1 - column };
            ((row * columns + column) as u64) << 32 | i as u64
        };
        let mut keys: Vec<u64> = grid.cells_of(points).into_iter().enumerate().map(key).collect();
        radsort::sort_by_key(&mut keys, |key| (key >> 32) as u32);
        let by_place = keys.into_iter().map(|key| points[key as u32 as usize]);
        let (looked_at, later) = by_place.partition(|point| sample.has(*point));
        PointsByPlace { looked_at, later }
    }
}
