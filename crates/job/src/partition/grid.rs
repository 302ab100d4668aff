//! The grid that sorts points into buckets while they are read, and the sums of points by which it is cut into tiles.
//!
//! Its cells differ from those of other grids in the program: they are square in whole lattice steps, and the division that finds
//! the bucket of a point is a multiplication, because it runs for every point that is read.

use crate::partition::tree::Cell;
use delaunay::geometry::{Bounds, Site};

/// A grid of square buckets. A point outside belongs to the nearest bucket.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    origin: Site,
    side: u32,
    /// 2^64 / `side`, rounded up: a 32-bit number times this, shifted right by 64 bits, is its quotient by `side`.
    inverse: u128,
    columns: u32,
    rows: u32,
}

/// A rectangle of buckets: columns `min[0]..max[0]`, rows `min[1]..max[1]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GridSpan {
    min: [u32; 2],
    max: [u32; 2],
}

impl GridSpan {
    /// Returns the least rectangle around both.
    pub fn joined(self, other: GridSpan) -> GridSpan {
        GridSpan {
            min: [0, 1].map(|axis| self.min[axis].min(other.min[axis])),
            max: [0, 1].map(|axis| self.max[axis].max(other.max[axis])),
        }
    }

    /// Returns what both have.
    pub fn shared(self, other: GridSpan) -> GridSpan {
        let min = [0, 1].map(|axis| self.min[axis].max(other.min[axis]));
        GridSpan { min, max: [0, 1].map(|axis| self.max[axis].min(other.max[axis]).max(min[axis])) }
    }

    /// Tells whether the rectangle has all buckets of the other one.
    pub fn holds(self, other: GridSpan) -> bool {
        self.shared(other) == other
    }

    /// Returns the number of buckets.
    pub fn buckets(self) -> u64 {
        [0, 1].map(|axis| u64::from(self.max[axis] - self.min[axis])).iter().product()
    }

    /// Tells whether the rectangles share a bucket.
    pub fn meets(self, other: GridSpan) -> bool {
        (0..2).all(|axis| self.min[axis] < other.max[axis] && other.min[axis] < self.max[axis])
    }
}

impl Grid {
    /// Returns a grid of about `buckets` buckets, and no more, over the lattice points of `bounds`.
    pub fn over(bounds: Bounds<2>, buckets: u64) -> Grid {
        let size = [0, 1].map(|axis| (bounds.extent(axis) + 1) as u64);
        let count = |side: u64| size[0].div_ceil(side) * size[1].div_ceil(side);
        // For a compact rectangle at most twice the ideal side is enough; for a thin one the search goes on.
        let mut side = ((size[0] as f64 * size[1] as f64 / buckets as f64).sqrt() as u64).max(1);
        while count(side) > buckets {
            side += side / 16 + 1;
        }
        Grid {
            origin: bounds.min,
            side: side as u32,
            inverse: (1u128 << 64).div_ceil(side as u128),
            columns: size[0].div_ceil(side) as u32,
            rows: size[1].div_ceil(side) as u32,
        }
    }

    /// Returns the grid of the buckets of `span` alone, numbered in the order of [`Grid::in_span`].
    pub fn within(&self, span: GridSpan) -> Grid {
        let [columns, rows] = [0, 1].map(|axis| span.max[axis] - span.min[axis]);
        Grid { origin: [0, 1].map(|axis| self.line(axis, span.min[axis]) as i32), columns, rows, ..*self }
    }

    /// Returns the number that a bucket has in the grid of the buckets of `span` alone. `None` if it is not one of them.
    pub fn number_within(&self, span: GridSpan, bucket: usize) -> Option<usize> {
        let [column, row] = self.column_and_row(u32::try_from(bucket).ok()?);
        let is_inside = (span.min[0]..span.max[0]).contains(&column) && (span.min[1]..span.max[1]).contains(&row);
        let width = span.max[0] - span.min[0];
        is_inside.then(|| (row - span.min[1]) as usize * width as usize + (column - span.min[0]) as usize)
    }

    fn column_and_row(&self, bucket: u32) -> [u32; 2] {
        [bucket % self.columns, bucket / self.columns]
    }

    /// Returns the number of buckets.
    pub fn buckets(&self) -> usize {
        self.columns as usize * self.rows as usize
    }

    /// Returns the bucket of a lattice point.
    #[inline]
    pub fn bucket(&self, p: Site) -> u32 {
        let place = |axis: usize, count: u32| {
            let along = (p[axis] as i64 - self.origin[axis] as i64).clamp(0, u32::MAX as i64) as u32;
            (((along as u128 * self.inverse) >> 64) as u32).min(count - 1)
        };
        place(1, self.rows) * self.columns + place(0, self.columns)
    }

