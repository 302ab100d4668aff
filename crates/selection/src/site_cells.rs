//! Selected points in memory, by the cell of a grid that they lie in. A cell with many has a grid of its own.

use crate::area::Area;
use crate::lattice_cells::LatticeCells;
use crate::source::BYTES_PER_LISTED;
use delaunay::geometry::Bounds;
use std::ops::{ControlFlow, Range};

/// A cell has so many points of the cloud on average, more or less.
const POINTS_PER_CELL: u64 = 256;
/// There are no more columns and rows.
const MOST_LINES: i64 = 1 << 13;
/// There are no more cells, of a cloud of however many points.
const MOST_CELLS: u64 = 1 << 18;
/// So many points are handed over at a time, or more.
const TAKEN_AT_ONCE: usize = 1 << 13;
/// A cell with more selected points is divided: whatever is near looks at all of them.
const MOST_PER_CELL: usize = POINTS_PER_CELL as usize / 2;

/// Selected points of a cloud.
#[derive(Debug)]
pub(crate) struct SiteCells {
    cells: LatticeCells,
    /// The column and the row of the first cell.
    first: [i32; 2],
    columns: usize,
    rows: usize,
    points: Vec<CellSites>,
    count: u64,
    /// The cells that have points which were added last.
    grown: Vec<u32>,
    /// A bit for each cell that tells whether it is one of them: most queries are for such points, and most cells have none.
    is_grown: Vec<u64>,
}

/// The selected points of a cell.
#[derive(Debug, Default)]
struct CellSites {
    points: Vec<[i32; 3]>,
    /// The number of those that were not added last.
    known: u32,
    /// If the cell is divided, the points are here instead.
    divided: Option<Box<SiteCells>>,
}

impl CellSites {
    /// Returns those that were added last.
    fn newly(&self) -> &[[i32; 3]] {
        &self.points[self.known as usize..]
    }

    fn append_to(&self, points: &mut Vec<[i32; 3]>) {
        points.extend(&self.points);
        self.divided.iter().flat_map(|divided| &divided.points).for_each(|cell| cell.append_to(points));
    }

    fn settle(&mut self) {
        self.known = self.points.len() as u32;
        if let Some(divided) = &mut self.divided {
            divided.settle();
        }
    }

    /// Divides the cell into `lines` columns and rows of `finer` cells, of which the first has this column and row.
    fn divide(&mut self, finer: LatticeCells, first: [i32; 2], lines: usize) {
        let mut divided = SiteCells::empty(finer, first, [lines; 2]);
        let points = std::mem::take(&mut self.points);
        let (known, newly) = points.split_at(self.known as usize);
        divided.add(known.iter().copied());
        divided.settle();
        divided.add(newly.iter().copied());
        *self = CellSites { divided: Some(Box::new(divided)), ..CellSites::default() };
    }
}

impl SiteCells {
    /// Returns no point of a cloud of `points` points in `bounds`.
    pub(crate) fn none(bounds: Bounds<2>, points: u64) -> SiteCells {
        let most = bounds.extent(0).max(bounds.extent(1)) / MOST_LINES + 1;
        let mut wanted = POINTS_PER_CELL.max(points / MOST_CELLS);
        let mut cells = LatticeCells::new(bounds, points, wanted, [0; 2]);
        while cells.side() < most {
            wanted = wanted.saturating_mul(4);
            cells = LatticeCells::new(bounds, points, wanted, [0; 2]);
        }
        let (first, last) = (cells.of(bounds.min[0], bounds.min[1]), cells.of(bounds.max[0], bounds.max[1]));
        SiteCells::empty(cells, first, [0, 1].map(|axis| (last[axis] - first[axis] + 1) as usize))
    }

    fn empty(cells: LatticeCells, first: [i32; 2], [columns, rows]: [usize; 2]) -> SiteCells {
        let points = std::iter::repeat_with(CellSites::default).take(columns * rows).collect();
        let is_grown = vec![0; (columns * rows).div_ceil(64)];
        SiteCells { cells, first, columns, rows, points, count: 0, grown: Vec::new(), is_grown }
    }

