//! Which triangles of the finished mesh are left out of the terrain, for being long: `[output] max_edge`.
//!
//! What is decided of a triangle depends on the mesh and the sites alone, so that neither the cut into tiles nor the order
//! of anything changes it. The triangles that are left out go to `cut/`, so that nothing of the exact mesh is lost.

use crate::Result;
use crate::job::durable::store::Store;
use crate::job::records::Leaf;
use crate::output::frame::Frame;
use crate::output::options::MaxEdge;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, Ordering};

/// With "auto", edges may be this many times as long as sites are apart around the triangle.
const SPACINGS: u128 = 10;

/// With "auto", a cell has so many sites on average.
const SITES_PER_CELL: u128 = 256;

/// And there are at most this many cells.
const MOST_CELLS: u64 = 1 << 22;

/// The rule by which triangles are left out.
#[derive(Debug, Default)]
pub enum Cut {
    /// None are.
    #[default]
    Nothing,
    /// Those with an edge whose square is greater, in square lattice steps.
    Longer(u64),
    /// Those with an edge much longer than the spacing of the sites where they lie.
    Wider(Spacing),
}

impl Cut {
    /// The rule that the user has chosen, for so many tiles and sites in `store`, whose bounds are these in lattice steps.
    ///
    /// # Errors
    /// [`crate::Error::Io`] or [`crate::Error::Broken`] on the store.
    pub fn new(choice: MaxEdge, frame: &Frame, store: &Store, count: [u64; 2], bounds: [[i32; 3]; 2]) -> Result<Cut> {
        Ok(match choice {
            MaxEdge::None => Cut::Nothing,
            MaxEdge::Length(length) => {
                let steps = length / frame.extras().resolution;
                // A length that is a whole number of steps as a decimal may be a little less in binary.
                Cut::Longer((steps * steps * (1.0 + 1e-12)) as u64)
            }
            MaxEdge::Auto => Cut::Wider(Spacing::new(store, count, bounds)?),
        })
    }

    /// Whether nothing is left out, whatever comes.
    pub fn is_nothing(&self) -> bool {
        matches!(self, Cut::Nothing)
    }

    /// Whether the triangle between these lattice points is left out. Only the plane counts, not the heights.
    #[inline]
    pub fn leaves_out(&self, corners: [[i32; 3]; 3]) -> bool {
        match self {
            Cut::Nothing => false,
            Cut::Longer(limit) => longest(corners) > *limit,
            Cut::Wider(spacing) => spacing.exceeds(longest(corners), corners),
        }
    }

    /// Takes the triangles that are left out from `triangles` and returns them; both stay in order.
    pub fn take(&self, positions: &[[i32; 3]], triangles: &mut Vec<[u32; 3]>) -> Vec<[u32; 3]> {
        if self.is_nothing() {
            return Vec::new();
        }
        let (out, kept) = triangles.iter().partition(|t| self.leaves_out(t.map(|v| positions[v as usize])));
        *triangles = kept;
        out
    }
}

/// The square of the longest edge in the plane; below 2^62.
#[inline]
fn longest([a, b, c]: [[i32; 3]; 3]) -> u64 {
    let square = |p: [i32; 3], q: [i32; 3]| {
        let [dx, dy] = [0, 1].map(|k| (p[k] as i64 - q[k] as i64).unsigned_abs());
        dx * dx + dy * dy
    };
    square(a, b).max(square(b, c)).max(square(c, a))
}

/// How far sites are apart, by place: the bounding box of all sites is laid out with square cells, and in a cell with n
/// sites the spacing is the square root of the cell's area over n. A cell at the rim of a void has few sites because most of it is
/// void, so each counts as many as the fullest of its neighbours.
#[derive(Debug)]
pub struct Spacing {
    corner: [i64; 2],
    /// Lattice steps.
    side: i64,
    columns: usize,
    /// Sites by cell, row by row; once all are counted, the most in a cell and the eight around it.
    counts: Vec<u32>,
}

