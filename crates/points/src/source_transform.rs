//! What a source does with its coordinates when a job wants them in another coordinate reference system.

use crate::points::axis::Axis;
use crate::points::transformed_sink::RecordTransform;
use crs::system::Crs;
use crs::transform::between::CrsTransform;
use crs::transform::datum_rule::DatumRule;
use rust_decimal::Decimal;
use rust_decimal::prelude::ToPrimitive;
use serde::{Deserialize, Serialize};

/// Places along each side of a box that are transformed to find the box of all its places.
const PLACES: usize = 17;

/// The length of a degree of latitude in metres, about: only a power of ten is taken of it.
const METRES_OF_A_DEGREE: f64 = 111_320.0;

/// What a file says of its coordinates.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct OwnCoordinates {
    pub(crate) axes: [Axis; 3],
    pub(crate) grid: [Decimal; 2],
    pub min: [f64; 3],
    pub max: [f64; 3],
    pub(crate) crs: Crs,
}

/// The way of a source's points into another system. The source then looks like a file in that system: its axes have new steps, to
/// which every coordinate is rounded once.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SourceTransform {
    /// What the file says.
    pub own: OwnCoordinates,
    /// What its coordinates are in, as the job takes it.
    pub from: Crs,
    /// What the job wants them in.
    pub(crate) to: Crs,
    /// Which datums are one.
    pub(crate) datums: DatumRule,
    /// Whether x and y change. If not, the file is in the other system already.
    pub(crate) is_moved: bool,
    /// What heights are multiplied by; `None` if they stay.
    pub(crate) heights: Option<f64>,
    /// The steps of x and y, and of z, that the user wants of the job.
    pub(crate) steps: [Option<Decimal>; 2],
}

impl SourceTransform {
    /// Returns the way of x and y; `None` if they stay.
    ///
    /// # Errors
    /// As [`CrsTransform::between`].
    pub(crate) fn way(&self) -> Result<Option<CrsTransform>, String> {
        self.is_moved.then(|| CrsTransform::between(&self.from, &self.to, self.datums)).transpose()
    }

    /// Returns what is done with every record, whose axes become `axes`.
    ///
    /// # Errors
    /// As [`CrsTransform::between`].
    pub(crate) fn of_records<'a>(&'a self, axes: &'a [Axis; 3]) -> Result<RecordTransform<'a>, String> {
        let (way, axes, target) = (self.way()?, [&self.own.axes, axes], self.to.label());
        Ok(RecordTransform { way, axes, heights: self.heights, target })
    }

    /// Returns how many units of the file's heights one unit of its x and y is long, about: of lengths one, as where nothing is transformed.
    pub(crate) fn steps_of_height(&self) -> f64 {
        let is_length = self.from.metres_per_unit().is_some();
        if is_length { 1.0 } else { METRES_OF_A_DEGREE / self.from.metres_per_unit_of_height() }
    }

    /// Returns the axes of the points in the other system.
    pub(crate) fn axes(&self) -> [Axis; 3] {
        let [x, y, z] = self.own.axes;
        let unit = self.from.metres_per_unit().unwrap_or(METRES_OF_A_DEGREE);
        let plane = |own: Axis| self.axis(own, self.is_moved.then_some(unit / self.metres()), self.steps[0]);
        [plane(x), plane(y), self.axis(z, self.heights, self.steps[1])]
    }

    /// Returns a step in x and one in y that divide every coordinate on `axes`, which are those of the other system.
    pub(crate) fn grid(&self, axes: &[Axis; 3]) -> [Decimal; 2] {
        if self.is_moved { [axes[0].scale, axes[1].scale] } else { self.own.grid }
    }

    /// Returns the axis of values of `own` that are multiplied by about `factor`; `own` itself without one. A coarser step that the user
    /// wants is that of the lattice: bounds hold before coordinates are rounded to it.
    fn axis(&self, own: Axis, factor: Option<f64>, wanted: Option<Decimal>) -> Axis {
        let Some(factor) = factor else { return own };
        let step = new_step(own.scale.to_f64().unwrap_or(1.0) * factor);
        Axis { offset: Decimal::ZERO, scale: wanted.map_or(step, |wanted| wanted.min(step)) }
    }

    /// Returns the metres of the other system's unit.
    fn metres(&self) -> f64 {
        self.to.metres_per_unit().unwrap_or(1.0)
    }

