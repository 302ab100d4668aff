//! The lattice of a cloud in metres, and square cells at the same places on every such lattice.

use crate::cells::Place;

/// The least width of a cell in metres.
const LEAST_WIDTH: f64 = 1.0;
/// A cell is this many times as wide as points are apart, or wider.
const SPACINGS: f64 = 0.75;

/// The lattice that points have integers on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MetricLattice {
    /// The metres in a step in x and y.
    pub horizontal: f64,
    /// The metres in a step in z.
    pub vertical: f64,
    /// The steps in x and y from zero of the source coordinates to zero of the lattice, rounded down. Cells go by them, and not by where the lattice
    /// begins.
    pub offset: [i64; 2],
}

impl MetricLattice {
    /// Returns a length in lattice steps, rounded up.
    pub(crate) fn steps_of(self, metres: f64) -> i32 {
        (metres / self.horizontal).ceil().clamp(1.0, f64::from(1 << 28)) as i32
    }

    /// Returns the cells for points that are so far apart, in metres.
    pub(crate) fn squares_for(self, spacing: f64) -> SquareCells {
        self.cells(self.steps_of(LEAST_WIDTH.max(SPACINGS * spacing)))
    }

    /// Returns the cells of this width in steps, at most 2^28. Cell (0, 0) begins at zero of the source coordinates, or so many cells from there
    /// that columns and rows fit, a multiple of 2^30.
    pub(crate) fn cells(self, steps: i32) -> SquareCells {
        const PERIOD: i64 = 1 << 30;
        let part = |of: fn(i64, i64) -> i64| self.offset.map(|offset| of(offset, i64::from(steps)));
        let near_zero = |cells: i64| (cells + PERIOD / 2).rem_euclid(PERIOD) - PERIOD / 2;
        SquareCells {
            steps,
            first: part(i64::div_euclid).map(|cells| near_zero(cells) as i32),
            rest: part(i64::rem_euclid).map(|rest| rest as i32),
        }
    }
}

/// Square cells.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SquareCells {
    /// The width in lattice steps.
    pub(crate) steps: i32,
    /// The column and the row of the cell that zero of the lattice is in.
    first: Place,
    /// Where in that cell it is.
    rest: [i32; 2],
}

impl SquareCells {
    /// Returns the column and the row of the cell that a place on the lattice is in.
    pub(crate) fn of(self, place: [i32; 2]) -> Place {
        [0, 1].map(|axis| (place[axis] + self.rest[axis]).div_euclid(self.steps) + self.first[axis])
    }

    /// Returns the first and the last step of a column of cells, or of a row, on an axis of the lattice.
    pub(crate) fn span(self, axis: usize, number: i32) -> [i64; 2] {
        let first =
            (i64::from(number) - i64::from(self.first[axis])) * i64::from(self.steps) - i64::from(self.rest[axis]);
        [first, first + i64::from(self.steps) - 1]
    }

    /// Returns the column or the row of cells that a step on an axis of the lattice is in.
    pub(crate) fn number_at(self, axis: usize, step: i64) -> i64 {
        (step + i64::from(self.rest[axis])).div_euclid(i64::from(self.steps)) + i64::from(self.first[axis])
    }

    /// Returns how many steps from the beginning of its cell a place is.
    pub(crate) fn within(self, place: [i32; 2]) -> [i32; 2] {
        [0, 1].map(|axis| (place[axis] + self.rest[axis]).rem_euclid(self.steps))
    }

    /// Returns where in its cell a place is, in 256ths of the width, rounded down.
    pub(crate) fn spot(self, place: [i32; 2]) -> [u8; 2] {
        let part = |along: i32| i64::from(along) * 256 / i64::from(self.steps);
        self.within(place).map(|along| u8::try_from(part(along)).unwrap_or(u8::MAX))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_at_the_same_places_on_every_lattice() {
        for steps in [1, 3, 100, 8_000] {
            for world in [-7_654_321, -1, 0, 1, 99, 100, 123_456_789] {
                let on = |offset: [i64; 2]| {
                    let cells = MetricLattice { horizontal: 0.01, vertical: 0.01, offset }.cells(steps);
                    let place = offset.map(|offset| i32::try_from(world - offset).unwrap());
                    (cells.of(place), cells.within(place), cells.spot(place))
                };
                let expected = [world.div_euclid(i64::from(steps)), world.rem_euclid(i64::from(steps))];
                let expected = expected.map(|along| along as i32);
                for offset in [[0, 0], [123_456_789, -100], [-99_999, 100_000_001]] {
                    let (cell, within, spot) = on(offset);
                    assert_eq!((cell, within), ([expected[0]; 2], [expected[1]; 2]), "{steps}, {world}, {offset:?}");
                    assert_eq!(spot.map(i32::from), within.map(|within| within * 256 / steps));
                }
            }
        }
    }

    #[test]
    fn cells_far_from_zero_have_numbers() {
        let cells = MetricLattice { horizontal: 1e-6, vertical: 1e-6, offset: [1 << 51, -(1 << 51)] }.cells(1);
        let [right, down] = cells.of([5, -5]);
        assert_eq!([cells.of([6, -5]), cells.of([5, -6])], [[right + 1, down], [right, down - 1]]);
    }
}
