//! Which triangles are left out of the terrain because they are long: `[output] max_edge`.
//!
//! The decision about a triangle depends on the triangle and on the sites alone, so neither the tiles nor the order of the work can
//! change it. Triangles that are left out go to `cut/`: nothing of the exact mesh is lost.

use delaunay::geometry::Bounds;
use delaunay::geometry::square_grid::SquareGrid;
use std::sync::atomic::{AtomicU32, Ordering};
use sys::{Error, Result};
use tiles::frame::Frame;
use tiles::options::MaxEdge;

/// With "auto", the longest edge is this many times the spacing of the sites around the triangle.
const SPACINGS: u128 = 10;

/// With "auto", the average number of sites in a cell.
const SITES_PER_CELL: u128 = 256;

/// With "auto", the largest number of cells.
const MAX_CELLS: u64 = 1 << 22;

/// Calls a function with the position of every site, on any thread and in any order.
pub(crate) type VisitSites<'a> = &'a dyn Fn(&(dyn Fn(&[i32; 3]) + Sync)) -> Result<()>;

/// The rule that leaves triangles out.
#[derive(Debug, Default)]
pub(crate) enum MaxEdgeRule {
    /// It keeps all.
    #[default]
    KeepAll,
    /// It leaves out triangles with an edge whose square, in square lattice steps, is greater.
    Length(u64),
    /// It leaves out triangles with an edge much longer than the spacing of the sites around.
    Spacing(SiteSpacing),
}

impl MaxEdgeRule {
    /// Returns the rule that the user chose. `visit_sites` visits all `sites`, which are within `bounds`; only "auto" calls it.
    ///
    /// # Errors
    /// Those of `visit_sites`.
    pub(crate) fn new(
        choice: MaxEdge,
        frame: &Frame,
        sites: u64,
        bounds: Bounds<3>,
        visit_sites: VisitSites,
    ) -> Result<MaxEdgeRule> {
        match choice {
            MaxEdge::None => Ok(MaxEdgeRule::KeepAll),
            MaxEdge::Length(length) => {
                let steps = length / frame.extras().resolution;
                // A length that is a whole number of steps in decimal may be a little less in binary.
                Ok(MaxEdgeRule::Length((steps * steps * (1.0 + 1e-12)) as u64))
            }
            MaxEdge::Auto => SiteSpacing::measure(sites, bounds, visit_sites).map(MaxEdgeRule::Spacing),
        }
    }

    /// Returns the rule "auto" of a job that has counted its sites: all `sites`, which are within `bounds`, gave these `counts`.
    ///
    /// # Errors
    /// [`Error::Broken`] if they are those of another job.
    pub(crate) fn of_counts(sites: u64, bounds: Bounds<3>, counts: Vec<u32>) -> Result<MaxEdgeRule> {
        let empty = SiteSpacing::empty(bounds, sites);
        match counts.len() == empty.counts.len() {
            true => Ok(MaxEdgeRule::Spacing(SiteSpacing { counts, ..empty })),
            false => Err(Error::Broken("the sites were counted in other cells".into())),
        }
    }

    /// Returns what [`MaxEdgeRule::of_counts`] takes. A rule that looks at no sites has none.
    pub(crate) fn counts(&self) -> &[u32] {
        match self {
            MaxEdgeRule::Spacing(spacing) => &spacing.counts,
            MaxEdgeRule::KeepAll | MaxEdgeRule::Length(_) => &[],
        }
    }

    /// Tells whether the rule leaves out nothing at all.
    pub(crate) fn keeps_all(&self) -> bool {
        matches!(self, MaxEdgeRule::KeepAll)
    }

    /// Tells whether the triangle with these corners is left out. Heights do not count.
    #[inline]
    pub(crate) fn leaves_out(&self, corners: [[i32; 3]; 3]) -> bool {
        match self {
            MaxEdgeRule::KeepAll => false,
            MaxEdgeRule::Length(limit) => longest_square(corners) > *limit,
            MaxEdgeRule::Spacing(spacing) => spacing.exceeds(longest_square(corners), corners),
        }
    }
}

/// Returns the square of the longest edge in the plane, which is below 2^62.
#[inline]
fn longest_square([a, b, c]: [[i32; 3]; 3]) -> u64 {
    let square = |p: [i32; 3], q: [i32; 3]| {
        let [dx, dy] = [0, 1].map(|k| (p[k] as i64 - q[k] as i64).unsigned_abs());
        dx * dx + dy * dy
    };
    square(a, b).max(square(b, c)).max(square(c, a))
}

/// The spacing of the sites by place. Square cells cover the box of all sites, and in a cell with n sites the spacing is the square
/// root of the cell's area divided by n. A cell at the edge of a void has few sites because most of it is void, so each cell takes
/// the count of the fullest of itself and its neighbours.
#[derive(Debug)]
pub(crate) struct SiteSpacing {
    grid: SquareGrid,
    /// The side of a cell in lattice steps.
    side: i64,
    /// The number of sites in each cell, row by row; after [`SiteSpacing::spread`], the most in the cell and the eight around it.
    counts: Vec<u32>,
}