    /// Returns a box in the other system around all places of a box in the file's own; a box that is one point stays one. `None` if the
    /// other system has none of the places that were tried.
    pub(crate) fn around(&self, [min, max]: [[f64; 3]; 2]) -> Option<[[f64; 3]; 2]> {
        let factor = self.heights.unwrap_or(1.0);
        let plane = match self.way().ok()? {
            None => [[min[0], min[1]], [max[0], max[1]]],
            Some(way) if min[0] == max[0] && min[1] == max[1] => [way.apply([min[0], min[1]])?; 2],
            Some(way) => rectangle(&way, [[min[0], min[1]], [max[0], max[1]]])?,
        };
        let corner = |corner: [f64; 2], height: f64| [corner[0], corner[1], height * factor];
        Some([corner(plane[0], min[2]), corner(plane[1], max[2])])
    }
}

/// Returns the step of transformed coordinates, for points whose own step is about `own` in the new unit: a hundredth, or a thousandth
/// for finer points. Coarser steps would move points of a grid of metres by half a metre, and finer ones nobody misses.
fn new_step(own: f64) -> Decimal {
    if own >= 0.009_999 { Decimal::new(1, 2) } else { Decimal::new(1, 3) }
}

/// Returns the rectangle around the places of a rectangle. What lies between the places that are tried cannot be farther out than
/// neighbours are from a straight line.
fn rectangle(way: &CrsTransform, [min, max]: [[f64; 2]; 2]) -> Option<[[f64; 2]; 2]> {
    let at = |axis: usize, i: usize| min[axis] + (max[axis] - min[axis]) * (i as f64 / (PLACES - 1) as f64);
    let places: Vec<Option<[f64; 2]>> =
        (0..PLACES * PLACES).map(|i| way.apply([at(0, i % PLACES), at(1, i / PLACES)])).collect();
    let mut found: Option<[[f64; 2]; 2]> = None;
    for place in places.iter().flatten() {
        let [low, high] = found.get_or_insert([*place; 2]);
        (0..2).for_each(|axis| {
            low[axis] = low[axis].min(place[axis]);
            high[axis] = high[axis].max(place[axis]);
        });
    }
    let bend = |i: usize, step: usize, axis: usize| match (places[i], places[i + step], places[i + 2 * step]) {
        (Some(a), Some(b), Some(c)) => (a[axis] - 2.0 * b[axis] + c[axis]).abs(),
        _ => 0.0,
    };
    let inner = |i: usize| i + 2 < PLACES;
    let pads = [0, 1].map(|axis| {
        let along = (0..PLACES * PLACES).filter(|i| inner(i % PLACES)).map(|i| bend(i, 1, axis));
        let across = (0..PLACES * PLACES).filter(|i| inner(i / PLACES)).map(|i| bend(i, PLACES, axis));
        along.chain(across).fold(0.02, f64::max)
    });
    let [low, high] = found?;
    Some([[low[0] - pads[0], low[1] - pads[1]], [high[0] + pads[0], high[1] + pads[1]]])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crs::from_wkt::from_epsg;

    #[test]
    fn a_box_holds_all_places_of_the_box_that_it_comes_from() {
        for (from, to, min, max) in [
            (4326, 32633, [12.0, 50.0], [13.0, 51.0]),
            (4326, 32633, [5.0, -1.0], [25.0, 60.0]),
            (32632, 32633, [500_000.0, 5_500_000.0], [501_000.0, 5_501_000.0]),
            (4326, 3413, [-100.0, 70.0], [20.0, 90.0]),
            (3413, 4326, [-1e6, -1e6], [1e6, -1e5]),
        ] {
            let [from, to] = [from, to].map(|code| from_epsg(code).unwrap());
            let way = CrsTransform::between(&from, &to, DatumRule::Strict).unwrap();
            let [low, high] = rectangle(&way, [min, max]).unwrap();
            for i in 0..101 * 101 {
                let share = [i % 101, i / 101].map(|i| f64::from(i) / 100.0);
                let place = way.apply([0, 1].map(|axis| min[axis] + (max[axis] - min[axis]) * share[axis])).unwrap();
                assert!(
                    (0..2).all(|axis| low[axis] <= place[axis] && place[axis] <= high[axis]),
                    "{place:?} {low:?} {high:?}"
                );
            }
        }
    }

    #[test]
    fn steps_are_a_hundredth_or_a_thousandth() {
        let steps = [1.0, 0.01, 0.011, 0.0033, 1e-9].map(|own| new_step(own).to_string());
        assert_eq!(steps, ["0.01", "0.01", "0.01", "0.001", "0.001"]);
    }
}
