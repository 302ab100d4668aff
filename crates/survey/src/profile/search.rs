//! What runs of segments meet in the tiles.

use super::line_segments::{FineLattice, LineSegment};
use overlay::{Crossing, Point, Rectangle, Segment, crossings};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};
use sys::{Result, interrupt};
use terrain::LatticePart;

/// Columns and rows of the grid in which segments are looked for.
const CELLS: usize = 128;

/// The number of a segment, and what it meets: in the order of the segments, and along each.
type Found = Vec<(usize, Crossing)>;

/// Reads the tile of a number.
pub(super) type ReadTile<'a> = dyn Fn(usize) -> Result<Vec<LatticePart>> + Sync + 'a;

/// Finds what segments meet in a terrain.
pub(super) struct Search<'a> {
    read: &'a ReadTile<'a>,
    segments: &'a [LineSegment],
    /// The bounds of each tile that has been read, on the fine lattice.
    bounds: Vec<OnceLock<Rectangle>>,
}

/// What the threads of a run share.
struct Run<'a> {
    search: &'a Search<'a>,
    numbers: Range<usize>,
    /// The bounds of the segments.
    around: Rectangle,
    /// The most crossings; any number if there is but one segment.
    most: usize,
    /// The number of the next tile.
    next: AtomicUsize,
    /// The number of crossings so far.
    held: AtomicUsize,
}

impl<'a> Search<'a> {
    /// Returns a search among so many tiles.
    pub(super) fn new(tiles: usize, read: &'a ReadTile<'a>, segments: &'a [LineSegment]) -> Search<'a> {
        Search { read, segments, bounds: (0..tiles).map(|_| OnceLock::new()).collect() }
    }

    /// Calls `visit` with each segment and what it meets, in the order of the segments. At most `most` crossings are held, unless one segment
    /// has more.
    ///
    /// # Errors
    /// Those of `visit` and of [`Search::run`].
    pub(super) fn each(
        &self,
        most: usize,
        mut visit: impl FnMut(&LineSegment, &[(usize, Crossing)]) -> Result<()>,
    ) -> Result<()> {
        let (mut from, mut length) = (0, self.segments.len());
        while from < self.segments.len() {
            let until = from.saturating_add(length).min(self.segments.len());
            let Some(found) = self.run(from..until, most)? else {
                length = (until - from) / 2;
                continue;
            };
            if found.len() < most / 4 {
                length = length.saturating_mul(2);
            }
            let mut of_segments = found.chunk_by(|a, b| a.0 == b.0).peekable();
            for (number, segment) in (from..until).zip(&self.segments[from..until]) {
                visit(segment, of_segments.next_if(|group| group[0].0 == number).unwrap_or_default())?;
            }
            from = until;
        }
        Ok(())
    }

    /// Returns what the segments with these numbers meet; `None` if they are several, and meet more than `most`.
    ///
    /// # Errors
    /// [`sys::Error::Input`] if a tile is not as the job wrote it, [`sys::Error::Io`], [`sys::Error::Interrupted`].
    fn run(&self, numbers: Range<usize>, most: usize) -> Result<Option<Found>> {
        let around = Rectangle::around(self.segments[numbers.clone()].iter().flat_map(|segment| segment.ends));
        let most = if numbers.len() > 1 { most } else { usize::MAX };
        let run = Run { search: self, numbers, around, most, next: AtomicUsize::new(0), held: AtomicUsize::new(0) };
        let lanes = 0..rayon::current_num_threads();
        let found = lanes.into_par_iter().map(|_| run.read_tiles()).try_reduce(Vec::new, |mut all, more| {
            all.extend(more);
            Ok(all)
        })?;
        Ok((!run.is_over()).then(|| in_order(found)))
    }
}

impl Run<'_> {
    fn is_over(&self) -> bool {
        self.held.load(Ordering::Relaxed) > self.most
    }

    /// Reads tiles as long as there are some, and the run has not met too much.
    fn read_tiles(&self) -> Result<Found> {
        let mut found = Vec::new();
        loop {
            let number = self.next.fetch_add(1, Ordering::Relaxed);
            let Some(bounds) = self.search.bounds.get(number).filter(|_| !self.is_over()) else { return Ok(found) };
            if bounds.get().is_some_and(|bounds| !bounds.meets(&self.around)) {
                continue;
            }
            interrupt::check()?;
            let parts = (self.search.read)(number)?;
            let of_tile = self.found_in(&parts, bounds);
            self.held.fetch_add(of_tile.len(), Ordering::Relaxed);
            found.extend(of_tile);
        }
    }

