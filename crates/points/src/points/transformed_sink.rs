//! Takes records in the coordinates of a file, and hands them on in those of another coordinate reference system.

use crate::points::axis::Axis;
use crate::points::record::{NODATA, PointRecord};
use crate::points::record_sink::{PassingSink, RecordSink};
use crs::transform::between::CrsTransform;
use lattice::BEYOND;
use rust_decimal::prelude::ToPrimitive;
use sys::Result;

/// What is done with the raw integers of every record.
pub(crate) struct RecordTransform<'a> {
    /// The way of x and y; `None` if they stay.
    pub(crate) way: Option<CrsTransform>,
    /// The axes of the file, and those of the records that are handed on.
    pub(crate) axes: [&'a [Axis; 3]; 2],
    /// What heights are multiplied by; `None` if they stay.
    pub(crate) heights: Option<f64>,
    /// What the other system is called.
    pub(crate) target: String,
}

/// Raw integers farther from zero are no coordinates: floating point does not hold all of them.
const FARTHEST: f64 = (1u64 << 52) as f64;

/// One axis in plain floating point, so that all machines have the same bits.
#[derive(Clone, Copy)]
struct Steps {
    offset: f64,
    scale: f64,
}

impl Steps {
    fn of(axis: &Axis) -> Steps {
        let float = |value: rust_decimal::Decimal| value.to_f64().unwrap_or(f64::NAN);
        Steps { offset: float(axis.offset), scale: float(axis.scale) }
    }

    #[inline]
    fn value(self, raw: i64) -> f64 {
        self.offset + self.scale * raw as f64
    }

    /// Returns the nearest raw integer; [`BEYOND`] if there is none.
    #[inline]
    fn raw(self, value: f64) -> i64 {
        let steps = ((value - self.offset) / self.scale).round();
        if steps.abs() <= FARTHEST { steps as i64 } else { BEYOND }
    }
}

/// Transforms records on their way to another sink.
pub(crate) struct TransformedSink<'a, S> {
    transform: &'a RecordTransform<'a>,
    from: [Steps; 3],
    to: [Steps; 3],
    inner: &'a mut S,
}

impl<'a, S: RecordSink> TransformedSink<'a, S> {
    pub(crate) fn new(transform: &'a RecordTransform<'a>, inner: &'a mut S) -> TransformedSink<'a, S> {
        let [from, to] = transform.axes.map(|axes| axes.each_ref().map(Steps::of));
        TransformedSink { transform, from, to, inner }
    }

    /// Returns the place of a record; `None` if the other system has none there.
    fn place(&self, way: &CrsTransform, raw: &[i64; 3]) -> Option<[i64; 2]> {
        if raw[0] == BEYOND || raw[1] == BEYOND {
            return None;
        }
        let [x, y] = way.apply([self.from[0].value(raw[0]), self.from[1].value(raw[1])])?;
        let found = [self.to[0].raw(x), self.to[1].raw(y)];
        found.iter().all(|raw| *raw != BEYOND).then_some(found)
    }
}

/// Says that the record with these raw integers has no place in the other system.
#[cold]
fn no_place(transform: &RecordTransform, raw: &[i64; 3], place: &str) -> String {
    let value = |axis: usize| match raw[axis] {
        BEYOND => "beyond all numbers".to_string(),
        raw => transform.axes[0][axis].value(raw).to_string(),
    };
    format!(
        "{place}: x = {}, y = {} lies outside the area of {}; leave such points out with bounds, or name another to_crs",
        value(0),
        value(1),
        transform.target
    )
}

impl<S: RecordSink> PassingSink for TransformedSink<'_, S> {
    type Inner = S;

    fn inner(&mut self) -> &mut S {
        self.inner
    }

    fn pass(&mut self, number: u64, record: &PointRecord, place: impl Fn() -> String) -> Result<()> {
        let mut moved = *record;
        if let Some(factor) = self.transform.heights
            && ![BEYOND, NODATA].contains(&record.raw[2])
        {
            moved.raw[2] = self.to[2].raw(self.from[2].value(record.raw[2]) * factor);
        }
        if let Some(way) = &self.transform.way {
            match self.place(way, &record.raw) {
                Some([x, y]) => (moved.raw[0], moved.raw[1]) = (x, y),
                // Whether it counts as withheld, its place does not decide.
                None if record.withheld => {}
                None => {
                    let transform = self.transform;
                    self.inner
                        .push_outlier(record.class, record.pulse_return, || no_place(transform, &record.raw, &place()));
                    return Ok(());
                }
            }
        }
        self.inner.push(number, &moved, place)
    }
}
