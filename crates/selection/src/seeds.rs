//! What the first round triangulates: the corners of the hull of all points, of each cell of a square grid the point nearest to its middle, and
//! points along the outline.

use crate::hull::hull_corners;
use crate::outline::Outline;
use delaunay::geometry::Bounds;
use std::collections::HashMap;

/// A cell has so many points, more or less. With fewer, seeds are a burden where few points are wanted in the end; with more, the first rounds
/// take longer.
const POINTS_PER_CELL: u64 = 16_000;

/// Square cells whose sides are a power of two steps, and which have so many points on average. They begin at zero of the source coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct LatticeCells {
    shift: u32,
    /// The steps in x and y from there to zero of the lattice, less a multiple of the widest cells.
    offset: [i32; 2],
}

/// The cells are no wider than two to the power of this many steps, the widest extent of a lattice.
const MOST_SHIFT: u32 = 30;

impl LatticeCells {
    /// Returns the smallest cells that hold `wanted` of the `points` in `bounds` on average, on a lattice with this `offset`: see
    /// [`crate::PointSource::offset`].
    pub(crate) fn new(bounds: Bounds<2>, points: u64, wanted: u64, offset: [i64; 2]) -> LatticeCells {
        let area = (bounds.extent(0) + 1) as u128 * (bounds.extent(1) + 1) as u128;
        let is_enough = |shift: &u32| u128::from(points) << (2 * shift) >= u128::from(wanted) * area;
        let shift = (0..MOST_SHIFT).find(is_enough).unwrap_or(MOST_SHIFT);
        LatticeCells { shift, offset: offset.map(|offset| offset.rem_euclid(1 << MOST_SHIFT) as i32) }
    }

    /// Returns the column and the row of the cell that `x` and `y` are in.
    pub(crate) fn of(self, x: i32, y: i32) -> [i32; 2] {
        [(x + self.offset[0]) >> self.shift, (y + self.offset[1]) >> self.shift]
    }

    /// Returns the middle of the cell in a column and a row.
    pub(crate) fn middle(self, cell: [i32; 2]) -> [i64; 2] {
        [0, 1].map(|axis| (i64::from(cell[axis]) << self.shift) - i64::from(self.offset[axis]) + self.side() / 2)
    }

    /// Returns the side of a cell.
    pub(crate) fn side(self) -> i64 {
        1 << self.shift
    }

    /// Returns cells of a quarter of the side, or of one step, and how many of them lie along a side of these; `None` if these cells are one step
    /// wide.
    pub(crate) fn finer(self) -> Option<(LatticeCells, i32)> {
        let shift = self.shift.saturating_sub(2);
        (shift < self.shift).then(|| (LatticeCells { shift, ..self }, 1 << (self.shift - shift)))
    }

    /// Returns by what points of a cell are compared: the square of the distance from its middle, and the point.
    fn rank(self, point: [i32; 3]) -> (i64, [i32; 3]) {
        let along = |axis: usize| i64::from(point[axis] + self.offset[axis]).rem_euclid(self.side()) - self.side() / 2;
        (along(0).pow(2) + along(1).pow(2), point)
    }
}

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
    /// Returns no seeds for `points` points in `bounds`, on a lattice with this `offset`.
    pub(crate) fn none(bounds: Bounds<2>, points: u64, offset: [i64; 2]) -> Seeds {
        let cells = LatticeCells::new(bounds, points, POINTS_PER_CELL, offset);
        let outline = Outline::none(bounds, points, offset);
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

    /// Returns all seeds once, in order.
    pub(crate) fn into_points(self) -> Vec<[i32; 3]> {
        let outline = self.outline.points(&self.hull);
        let mut all: Vec<[i32; 3]> =
            self.by_cell.into_values().chain(self.hull).chain(outline).chain(self.fixed).collect();
        all.sort_unstable();
        all.dedup();
        all
    }
}