    /// Returns no point of the same cloud.
    pub(crate) fn emptied(&self) -> SiteCells {
        SiteCells::empty(self.cells, self.first, [self.columns, self.rows])
    }

    /// Adds points that are none of it to those that were added last.
    pub(crate) fn add(&mut self, points: impl IntoIterator<Item = [i32; 3]>) {
        points.into_iter().for_each(|point| self.push(point));
    }

    /// What was added last was added before from now on.
    pub(crate) fn settle(&mut self) {
        for cell in std::mem::take(&mut self.grown) {
            self.points[cell as usize].settle();
            self.is_grown[cell as usize / 64] = 0;
        }
    }

    fn push(&mut self, point: [i32; 3]) {
        let place = self.cells.of(point[0], point[1]);
        let [column, row] = [0, 1].map(|axis| (place[axis] - self.first[axis]) as usize);
        let number = row * self.columns + column;
        let (word, bit) = (&mut self.is_grown[number / 64], 1 << (number % 64));
        if *word & bit == 0 {
            *word |= bit;
            self.grown.push(number as u32);
        }
        self.count += 1;
        let cell = &mut self.points[number];
        if let Some(divided) = &mut cell.divided {
            divided.push(point);
            return;
        }
        cell.points.push(point);
        if cell.points.len() > MOST_PER_CELL
            && let Some((finer, lines)) = self.cells.finer()
        {
            cell.divide(finer, place.map(|along| along * lines), lines as usize);
        }
    }

    /// Returns the number of points.
    pub(crate) fn count(&self) -> u64 {
        self.count
    }

    /// Returns the side of a cell in lattice steps.
    pub(crate) fn side(&self) -> i64 {
        self.cells.side()
    }

    /// Returns the bytes of memory that the cells take, about.
    pub(crate) fn bytes(&self) -> u64 {
        self.count * BYTES_PER_LISTED + (self.points.len() * size_of::<CellSites>()) as u64
    }

    /// Hands over all points, some rows of cells at a time, neighbours in the plane one after the other.
    ///
    /// # Errors
    /// Those of `take`.
    pub(crate) fn for_each_row<E>(&self, mut take: impl FnMut(&[[i32; 3]]) -> Result<(), E>) -> Result<(), E> {
        let mut points = Vec::new();
        for row in self.points.chunks(self.columns.max(1)) {
            for cell in row {
                cell.append_to(&mut points);
                if points.len() >= TAKEN_AT_ONCE {
                    take(&points)?;
                    points.clear();
                }
            }
        }
        take(&points)
    }

    /// Shows `look` the points in the undivided cells that meet an area, and in some near it.
    pub(crate) fn for_each_cell(&self, area: &impl Area, mut look: impl FnMut(&[[i32; 3]])) {
        let _ = self.visit::<false>(area, &mut |points| {
            look(points);
            ControlFlow::Continue(())
        });
    }

    /// Shows `look` those of these points that were added last.
    pub(crate) fn for_each_grown_cell(&self, area: &impl Area, mut look: impl FnMut(&[[i32; 3]])) {
        let _ = self.visit::<true>(area, &mut |points| {
            look(points);
            ControlFlow::Continue(())
        });
    }

    /// Tells whether `is_wanted` of a point that was added last, in a cell that meets an area or is near it.
    pub(crate) fn has_newly(&self, area: &impl Area, is_wanted: impl Fn(&[i32; 3]) -> bool) -> bool {
        let found = self.visit::<true>(area, &mut |points| match points.iter().any(&is_wanted) {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        });
        found.is_break()
    }

