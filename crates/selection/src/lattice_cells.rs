//! A grid of square cells, which does not depend on where the lattice of a job begins.

use delaunay::geometry::Bounds;

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

    /// Returns the column of an x, or the row of a y, on a lattice without offset.
    pub(crate) fn line(self, value: i64) -> i64 {
        value >> self.shift
    }

    /// Returns the middle of the cell in a column and a row.
    pub(crate) fn middle(self, cell: [i32; 2]) -> [i64; 2] {
        [0, 1].map(|axis| (i64::from(cell[axis]) << self.shift) - i64::from(self.offset[axis]) + self.side() / 2)
    }

    /// Returns the side of a cell.
    pub(crate) fn side(self) -> i64 {
        1 << self.shift
    }

    /// Returns cells of the same size whose corners are the middles of these.
    pub(crate) fn shifted(self) -> LatticeCells {
        let half = (self.side() / 2) as i32;
        LatticeCells { offset: self.offset.map(|offset| (offset + half) & ((1 << MOST_SHIFT) - 1)), ..self }
    }

    /// Returns the box that reaches so many steps from the middle of a cell in x and y, as far as it lies in `bounds`. It may be empty.
    pub(crate) fn about_middle(self, cell: [i32; 2], reach: [i64; 2], bounds: Bounds<2>) -> Bounds<2> {
        let (axes, middle) = ([0, 1], self.middle(cell));
        Bounds {
            min: axes.map(|axis| (middle[axis] - reach[axis]).max(bounds.min[axis].into()) as i32),
            max: axes.map(|axis| (middle[axis] + reach[axis] - 1).min(bounds.max[axis].into()) as i32),
        }
    }

    /// Returns all cells that a box meets.
    pub(crate) fn of_box(self, bounds: Bounds<2>) -> impl Iterator<Item = [i32; 2]> {
        let ([west, south], [east, north]) =
            (self.of(bounds.min[0], bounds.min[1]), self.of(bounds.max[0], bounds.max[1]));
        (south..=north).flat_map(move |row| (west..=east).map(move |column| [column, row]))
    }

    /// Returns cells of a quarter of the side, or of one step, and how many of them lie along a side of these; `None` if these cells are one step
    /// wide.
    pub(crate) fn finer(self) -> Option<(LatticeCells, i32)> {
        let shift = self.shift.saturating_sub(2);
        (shift < self.shift).then(|| (LatticeCells { shift, ..self }, 1 << (self.shift - shift)))
    }

    /// Returns by what points of a cell are compared: the square of the distance from its middle, and the point.
    pub(crate) fn rank(self, point: [i32; 3]) -> (i64, [i32; 3]) {
        let along = |axis: usize| i64::from(point[axis] + self.offset[axis]).rem_euclid(self.side()) - self.side() / 2;
        (along(0).pow(2) + along(1).pow(2), point)
    }
}