    /// Returns the rectangle of all buckets.
    pub fn span(&self) -> GridSpan {
        GridSpan { min: [0, 0], max: [self.columns, self.rows] }
    }

    /// Returns `span` with the buckets around it.
    pub fn with_neighbours(&self, span: GridSpan) -> GridSpan {
        let ends = [self.columns, self.rows];
        GridSpan {
            min: span.min.map(|line| line.saturating_sub(1)),
            max: [0, 1].map(|axis| (span.max[axis] + 1).min(ends[axis])),
        }
    }

    /// Returns the bucket numbers of `span`, row by row.
    pub fn in_span(&self, span: GridSpan) -> impl Iterator<Item = usize> {
        let columns = self.columns;
        (span.min[1]..span.max[1])
            .flat_map(move |row| (span.min[0]..span.max[0]).map(move |column| (row * columns + column) as usize))
    }

    /// Returns the rectangle of the buckets of all lattice points of `bounds`.
    pub fn span_of(&self, bounds: Bounds<2>) -> GridSpan {
        let place = |corner: Site| self.column_and_row(self.bucket(corner));
        GridSpan { min: place(bounds.min), max: place(bounds.max).map(|line| line + 1) }
    }

    /// Returns the buckets of the lattice points of `bounds`, each with the box of those that it has.
    pub fn shared_with(&self, bounds: Bounds<2>) -> impl Iterator<Item = (usize, Bounds<2>)> {
        let span = self.span_of(bounds);
        self.in_span(span).map(move |bucket| {
            let lines = self.column_and_row(bucket as u32);
            let mut shared = bounds;
            for (axis, line) in lines.into_iter().enumerate() {
                // The outermost buckets have the points beyond the grid too.
                if line > span.min[axis] {
                    shared.min[axis] = self.line(axis, line) as i32;
                }
                if line + 1 < span.max[axis] {
                    shared.max[axis] = (self.line(axis, line + 1) - 1) as i32;
                }
            }
            (bucket, shared)
        })
    }

    /// Returns the lattice coordinate where row or column `line` begins along `axis`.
    fn line(&self, axis: usize, line: u32) -> i64 {
        self.origin[axis] as i64 + line as i64 * self.side as i64
    }
}

/// The number of points in every rectangle of buckets, by a summed-area table.
pub struct GridSums {
    grid: Grid,
    table: Vec<u64>,
}

impl GridSums {
    /// Builds the table from the number of points in each bucket.
    pub fn new(grid: Grid, points: impl Iterator<Item = u64>) -> GridSums {
        let width = grid.columns as usize + 1;
        let mut table = vec![0; width * (grid.rows as usize + 1)];
        for (bucket, count) in points.enumerate() {
            let (row, column) = (bucket / grid.columns as usize + 1, bucket % grid.columns as usize + 1);
            let at = row * width + column;
            table[at] = count + table[at - 1] + table[at - width] - table[at - width - 1];
        }
        GridSums { grid, table }
    }

    /// Returns the number of points in `span`.
    pub fn points(&self, span: GridSpan) -> u64 {
        let at = |column: u32, row: u32| self.table[row as usize * (self.grid.columns as usize + 1) + column as usize];
        at(span.max[0], span.max[1]) + at(span.min[0], span.min[1])
            - at(span.min[0], span.max[1])
            - at(span.max[0], span.min[1])
    }

    /// Returns `span` without the empty rows and columns on its sides.
    fn trim(&self, mut span: GridSpan) -> GridSpan {
        for axis in 0..2 {
            let with = |min: u32, max: u32| {
                let mut line = span;
                (line.min[axis], line.max[axis]) = (min, max);
                self.points(line)
            };
            let (mut min, mut max) = (span.min[axis], span.max[axis]);
            while max - min > 1 && with(min, min + 1) == 0 {
                min += 1;
            }
            while max - min > 1 && with(max - 1, max) == 0 {
                max -= 1;
            }
            (span.min[axis], span.max[axis]) = (min, max);
        }
        span
    }

    /// Cuts `span` across its longer side where the halves are most nearly equal. Each half holds points, and the two cells divide
    /// `cell`. Returns `None` if all points are in one bucket.
    pub fn cut(&self, span: GridSpan, cell: Cell) -> Option<[(GridSpan, Cell); 2]> {
        self.halve(self.trim(span), cell)
    }