impl Spacing {
    fn new(store: &Store, [tiles, sites]: [u64; 2], bounds: [[i32; 3]; 2]) -> Result<Spacing> {
        let mut spacing = Spacing::empty(bounds, sites);
        let counts: Vec<AtomicU32> = spacing.counts.iter().map(|_| AtomicU32::new(0)).collect();
        (0..tiles).into_par_iter().try_for_each(|tile| {
            for &position in &Leaf::load(store, tile as usize)?.positions {
                counts[spacing.cell(position)].fetch_add(1, Ordering::Relaxed);
            }
            Ok(())
        })?;
        spacing.counts = counts.into_iter().map(AtomicU32::into_inner).collect();
        spacing.spread();
        Ok(spacing)
    }

    /// Gives every cell the count of the fullest of its neighbours and itself: first along rows, then along columns.
    fn spread(&mut self) {
        let columns = self.columns;
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

    /// Cells for so many sites within these bounds.
    fn empty([low, high]: [[i32; 3]; 2], sites: u64) -> Spacing {
        let [width, height] = [0, 1].map(|k| (high[k] as i64 - low[k] as i64 + 1) as u64);
        let area = width as u128 * height as u128 * SITES_PER_CELL / sites.max(1) as u128;
        let mut side = (area.isqrt() as u64).max(1);
        while width.div_ceil(side).saturating_mul(height.div_ceil(side)) > MOST_CELLS {
            side *= 2;
        }
        let [columns, rows] = [width, height].map(|extent| extent.div_ceil(side) as usize);
        Spacing { corner: [low[0] as i64, low[1] as i64], side: side as i64, columns, counts: vec![0; columns * rows] }
    }

    fn cell(&self, position: [i32; 3]) -> usize {
        let [column, row] = [0, 1].map(|k| ((position[k] as i64 - self.corner[k]) / self.side) as usize);
        row * self.columns + column
    }

    /// Whether an edge with this square is longer than [`SPACINGS`] times the widest spacing at the corners.
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
    fn lengths_are_meant_as_they_are_written() {
        let corners = |length| [[0, 0, 0], [length, 0, 9_999], [1, 2, -7]];
        // 0.3 / 0.1 is a little less than 3 in binary.
        let steps: f64 = 0.3 / 0.1;
        let cut = Cut::Longer((steps * steps * (1.0 + 1e-12)) as u64);
        assert!(!cut.leaves_out(corners(3)) && cut.leaves_out(corners(4)));
        let reach = 1 << 29;
        let widest = [[-reach, -reach, 0], [reach, reach, 0], [-reach, reach, 0]];
        assert!(!Cut::Longer(u64::MAX).leaves_out(widest) && Cut::Longer(1 << 60).leaves_out(widest));
    }

    #[test]
    fn spacing_is_that_of_the_place() {
        // Sites 10 steps apart in the west, 40 in the east.
        let place = |i: i32, step: i32, west: i32| [west + i % 100 * step, i / 100 * step, 0];
        let dense = (0..40_000).map(|i| place(i, 10, 0));
        let sites: Vec<[i32; 3]> = dense.chain((0..10_000).map(|i| place(i, 40, 1_000))).collect();
        let mut spacing = Spacing::empty([[0, 0, 0], [4_960, 3_990, 0]], sites.len() as u64);
        for &site in &sites {
            let cell = spacing.cell(site);
            spacing.counts[cell] += 1;
        }
        // The field's own rim: a cell that it hardly reaches counts like the full one beside it.
        let (full, rim) = (spacing.cell([200, 2_000, 0]), spacing.cell([200, 3_989, 0]));
        assert!(spacing.counts[rim] < spacing.counts[full] * 9 / 10);
        spacing.spread();
        assert!(spacing.counts[rim] >= spacing.counts[full] * 9 / 10);
        let cut = Cut::Wider(spacing);
        let long = |x: i32, length: i32| [[x, 2_000, 0], [x + length, 2_000, 0], [x, 2_010, 0]];
        assert!(!cut.leaves_out(long(200, 90)) && cut.leaves_out(long(200, 120)));
        assert!(!cut.leaves_out(long(3_000, 360)) && cut.leaves_out(long(3_000, 480)));
        // From the dense part into the sparse one what is usual there stays.
        assert!(!cut.leaves_out(long(940, 90)));
    }
}
