//! One lattice for two terrains.

use delaunay::geometry::Bounds;
use lattice::Lattice;
use overlay::{Point, REACH, Rectangle};
use rust_decimal::Decimal;
use rust_decimal::prelude::ToPrimitive;
use sys::{Error, Result};

/// A step of a terrain's lattice has at most this many steps of the common one.
const MOST_PARTS: i64 = 1 << 30;

/// The same where a lattice is made finer than the terrains need: then every vertex is within [`REACH`].
const MOST_PARTS_FOR_PLACES: i64 = 1 << 8;

/// What to do about lattices whose common step is too small.
pub(crate) const TOO_FINE: &str = "run one of the jobs again with [input] resolution set to the step of the other";

/// The lattice of two terrains: its zero is that of the first one, and its steps are the greatest that lead to all points of both.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct CommonLattice {
    /// The source coordinates x and y of zero, and the height of zero.
    pub(crate) offset: [Decimal; 3],
    /// The steps in x and y, and in z, in source units.
    pub(crate) steps: [Decimal; 2],
    /// From the lattice of each terrain to this one.
    pub(crate) ways: [LatticeWay; 2],
}

/// The way from a terrain's lattice to the common one: `factor * integer + shift`, by axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct LatticeWay {
    factor: [i64; 3],
    shift: [i64; 3],
}

impl CommonLattice {
    /// Returns the common lattice of two.
    ///
    /// # Errors
    /// [`Error::Config`] if its steps would be so small that whole numbers get too large.
    pub(crate) fn new(lattices: [&Lattice; 2]) -> Result<CommonLattice> {
        let refuse = || {
            let [first, second] = lattices
                .map(|lattice| format!("{} from {:?}", lattice.resolution, lattice.offset.map(|o| o.to_string())));
            Error::Config(format!(
                "the lattices of the two terrains have no common step that is large enough (steps of {first} and of {second}): \
                 {TOO_FINE}"
            ))
        };
        CommonLattice::of(lattices).ok_or_else(refuse)
    }

    fn of([first, second]: [&Lattice; 2]) -> Option<CommonLattice> {
        let mut shifts = [Decimal::ZERO; 3];
        for (axis, shift) in shifts.iter_mut().enumerate() {
            *shift = second.offset[axis].checked_sub(first.offset[axis])?;
        }
        let plane = common_step(&[first.resolution, second.resolution, shifts[0], shifts[1]])?;
        let up = common_step(&[first.resolution_z, second.resolution_z, shifts[2]])?;
        let steps = [plane, plane, up];
        let way = |lattice: &Lattice, shifts: [Decimal; 3]| {
            let whole = |values: [Decimal; 3]| {
                let of_axis = |k: usize| values[k].checked_div(steps[k])?.to_i64();
                Some([of_axis(0)?, of_axis(1)?, of_axis(2)?])
            };
            let factor = whole([lattice.resolution, lattice.resolution, lattice.resolution_z])?;
            Some(LatticeWay { factor, shift: whole(shifts)? })
        };
        let ways = [way(first, [Decimal::ZERO; 3])?, way(second, shifts)?];
        // Then no number of a vertex overflows, and a mesh refuses those that are beyond its reach.
        let fits = |way: &LatticeWay| {
            way.factor.iter().all(|factor| *factor <= MOST_PARTS) && way.shift.iter().all(|shift| shift.abs() <= REACH)
        };
        let lattice = CommonLattice { offset: first.offset, steps: [plane, up], ways };
        ways.iter().all(fits).then_some(lattice)
    }

    /// Returns this lattice with smaller steps in x and y, for places that are not those of vertices: down to a thousandth of a unit, as far as
    /// whole numbers allow.
    pub(crate) fn for_places(mut self) -> CommonLattice {
        let has_room = |way: &LatticeWay| {
            let [factor, _, _] = way.factor;
            factor < MOST_PARTS_FOR_PLACES && way.shift[..2].iter().all(|shift| shift.abs() < REACH / 4)
        };
        while self.steps[0] > Decimal::new(1, 3) && self.ways.iter().all(has_room) {
            let Some(half) = self.steps[0].checked_div(Decimal::TWO) else { break };
            self.steps[0] = half;
            for way in &mut self.ways {
                for axis in [0, 1] {
                    way.factor[axis] = way.factor[axis].saturating_mul(2);
                    way.shift[axis] = way.shift[axis].saturating_mul(2);
                }
            }
        }
        self
    }

    /// Returns the steps in x and y, and in z, in source units.
    pub(crate) fn step_lengths(&self) -> [f64; 2] {
        self.steps.map(nearest)
    }

    /// Returns the lattice point nearest to a place in source coordinates; `None` if it is beyond [`REACH`].
    pub(crate) fn nearest_point(&self, place: [f64; 2]) -> Option<[i64; 2]> {
        let step = nearest(self.steps[0]);
        let of_axis = |axis: usize| {
            let steps = ((place[axis] - nearest(self.offset[axis])) / step).round();
            (steps.abs() <= REACH as f64).then_some(steps as i64)
        };
        Some([of_axis(0)?, of_axis(1)?])
    }

