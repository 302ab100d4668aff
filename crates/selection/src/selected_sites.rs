//! All selected points, by the cell of a grid that they lie in.

use crate::seeds::LatticeCells;
use delaunay::geometry::predicates::{in_circle, orient2d};
use delaunay::geometry::{Bounds, Site};
use std::ops::Range;

/// A cell has so many points of the cloud, more or less.
const POINTS_PER_CELL: u64 = 256;
/// There are no more columns and rows.
const MOST_LINES: i64 = 1 << 13;

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
#[derive(Clone, Debug, Default)]
struct CellSites {
    points: Vec<[i32; 3]>,
    /// The number of those that were not added last.
    known: u32,
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
        let [columns, rows] = [0, 1].map(|axis| (last[axis] - first[axis] + 1) as usize);
        SelectedSites {
            cells,
            first,
            columns,
            rows,
            points: vec![CellSites::default(); columns * rows],
            count: 0,
            grown: Vec::new(),
        }
    }

    /// Returns no point of the same cloud.
    pub(crate) fn emptied(&self) -> SelectedSites {
        SelectedSites { points: vec![CellSites::default(); self.points.len()], count: 0, grown: Vec::new(), ..*self }
    }

    /// Adds points that are none of it.
    pub(crate) fn add(&mut self, points: impl IntoIterator<Item = [i32; 3]>) {
        for cell in std::mem::take(&mut self.grown) {
            let cell = &mut self.points[cell as usize];
            cell.known = cell.points.len() as u32;
        }
        for point in points {
            let [column, row] = self.cells.of(point[0], point[1]);
            let number = (row - self.first[1]) as usize * self.columns + (column - self.first[0]) as usize;
            let cell = &mut self.points[number];
            if cell.points.len() == cell.known as usize {
                self.grown.push(number as u32);
            }
            cell.points.push(point);
            self.count += 1;
        }
    }

    /// Returns the number of points that were added last to the cells that meet `bounds`.
    pub(crate) fn newly_near(&self, bounds: Bounds<2>) -> usize {
        self.cells_within(bounds).map(|cell| cell.points.len() - cell.known as usize).sum()
    }

    /// Returns the points in `bounds` that were added last, neighbours in the plane one after the other.
    pub(crate) fn newly_within(&self, bounds: Bounds<2>) -> impl Iterator<Item = [i32; 3]> {
        self.points_within(bounds, |cell| &cell.points[cell.known as usize..])
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
    pub fn within(&self, bounds: Bounds<2>) -> impl Iterator<Item = [i32; 3]> {
        self.points_within(bounds, |cell| &cell.points)
    }

    /// Returns those points in `bounds` that `of_cell` returns.
    fn points_within<'a>(
        &'a self,
        bounds: Bounds<2>,
        of_cell: impl Fn(&'a CellSites) -> &'a [[i32; 3]],
    ) -> impl Iterator<Item = [i32; 3]> {
        let is_inside = move |p: &&[i32; 3]| (0..2).all(|k| bounds.min[k] <= p[k] && p[k] <= bounds.max[k]);
        self.cells_within(bounds).flat_map(move |cell| of_cell(cell).iter().filter(is_inside).copied())
    }

    /// Returns the cells that meet `bounds`.
    fn cells_within(&self, bounds: Bounds<2>) -> impl Iterator<Item = &CellSites> {
        let columns = self.lines(0, f64::from(bounds.min[0]), f64::from(bounds.max[0]));
        let rows = self.lines(1, f64::from(bounds.min[1]), f64::from(bounds.max[1]));
        let row = move |row: usize| row * self.columns + columns.start..row * self.columns + columns.end;
        rows.flat_map(move |number| &self.points[row(number)])
    }

    /// Returns the numbers of the columns (axis 0) or rows (1) from coordinate `low` to `high`.
    fn lines(&self, axis: usize, low: f64, high: f64) -> Range<usize> {
        let number = |value: f64| (value / self.cells.side() as f64).floor() - f64::from(self.first[axis]);
        let count = if axis == 0 { self.columns } else { self.rows };
        let (from, to) = (number(low).max(0.0), number(high).min(count as f64 - 1.0));
        if from > to { 0..0 } else { from as usize..to as usize + 1 }
    }

    /// Returns the point that lies deepest inside the circle of the triangle of `corners`, which is `disc`, or `None` if there is none. None of
    /// the corners is looked at.
    pub(crate) fn deepest_inside(&self, corners: [Site; 3], disc: Disc) -> Option<[i32; 3]> {
        let [a, b, c] = corners;
        let mut deepest: Option<(f64, [i32; 3])> = None;
        self.cells_of(disc).for_each(|cell| {
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
        self.cells_of(disc).any(|cell| {
            let mut newly = cell.points[cell.known as usize..].iter().map(|&[x, y, _]| [x, y]);
            newly.any(|site| !corners.contains(&site) && in_circle(a, b, c, site))
        })
    }

    /// Returns the cells that meet a disc, and some near it.
    fn cells_of(&self, disc: Disc) -> impl Iterator<Item = &CellSites> {
        let side = self.cells.side() as f64;
        self.lines(1, disc.low(1), disc.high(1)).flat_map(move |row| {
            let south = (row as f64 + f64::from(self.first[1])) * side;
            let [low, high] = disc.chord(south, south + side);
            let columns = self.lines(0, low, high);
            &self.points[row * self.columns + columns.start..row * self.columns + columns.end]
        })
    }
}

/// A disc that surely holds the circumscribed disc of a triangle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Disc {
    centre: [f64; 2],
    reach: f64,
}

impl Disc {
    /// Returns the disc of the triangle of `corners`.
    ///
    /// The centre is computed from a corner of the shortest side, so that its error is a small share of the radius: with `s` the length of
    /// that side, `l` of the others and `area` twice that of the triangle, it is about 2^-51 l^2 s / area, and the radius is l^2 s / (2 area).
    pub(crate) fn of(corners: [Site; 3]) -> Disc {
        let squared = |p: Site, q: Site| (0..2).map(|k| (f64::from(p[k]) - f64::from(q[k])).powi(2)).sum::<f64>();
        let side = |k: &usize| squared(corners[*k], corners[(*k + 1) % 3]);
        let start = (0..3).min_by(|p, q| side(p).total_cmp(&side(q))).unwrap_or(0);
        let [a, b, c] = [0, 1, 2].map(|k| corners[(start + k) % 3].map(f64::from));
        let ([bx, by], [cx, cy]) = ([b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]]);
        let (b_squared, c_squared) = (bx * bx + by * by, cx * cx + cy * cy);
        let twice = 2.0 * orient2d(corners[0], corners[1], corners[2]) as f64;
        let from_a = [(cy * b_squared - by * c_squared) / twice, (bx * c_squared - cx * b_squared) / twice];
        let radius = (from_a[0] * from_a[0] + from_a[1] * from_a[1]).sqrt();
        Disc { centre: [a[0] + from_a[0], a[1] + from_a[1]], reach: radius * (1.0 + 1e-9) + 2.0 }
    }

    /// Tells whether the circumscribed disc of the triangle of `corners` surely lies in `bounds`, in less time than it takes to find the disc.
    ///
    /// It does if its diameter, `p q r / area` with the lengths of the sides and twice the area of the triangle, is less than the distance of a
    /// corner from the border.
    #[inline(always)]
    pub(crate) fn is_surely_in(corners: [Site; 3], bounds: &Bounds<2>) -> bool {
        let [a, b, c] = corners.map(|corner| corner.map(f64::from));
        let squared = |p: [f64; 2], q: [f64; 2]| (p[0] - q[0]) * (p[0] - q[0]) + (p[1] - q[1]) * (p[1] - q[1]);
        let inwards = |k: usize| (a[k] - f64::from(bounds.min[k])).min(f64::from(bounds.max[k]) - a[k]);
        let distance = inwards(0).min(inwards(1));
        let twice = orient2d(corners[0], corners[1], corners[2]) as f64;
        // Rounding is far less than the factor allows for.
        distance > 0.0
            && squared(a, b) * squared(b, c) * squared(c, a) * (1.0 + 1e-9) < (distance * twice) * (distance * twice)
    }

    /// Tells whether it surely lies in `bounds`.
    pub(crate) fn is_in(&self, bounds: &Bounds<2>) -> bool {
        (0..2).all(|k| f64::from(bounds.min[k]) <= self.low(k) && self.high(k) <= f64::from(bounds.max[k]))
    }

    /// Returns the least box of lattice points that holds it, as far as a lattice goes.
    pub(crate) fn bounds(&self) -> Bounds<2> {
        Bounds { min: [0, 1].map(|axis| self.low(axis) as i32), max: [0, 1].map(|axis| self.high(axis).ceil() as i32) }
    }

    fn low(&self, axis: usize) -> f64 {
        self.centre[axis] - self.reach
    }

    fn high(&self, axis: usize) -> f64 {
        self.centre[axis] + self.reach
    }

    fn squared_distance_from_centre(&self, point: [i32; 3]) -> f64 {
        let [x, y] = [0, 1].map(|axis| f64::from(point[axis]) - self.centre[axis]);
        x * x + y * y
    }

    /// Returns the range of x where the disc meets the stripe of these y.
    fn chord(&self, south: f64, north: f64) -> [f64; 2] {
        let from_centre = (south - self.centre[1]).max(self.centre[1] - north).max(0.0);
        let half = ((self.reach - from_centre) * (self.reach + from_centre)).max(0.0).sqrt();
        let margin = 1e-9 * self.reach + 2.0;
        [self.centre[0] - half - margin, self.centre[0] + half + margin]
    }
}