    /// As [`GridSums::cut`], but the halves have all buckets of `span`, and either may be empty.
    pub fn halve(&self, span: GridSpan, cell: Cell) -> Option<[(GridSpan, Cell); 2]> {
        let lines = [0, 1].map(|axis| span.max[axis] - span.min[axis]);
        let axis = if lines[0] >= lines[1] { 0 } else { 1 };
        if lines[axis] < 2 {
            return None;
        }
        let below = |line: u32| {
            let mut low = span;
            low.max[axis] = line;
            low
        };
        let total = self.points(span);
        let line =
            (span.min[axis] + 1..span.max[axis]).min_by_key(|&line| (2 * self.points(below(line))).abs_diff(total))?;
        let mut high = span;
        high.min[axis] = line;
        let [low_cell, high_cell] = cell.cut(axis, self.grid.line(axis, line));
        Some([(below(line), low_cell), (high, high_cell)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn over(min: Site, max: Site, buckets: u64) -> Grid {
        Grid::over(Bounds { min, max }, buckets)
    }

    #[test]
    fn a_grid_keeps_within_its_number_of_buckets_and_takes_points_outside_at_its_border() {
        let grid = over([0, 0], [999, 99], 50);
        assert!(grid.buckets() <= 50 && grid.buckets() >= 20, "{grid:?}");
        assert_eq!(grid.bucket([-5, -5]), 0);
        assert_eq!(grid.bucket([i32::MAX, i32::MAX]) as usize, grid.buckets() - 1);
        assert_eq!(over([3, 3], [3, 3], 100).buckets(), 1);
        assert!(over([0, 0], [1 << 30, 0], 1000).buckets() <= 1000);
    }

    #[test]
    fn a_part_of_a_grid_has_the_same_buckets_with_other_numbers() {
        let grid = over([-7, 3], [92, 82], 77);
        let span = grid.span_of(Bounds { min: [10, 20], max: [60, 50] });
        let within = grid.within(span);
        assert_eq!(within.buckets() as u64, span.buckets());
        for (number, bucket) in grid.in_span(span).enumerate() {
            assert_eq!(grid.number_within(span, bucket), Some(number));
        }
        let inside = |bucket: usize| grid.in_span(span).any(|other| other == bucket);
        for place in (-7..93).flat_map(|x| (3..83).map(move |y| [x, y])) {
            let bucket = grid.bucket(place) as usize;
            let number = inside(bucket).then(|| within.bucket(place) as usize);
            assert_eq!(grid.number_within(span, bucket), number, "{place:?}");
        }
        assert!(grid.span().holds(span) && !span.holds(grid.span()) && span.joined(grid.span()) == grid.span());
        let wider = grid.with_neighbours(span);
        let lines = |span: GridSpan| [0, 1].map(|axis| u64::from(span.max[axis] - span.min[axis]));
        assert_eq!(wider.buckets(), lines(span).map(|lines| lines + 2).iter().product::<u64>());
        assert_eq!(grid.with_neighbours(grid.span()), grid.span());
        let below = GridSpan { min: [0, 0], max: span.min };
        assert_eq!((span.shared(below).buckets(), span.meets(below)), (0, false));
    }

    #[test]
    fn the_multiplication_divides_exactly() {
        for side in [1, 2, 3, 7, 255, 256, 1000, 65_537, (1 << 30) - 1, 1 << 30] {
            let grid = Grid {
                origin: [0, 0],
                side,
                inverse: (1u128 << 64).div_ceil(side as u128),
                columns: u32::MAX,
                rows: 1,
            };
            for multiple in [0, 1, 2, (i32::MAX as u32 / side).saturating_sub(1), i32::MAX as u32 / side] {
                for along in [(multiple * side).saturating_sub(1), multiple * side, (multiple * side).saturating_add(1)]
                {
                    let along = along.min(i32::MAX as u32);
                    assert_eq!(grid.bucket([along as i32, 0]), along / side, "{along} by {side}");
                }
            }
        }
    }

    #[test]
    fn cuts_divide_the_points_until_one_bucket_is_left() {
        let grid = over([0, 0], [9, 9], 100);
        let mut counts = vec![0; 100];
        for p in [[2, 3], [2, 3], [7, 3], [7, 8]] {
            counts[grid.bucket(p) as usize] += 1;
        }
        let sums = GridSums::new(grid, counts.into_iter());
        assert_eq!(sums.points(grid.span()), 4);
        let [(low, low_cell), (high, high_cell)] = sums.cut(grid.span(), Cell::PLANE).unwrap();
        assert_eq!((sums.points(low), sums.points(high)), (2, 2));
        assert_eq!(low_cell.max[0], high_cell.min[0]);
        assert!((3..=7).contains(&low_cell.max[0]));
        assert!(sums.cut(low, low_cell).is_none());
        assert!(sums.cut(high, high_cell).is_some());
    }
}