    /// Shows `look` the points of cells, only those that were added last if that is asked for.
    fn visit<const LAST: bool>(
        &self,
        area: &impl Area,
        look: &mut impl FnMut(&[[i32; 3]]) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let side = self.cells.side() as f64;
        for row in self.lines(1, area.across()) {
            let south = (row as f64 + f64::from(self.first[1])) * side;
            let of_row = self.lines(0, area.along(south, south + side));
            let (mut number, end) = (row * self.columns + of_row.start, row * self.columns + of_row.end);
            while let Some(found) =
                if LAST { self.grown(number..end) } else { Some(number) }.filter(|found| *found < end)
            {
                let cell = &self.points[found];
                match &cell.divided {
                    Some(divided) => divided.visit::<LAST>(area, look)?,
                    None => look(if LAST { cell.newly() } else { &cell.points })?,
                }
                number = found + 1;
            }
        }
        ControlFlow::Continue(())
    }

    /// Returns the first of these cells, or one of the next 63, that has points which were added last.
    fn grown(&self, cells: Range<usize>) -> Option<usize> {
        let mut word = cells.start / 64;
        let mut marks = self.is_grown.get(word)? >> (cells.start % 64) << (cells.start % 64);
        while marks == 0 {
            word += 1;
            marks = *self.is_grown.get(word).filter(|_| word * 64 < cells.end)?;
        }
        Some(word * 64 + marks.trailing_zeros() as usize)
    }

    /// Returns the numbers of the columns (axis 0) or rows (1) that may have points from coordinate `low` to `high`.
    fn lines(&self, axis: usize, [low, high]: [f64; 2]) -> Range<usize> {
        // Coordinates of points are whole numbers, so it does not matter that these are cut and not rounded down.
        let number = |value: f64| self.cells.line(value as i64).saturating_sub(i64::from(self.first[axis]));
        let count = if axis == 0 { self.columns } else { self.rows };
        let (from, to) = (number(low).max(0), number(high).min(count as i64 - 1));
        if from > to { 0..0 } else { from as usize..to as usize + 1 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Most cells have no new point, and those that have some are far from each other.
    #[test]
    fn new_points_are_found_wherever_they_are() {
        let bounds = Bounds { min: [-20_000; 2], max: [20_000; 2] };
        let mut cells = SiteCells::none(bounds, 1_000_000);
        assert!(cells.columns > 20 && cells.points.len() > 500);
        let newly = |cells: &SiteCells, area: Bounds<2>| {
            let mut found = Vec::new();
            cells.for_each_grown_cell(&area, |points| found.extend_from_slice(points));
            found.sort_unstable();
            found
        };
        for round in 0..40 {
            cells.settle();
            let added: Vec<[i32; 3]> = (0..3)
                .map(|i| [(round * 7_919 + i * 13_003) % 20_000, (round * 3_001 + i * 9_973) % 40_000 - 20_000, i])
                .collect();
            cells.add(added.iter().copied());
            let mut expected = added.clone();
            expected.sort_unstable();
            assert_eq!(newly(&cells, bounds), expected);
            for point in added {
                let around = Bounds { min: [point[0] - 9_000, point[1]], max: [point[0], point[1] + 9_000] };
                assert!(newly(&cells, around).contains(&point));
                assert!(cells.has_newly(&around, |p| *p == point));
            }
        }
        cells.settle();
        assert_eq!(newly(&cells, bounds), [[0; 3]; 0]);
    }

    #[test]
    fn crowded_cells_are_divided() {
        let crowd: Vec<[i32; 3]> = (0..6_000).map(|i| [-333 + i % 77, 15_000 + i / 77, i]).collect();
        let mut cells = SiteCells::none(Bounds { min: [-20_000; 2], max: [20_000; 2] }, 8_000);
        cells.add(crowd.iter().copied());
        let most = |cells: &SiteCells| cells.points.iter().map(|cell| cell.points.len()).max();
        assert!(most(&cells) <= Some(MOST_PER_CELL) && cells.points.iter().any(|cell| cell.divided.is_some()));
        let mut rows = Vec::new();
        let take = |points: &[[i32; 3]]| -> Result<(), ()> {
            rows.extend_from_slice(points);
            Ok(())
        };
        cells.for_each_row(take).unwrap();
        rows.sort_unstable_by_key(|point| point[2]);
        assert_eq!(rows, crowd);
    }
}
