//! What the first round triangulates: the corners of the hull of all points, of each cell of a square grid the point nearest to its middle, and
//! points along the outline.

use crate::hull::hull_corners;
use crate::lattice_cells::LatticeCells;
use crate::outline::{MarkedCells, Outline};
use crate::sample::Samples;
use delaunay::geometry::Bounds;
use std::collections::HashMap;

/// A cell has so many points, or up to four times as many. With fewer, seeds are a burden where few points are wanted in the end; with more, the first
/// rounds take longer.
const POINTS_PER_CELL: u64 = 16_000;
/// The same for clouds that are selected from without samples.
const POINTS_PER_CELL_UNSAMPLED: u64 = 64_000;

/// Seeds of a block, or of several.
#[derive(Clone, Debug)]
pub(crate) struct Seeds {
    cells: LatticeCells,
    hull: Vec<[i32; 3]>,
    by_cell: HashMap<[i32; 2], [i32; 3]>,
    outline: Outline,
    fixed: Vec<[i32; 3]>,
}

impl Seeds {
    /// Returns no seeds for rounds with these `samples` of `points` points in `bounds`, on a lattice with this `offset`. The outline is looked for in
    /// `cells_of_outline`.
    pub(crate) fn none(
        samples: Samples,
        bounds: Bounds<2>,
        points: u64,
        offset: [i64; 2],
        cells_of_outline: &MarkedCells,
    ) -> Seeds {
        let wanted = if samples == Samples::Unneeded { POINTS_PER_CELL_UNSAMPLED } else { POINTS_PER_CELL };
        let cells = LatticeCells::new(bounds, points, wanted, offset);
        let outline = Outline::none(cells_of_outline);
        Seeds { cells, hull: Vec::new(), by_cell: HashMap::new(), outline, fixed: Vec::new() }
    }

    /// Adds the points of a block, of which those that are `fixed` are seeds in any case.
    pub(crate) fn add(&mut self, points: &[[i32; 3]], fixed: &[[i32; 3]]) {
        let cells = self.cells;
        let cell = |[x, y, _]: [i32; 3]| cells.of(x, y);
        // Neighbours one after the other mostly lie in one cell.
        for points in points.chunk_by(|a, b| cell(*a) == cell(*b)) {
            points.iter().copied().min_by_key(|&p| cells.rank(p)).into_iter().for_each(|point| self.offer(point));
        }
        self.hull = hull_corners(points.iter().chain(&self.hull).copied().collect());
        self.outline.add(points);
        self.fixed.extend(fixed);
    }

    fn offer(&mut self, point: [i32; 3]) {
        let cells = self.cells;
        let nearest = self.by_cell.entry(cells.of(point[0], point[1])).or_insert(point);
        *nearest = std::cmp::min_by_key(*nearest, point, |&p| cells.rank(p));
    }

    /// Adds the seeds of other blocks.
    pub(crate) fn join(mut self, other: Seeds) -> Seeds {
        other.by_cell.into_values().for_each(|point| self.offer(point));
        self.hull = hull_corners([self.hull, other.hull].concat());
        self.outline.join(other.outline);
        self.fixed.extend(other.fixed);
        self
    }

    /// Returns the corners of the hull.
    pub(crate) fn hull(&self) -> &[[i32; 3]] {
        &self.hull
    }

    /// Returns the bays of a cloud with these `cells`, none of which is marked, if all of its points have been added.
    pub(crate) fn bays(&self, mut cells: MarkedCells) -> MarkedCells {
        self.outline.mark(&mut cells);
        cells.bays(&self.hull)
    }

    /// Returns all seeds once, in order, those along these `bays` among them.
    pub(crate) fn into_points(self, bays: &MarkedCells) -> Vec<[i32; 3]> {
        let outline = self.outline.points(bays);
        let mut all: Vec<[i32; 3]> =
            self.by_cell.into_values().chain(self.hull).chain(outline).chain(self.fixed).collect();
        all.sort_unstable();
        all.dedup();
        all
    }
}