impl SiteSpacing {
    /// Counts all sites.
    fn measure(sites: u64, bounds: Bounds<3>, visit_sites: VisitSites) -> Result<SiteSpacing> {
        let mut spacing = SiteSpacing::empty(bounds, sites);
        let counts: Vec<AtomicU32> = spacing.counts.iter().map(|_| AtomicU32::new(0)).collect();
        visit_sites(&|&position| {
            counts[spacing.cell(position)].fetch_add(1, Ordering::Relaxed);
        })?;
        spacing.counts = counts.into_iter().map(AtomicU32::into_inner).collect();
        spacing.spread();
        Ok(spacing)
    }

    /// Gives every cell the count of the fullest of itself and its neighbours: first along rows, then along columns.
    fn spread(&mut self) {
        let columns = self.grid.columns();
        for row in self.counts.chunks_exact_mut(columns) {
            let mut before = 0;
            for at in 0..columns {
                let (here, after) = (row[at], row.get(at + 1).copied().unwrap_or(0));
                row[at] = here.max(before).max(after);
                before = here;
            }
        }
        for column in 0..columns {
            let mut before = 0;
            for at in (column..self.counts.len()).step_by(columns) {
                let (here, after) = (self.counts[at], self.counts.get(at + columns).copied().unwrap_or(0));
                self.counts[at] = here.max(before).max(after);
                before = here;
            }
        }
    }

    /// Returns cells for `sites` sites within `bounds`, all empty.
    fn empty(bounds: Bounds<3>, sites: u64) -> SiteSpacing {
        let [width, height] = [0, 1].map(|axis| (bounds.extent(axis) + 1) as u64);
        let area = width as u128 * height as u128 * SITES_PER_CELL / sites.max(1) as u128;
        let mut side = (area.isqrt() as u64).max(1);
        while width.div_ceil(side).saturating_mul(height.div_ceil(side)) > MAX_CELLS {
            side *= 2;
        }
        let [min, max] = [bounds.min, bounds.max].map(|[x, y, _]| [x, y]);
        let grid = SquareGrid::new(Bounds { min, max }, side as f64, f64::INFINITY);
        SiteSpacing { grid, side: side as i64, counts: vec![0; grid.cells()] }
    }

    fn cell(&self, position: [i32; 3]) -> usize {
        self.grid.cell(position[0], position[1])
    }

    /// Tells whether an edge with this square is longer than [`SPACINGS`] times the widest spacing at the corners.
    fn exceeds(&self, square: u64, corners: [[i32; 3]; 3]) -> bool {
        let [a, b, c] = corners.map(|corner| self.counts[self.cell(corner)]);
        let cell = (self.side * self.side) as u128;
        square as u128 * a.min(b).min(c) as u128 > SPACINGS * SPACINGS * cell
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_mean_what_is_written() {
        let corners = |length| [[0, 0, 0], [length, 0, 9_999], [1, 2, -7]];
        // 0.3 / 0.1 is a little less than 3 in binary.
        let steps: f64 = 0.3 / 0.1;
        let cut = MaxEdgeRule::Length((steps * steps * (1.0 + 1e-12)) as u64);
        assert!(!cut.leaves_out(corners(3)) && cut.leaves_out(corners(4)));
        let reach = 1 << 29;
        let widest = [[-reach, -reach, 0], [reach, reach, 0], [-reach, reach, 0]];
        assert!(!MaxEdgeRule::Length(u64::MAX).leaves_out(widest) && MaxEdgeRule::Length(1 << 60).leaves_out(widest));
    }

    #[test]
    fn spacing_depends_on_the_place() {
        // Sites 10 steps apart in the west, 40 in the east.
        let place = |i: i32, step: i32, west: i32| [west + i % 100 * step, i / 100 * step, 0];
        let dense = (0..40_000).map(|i| place(i, 10, 0));
        let sites: Vec<[i32; 3]> = dense.chain((0..10_000).map(|i| place(i, 40, 1_000))).collect();
        let mut spacing = SiteSpacing::empty(Bounds { min: [0, 0, 0], max: [4_960, 3_990, 0] }, sites.len() as u64);
        for &site in &sites {
            let cell = spacing.cell(site);
            spacing.counts[cell] += 1;
        }
        // At the edge of the field: a cell that it hardly reaches counts like the full one next to it.
        let (full, edge) = (spacing.cell([200, 2_000, 0]), spacing.cell([200, 3_989, 0]));
        assert!(spacing.counts[edge] < spacing.counts[full] * 9 / 10);
        spacing.spread();
        assert!(spacing.counts[edge] >= spacing.counts[full] * 9 / 10);
        let cut = MaxEdgeRule::Spacing(spacing);
        let long = |x: i32, length: i32| [[x, 2_000, 0], [x + length, 2_000, 0], [x, 2_010, 0]];
        assert!(!cut.leaves_out(long(200, 90)) && cut.leaves_out(long(200, 120)));
        assert!(!cut.leaves_out(long(3_000, 360)) && cut.leaves_out(long(3_000, 480)));
        // From the dense part into the sparse one, the spacing of the sparse part counts.
        assert!(!cut.leaves_out(long(940, 90)));
    }
}
