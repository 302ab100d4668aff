//! All selected points, by the cell of a grid that they lie in. A cell with many has a grid of its own.

use crate::disc::Disc;
use crate::seeds::LatticeCells;
use delaunay::geometry::predicates::in_circle;
use delaunay::geometry::{Bounds, Site};
use std::ops::{ControlFlow, Range};

/// A cell has so many points of the cloud on average, more or less.
const POINTS_PER_CELL: u64 = 256;
/// There are no more columns and rows.
const MOST_LINES: i64 = 1 << 13;
/// A cell with more selected points is divided: whatever is near looks at all of them.
const MOST_PER_CELL: usize = POINTS_PER_CELL as usize / 2;

/// All selected points of a cloud.
#[derive(Debug)]
pub struct SelectedSites {
    cells: LatticeCells,
    /// The column and the row of the first cell.
    first: [i32; 2],
    columns: usize,
    rows: usize,
    points: Vec<CellSites>,
    count: u64,
    /// The cells that have points which were added last.
    grown: Vec<u32>,
}

/// The selected points of a cell.
#[derive(Debug, Default)]
struct CellSites {
    points: Vec<[i32; 3]>,
    /// The number of those that were not added last.
    known: u32,
    /// If the cell is divided, the points are here instead.
    divided: Option<Box<SelectedSites>>,
}

impl CellSites {
    fn newly(&self) -> &[[i32; 3]] {
        &self.points[self.known as usize..]
    }

    fn is_grown(&self) -> bool {
        self.divided.as_ref().map_or(!self.newly().is_empty(), |divided| !divided.grown.is_empty())
    }

    fn settle(&mut self) {
        self.known = self.points.len() as u32;
        if let Some(divided) = &mut self.divided {
            divided.settle();
        }
    }

    /// Divides the cell into `lines` columns and rows of `finer` cells, of which the first has this column and row.
    fn divide(&mut self, finer: LatticeCells, first: [i32; 2], lines: usize) {
        let mut divided = SelectedSites::empty(finer, first, [lines; 2]);
        let points = std::mem::take(&mut self.points);
        let (known, newly) = points.split_at(self.known as usize);
        divided.add(known.iter().copied());
        divided.add(newly.iter().copied());
        *self = CellSites { divided: Some(Box::new(divided)), ..CellSites::default() };
    }
}

/// A part of the plane.
trait Area {
    /// Returns its least and its greatest y.
    fn across(&self) -> [f64; 2];

    /// Returns its least and its greatest x between these y.
    fn along(&self, south: f64, north: f64) -> [f64; 2];
}

impl Area for Bounds<2> {
    fn across(&self) -> [f64; 2] {
        [self.min[1], self.max[1]].map(f64::from)
    }

    fn along(&self, _: f64, _: f64) -> [f64; 2] {
        [self.min[0], self.max[0]].map(f64::from)
    }
}

impl Area for Disc {
    fn across(&self) -> [f64; 2] {
        [self.low(1), self.high(1)]
    }

    fn along(&self, south: f64, north: f64) -> [f64; 2] {
        self.chord(south, north)
    }
}

impl SelectedSites {
    /// Returns no point of a cloud of `points` points in `bounds`.
    pub(crate) fn none(bounds: Bounds<2>, points: u64) -> SelectedSites {
        let most = bounds.extent(0).max(bounds.extent(1)) / MOST_LINES + 1;
        let mut wanted = POINTS_PER_CELL;
        let mut cells = LatticeCells::new(bounds, points, wanted, [0; 2]);
        while cells.side() < most {
            wanted = wanted.saturating_mul(4);
            cells = LatticeCells::new(bounds, points, wanted, [0; 2]);
        }
        let (first, last) = (cells.of(bounds.min[0], bounds.min[1]), cells.of(bounds.max[0], bounds.max[1]));
        SelectedSites::empty(cells, first, [0, 1].map(|axis| (last[axis] - first[axis] + 1) as usize))
    }

    fn empty(cells: LatticeCells, first: [i32; 2], [columns, rows]: [usize; 2]) -> SelectedSites {
        let points = std::iter::repeat_with(CellSites::default).take(columns * rows).collect();
        SelectedSites { cells, first, columns, rows, points, count: 0, grown: Vec::new() }
    }