    /// Returns a difference of heights in source units as a number of steps.
    pub(crate) fn steps_of_height(&self, difference: f64) -> f64 {
        let exact = lattice::shortest_decimal(difference).and_then(|exact| exact.checked_div(self.steps[1]));
        exact.map_or(difference / nearest(self.steps[1]), nearest)
    }
}

impl LatticeWay {
    #[inline]
    pub(crate) fn point(&self, point: [i32; 3]) -> Point {
        [0, 1, 2].map(|k| self.factor[k] * i64::from(point[k]) + self.shift[k])
    }

    /// Returns the smallest box of points of the terrain's lattice around a rectangle of the common one.
    pub(crate) fn around(&self, rectangle: Rectangle) -> Bounds<2> {
        let within = |value: i64| value.clamp(i32::MIN.into(), i32::MAX.into()) as i32;
        let below = |k: usize, value: i64| value.div_euclid(self.factor[k]);
        Bounds {
            min: [0, 1].map(|k| within(below(k, rectangle.min[k] - self.shift[k]))),
            max: [0, 1].map(|k| within(-below(k, self.shift[k] - rectangle.max[k]))),
        }
    }

    /// Returns the height of 0 of the terrain's lattice in steps of the common one, and that of a step.
    pub(crate) fn heights(&self) -> [f64; 2] {
        [self.shift[2] as f64, self.factor[2] as f64]
    }
}

/// Returns the `f64` nearest to a decimal.
pub(crate) fn nearest(value: Decimal) -> f64 {
    value.to_string().parse().unwrap_or(f64::NAN)
}

/// Returns the greatest number of which all `values` are whole multiples; `None` if numbers have too many digits.
fn common_step(values: &[Decimal]) -> Option<Decimal> {
    let digits = values.iter().map(|value| value.normalize().scale()).max()?;
    let mut common = 0i128;
    for value in values.iter().map(|value| value.normalize()) {
        let whole = value.mantissa().checked_mul(10i128.checked_pow(digits - value.scale())?)?;
        common = greatest_divisor(common, whole.checked_abs()?);
    }
    let step = Decimal::try_from_i128_with_scale(common, digits).ok()?;
    (step > Decimal::ZERO).then(|| step.normalize())
}

fn greatest_divisor(mut a: i128, mut b: i128) -> i128 {
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::str::FromStr;

    #[test]
    fn places_between_the_vertices_are_found() {
        let metres = lattice(["500000", "4000000", "0"], "1", "0.01");
        let common = CommonLattice::new([&metres, &metres]).unwrap().for_places();
        assert_eq!(common.ways[0].point([3, 4, 5]), [768, 1024, 5]);
        assert_eq!(common.nearest_point([500000.2, 4000000.75]), Some([51, 192]));
        let fine = lattice(["0", "0", "0"], "0.001", "0.001");
        let common = CommonLattice::new([&fine, &fine]).unwrap();
        assert_eq!(common.clone().for_places(), common, "it is fine enough");
    }

    fn lattice(offset: [&str; 3], step: &str, step_z: &str) -> Lattice {
        let number = |text: &str| Decimal::from_str(text).unwrap();
        Lattice::new(offset.map(number), number(step), number(step_z)).unwrap()
    }

    #[test]
    fn both_lattices_lie_on_the_common_one() {
        let first = lattice(["1000", "2000.5", "7"], "0.01", "0.01");
        let second = lattice(["999.995", "2000", "0"], "0.004", "0.25");
        let common = CommonLattice::new([&first, &second]).unwrap();
        assert_eq!(common.step_lengths(), [0.001, 0.01]);
        assert_eq!(common.ways[0], LatticeWay { factor: [10, 10, 1], shift: [0; 3] });
        assert_eq!(common.ways[1], LatticeWay { factor: [4, 4, 25], shift: [-5, -500, -700] });
        assert_eq!(common.ways[1].point([2, 0, 30]), [3, -500, 50]);
        let rectangle = Rectangle { min: [-5, -500], max: [4, -499] };
        assert_eq!(common.ways[1].around(rectangle), Bounds { min: [0, 0], max: [3, 1] });
        assert_eq!(common.ways[0].around(rectangle), Bounds { min: [-1, -50], max: [1, -49] });
        assert_eq!(common.nearest_point([1000.0034, 2000.5]), Some([3, 0]));
        assert_eq!(common.nearest_point([1e30, 0.0]), None);
        assert_eq!(common.steps_of_height(0.1), 10.0);
        let same = CommonLattice::new([&first, &first]).unwrap();
        assert_eq!(same.step_lengths(), [0.01, 0.01]);
    }

    #[test]
    fn steps_that_are_too_fine_are_refused() {
        let first = lattice(["0", "0", "0"], "0.01", "0.01");
        let second = lattice(["0.00000000000001", "0", "0"], "0.01", "0.01");
        let error = CommonLattice::new([&first, &second]).unwrap_err();
        assert!(error.kind() == sys::ErrorKind::Usage && error.to_string().contains("resolution"), "{error}");
    }
}