    fn found_in(&self, parts: &[LatticePart], bounds: &OnceLock<Rectangle>) -> Found {
        let points: Vec<Vec<Point>> =
            parts.iter().map(|part| part.points.iter().map(|point| FineLattice::point(*point)).collect()).collect();
        let bounds = bounds.get_or_init(|| Rectangle::around(points.iter().flatten().map(|p| [p[0], p[1]])));
        let segments = self.search.segments;
        let cells = SegmentCells::new(*bounds, segments, self.numbers.clone());
        let mut found = Vec::new();
        for (part, points) in parts.iter().zip(&points) {
            for triangle in &part.triangles {
                let corners = triangle.map(|v| points[v as usize]);
                cells.near(&corners, |segment| {
                    crossings(&corners, &segments[segment].ends, |crossing| found.push((segment, crossing)));
                });
            }
        }
        in_order(found)
    }
}

/// Sorts what was found, and joins what several triangles have found at one place.
fn in_order(mut found: Found) -> Found {
    found.sort_unstable_by(|(a, first), (b, second)| {
        a.cmp(b).then_with(|| first.part.order(second.part)).then_with(|| first.met.cmp(&second.met))
    });
    found.dedup_by(|(segment, crossing), (last, before)| {
        let is_same = last == segment && before.met == crossing.met;
        before.is_covered_after |= is_same && crossing.is_covered_after;
        is_same
    });
    found
}

/// The segments in the cells of a grid over a tile.
struct SegmentCells {
    bounds: Rectangle,
    /// The side of a cell.
    side: i64,
    cells: Vec<Vec<usize>>,
}

impl SegmentCells {
    /// Puts the segments with these numbers into cells.
    fn new(bounds: Rectangle, segments: &[LineSegment], numbers: Range<usize>) -> SegmentCells {
        let side = bounds.max[0].saturating_sub(bounds.min[0]).max(bounds.max[1].saturating_sub(bounds.min[1]));
        let mut cells = SegmentCells { bounds, side: side / CELLS as i64 + 1, cells: vec![Vec::new(); CELLS * CELLS] };
        for (number, segment) in numbers.clone().zip(&segments[numbers]) {
            if Rectangle::around(segment.ends).meets(&bounds) {
                cells.add(number, segment.ends);
            }
        }
        cells
    }

    fn place(&self, coordinate: i64, axis: usize) -> usize {
        let cell = (coordinate - self.bounds.min[axis]).div_euclid(self.side);
        usize::try_from(cell).unwrap_or(0).min(CELLS - 1)
    }

    /// Adds a segment to the cells that it may meet.
    fn add(&mut self, number: usize, ends: Segment) {
        // Rounding is made up for by some steps.
        const MARGIN: f64 = 2.0;
        let [low, high] = if ends[0][1] <= ends[1][1] { ends } else { [ends[1], ends[0]] };
        let [from, to] = [low, high].map(|end| end.map(|value| value as f64));
        for row in self.place(low[1], 1)..=self.place(high[1], 1) {
            let south = self.bounds.min[1] + row as i64 * self.side;
            let within = [south as f64 - MARGIN, (south + self.side) as f64 + MARGIN];
            let at = |y: f64| from[0] + (to[0] - from[0]) * ((y - from[1]) / (to[1] - from[1]));
            let xs = match to[1] > from[1] {
                true => within.map(|y| at(y.clamp(from[1], to[1]))),
                false => [from[0], to[0]],
            };
            let [west, east] = [xs[0].min(xs[1]) - MARGIN, xs[0].max(xs[1]) + MARGIN];
            for column in self.place(west as i64, 0)..=self.place(east as i64, 0) {
                self.cells[row * CELLS + column].push(number);
            }
        }
    }

    /// Calls `visit` with the segments that may meet a triangle, with some of them more than once.
    fn near(&self, corners: &[Point; 3], mut visit: impl FnMut(usize)) {
        let around = Rectangle::around(corners.map(|[x, y, _]| [x, y]));
        let range = |axis: usize| self.place(around.min[axis], axis)..=self.place(around.max[axis], axis);
        for row in range(1) {
            for column in range(0) {
                self.cells[row * CELLS + column].iter().for_each(|segment| visit(*segment));
            }
        }
    }
}