    /// Returns no point of the same cloud.
    pub(crate) fn emptied(&self) -> SelectedSites {
        SelectedSites::empty(self.cells, self.first, [self.columns, self.rows])
    }

    /// Adds points that are none of it.
    pub(crate) fn add(&mut self, points: impl IntoIterator<Item = [i32; 3]>) {
        self.settle();
        points.into_iter().for_each(|point| self.push(point));
    }

    /// What was added last was added before from now on.
    fn settle(&mut self) {
        for cell in std::mem::take(&mut self.grown) {
            self.points[cell as usize].settle();
        }
    }

    fn push(&mut self, point: [i32; 3]) {
        let place = self.cells.of(point[0], point[1]);
        let [column, row] = [0, 1].map(|axis| (place[axis] - self.first[axis]) as usize);
        let number = row * self.columns + column;
        let cell = &mut self.points[number];
        if !cell.is_grown() {
            self.grown.push(number as u32);
        }
        self.count += 1;
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

    /// Returns the number of points in the cells that meet `bounds`.
    pub(crate) fn near(&self, bounds: Bounds<2>) -> usize {
        let mut count = 0;
        self.for_each_cell(&bounds, |cell| count += cell.points.len());
        count
    }

    /// Returns the number of points that were added last to the cells that meet `bounds`.
    pub(crate) fn newly_near(&self, bounds: Bounds<2>) -> usize {
        let mut count = 0;
        self.for_each_cell(&bounds, |cell| count += cell.newly().len());
        count
    }

    /// Returns the number of points.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Returns the side of a cell in lattice steps.
    pub(crate) fn side(&self) -> i64 {
        self.cells.side()
    }

    /// Returns the points in `bounds`, in no particular order.
    pub fn within(&self, bounds: Bounds<2>) -> Vec<[i32; 3]> {
        let mut within = Vec::new();
        self.for_each_cell(&bounds, |cell| within.extend(cell.points.iter().filter(|point| is_in(&bounds, point))));
        within
    }

    /// Returns the points in `bounds` that were added last, neighbours in the plane one after the other.
    pub(crate) fn newly_within(&self, bounds: Bounds<2>) -> Vec<[i32; 3]> {
        let mut within = Vec::new();
        self.for_each_cell(&bounds, |cell| within.extend(cell.newly().iter().filter(|point| is_in(&bounds, point))));
        within
    }

    /// Tells whether one of the points that were added last lies in `bounds`.
    pub(crate) fn has_newly_within(&self, bounds: Bounds<2>) -> bool {
        self.is_in_any_cell(&bounds, |cell| cell.newly().iter().any(|point| is_in(&bounds, point)))
    }

    /// Returns the point that lies deepest inside the circle of the triangle of `corners`, which is `disc`, or `None` if there is none. None of
    /// the corners is looked at.
    pub(crate) fn deepest_inside(&self, corners: [Site; 3], disc: Disc) -> Option<[i32; 3]> {
        let [a, b, c] = corners;
        let mut deepest: Option<(f64, [i32; 3])> = None;
        self.for_each_cell(&disc, |cell| {
            for &point in &cell.points {
                let (site, from_centre) = ([point[0], point[1]], disc.squared_distance_from_centre(point));
                if from_centre <= disc.reach * disc.reach
                    && deepest.is_none_or(|(least, _)| from_centre < least)
                    && !corners.contains(&site)
                    && in_circle(a, b, c, site)
                {
                    deepest = Some((from_centre, point));
                }
            }
        });
        deepest.map(|(_, point)| point)
    }

    /// Tells whether one of the points that were added last lies inside the circle of the triangle of `corners`, which is `disc`.
    pub(crate) fn has_newly_inside(&self, corners: [Site; 3], disc: Disc) -> bool {
        let [a, b, c] = corners;
        self.is_in_any_cell(&disc, |cell| {
            let mut newly = cell.newly().iter().map(|&[x, y, _]| [x, y]);
            newly.any(|site| !corners.contains(&site) && in_circle(a, b, c, site))
        })
    }

    /// Shows `look` the undivided cells that meet an area, and some near it.
    fn for_each_cell(&self, area: &impl Area, mut look: impl FnMut(&CellSites)) {
        let _ = self.visit(area, &mut |cell| {
            look(cell);
            ControlFlow::Continue(())
        });
    }

    /// Tells whether `is_wanted` of one of the undivided cells that meet an area, or of some near it.
    fn is_in_any_cell(&self, area: &impl Area, is_wanted: impl Fn(&CellSites) -> bool) -> bool {
        let found = self.visit(area, &mut |cell| match is_wanted(cell) {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        });
        found.is_break()
    }

    fn visit(&self, area: &impl Area, look: &mut impl FnMut(&CellSites) -> ControlFlow<()>) -> ControlFlow<()> {
        let side = self.cells.side() as f64;
        for row in self.lines(1, area.across()) {
            let south = (row as f64 + f64::from(self.first[1])) * side;
            for column in self.lines(0, area.along(south, south + side)) {
                let cell = &self.points[row * self.columns + column];
                match &cell.divided {
                    Some(divided) => divided.visit(area, look)?,
                    None => look(cell)?,
                }
            }
        }
        ControlFlow::Continue(())
    }

    /// Returns the numbers of the columns (axis 0) or rows (1) from coordinate `low` to `high`.
    fn lines(&self, axis: usize, [low, high]: [f64; 2]) -> Range<usize> {
        let number = |value: f64| (value / self.cells.side() as f64).floor() - f64::from(self.first[axis]);
        let count = if axis == 0 { self.columns } else { self.rows };
        let (from, to) = (number(low).max(0.0), number(high).min(count as f64 - 1.0));
        if from > to { 0..0 } else { from as usize..to as usize + 1 }
    }
}

/// Tells whether a point lies in `bounds`.
pub(crate) fn is_in(bounds: &Bounds<2>, point: &[i32; 3]) -> bool {
    (0..2).all(|k| bounds.min[k] <= point[k] && point[k] <= bounds.max[k])
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn divided_cells_find_the_same_points() {
        let spread = (0..2_000).map(|i| [i * 7_919 % 40_009 - 20_000, i * 104_729 % 39_989 - 20_000, i]);
        let crowd = (0..6_000).map(|i| [-333 + i % 77, 15_000 + i / 77, i]);
        let all: Vec<[i32; 3]> = spread.chain(crowd).collect();
        let bounds = Bounds::of_points(all.iter().map(|p| [p[0], p[1]])).unwrap();
        let mut sites = SelectedSites::none(bounds, all.len() as u64);
        for (number, newly) in all.chunks(1_500).enumerate() {
            sites.add(newly.iter().copied());
            let known = &all[..1_500 * number + newly.len()];
            assert_eq!(sites.count(), known.len() as u64);
            for area in [bounds, Bounds { min: [-340, 15_010], max: [-300, 15_020] }, Bounds::of_point([5, 5])] {
                let of =
                    |points: &[[i32; 3]]| points.iter().copied().filter(|p| is_in(&area, p)).collect::<BTreeSet<_>>();
                let unique = |points: Vec<[i32; 3]>| points.into_iter().collect::<BTreeSet<_>>();
                assert!(unique(sites.within(area)) == of(known), "{area:?}");
                assert!(unique(sites.newly_within(area)) == of(newly), "{area:?}");
                assert_eq!(sites.has_newly_within(area), !of(newly).is_empty());
                assert!(sites.near(area) >= of(known).len() && sites.newly_near(area) >= of(newly).len());
            }
            for triangle in [[[-330, 15_003], [-301, 15_007], [-313, 15_044]], [[-9_000, -7], [9_000, 0], [3, 18_000]]]
            {
                let [a, b, c] = triangle;
                let is_inside = |p: &&[i32; 3]| !triangle.contains(&[p[0], p[1]]) && in_circle(a, b, c, [p[0], p[1]]);
                let disc = Disc::of(triangle);
                let deepest = known.iter().filter(is_inside).map(|&p| disc.squared_distance_from_centre(p));
                let found = sites.deepest_inside(triangle, disc).map(|p| disc.squared_distance_from_centre(p));
                assert_eq!(found, deepest.reduce(f64::min));
                assert_eq!(sites.has_newly_inside(triangle, disc), newly.iter().any(|p| is_inside(&p)));
            }
        }
        let most = |sites: &SelectedSites| sites.points.iter().map(|cell| cell.points.len()).max();
        assert!(most(&sites) <= Some(MOST_PER_CELL) && sites.points.iter().any(|cell| cell.divided.is_some()));
    }
}
