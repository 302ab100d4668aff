//! One record at a time through the rules: filters, the way to the lattice, the tally, and slices of points to the sink.

use std::path::Path;

use crate::Result;
use crate::geometry::lattice::REACH;
use crate::input::points::axis::Axis;
use crate::input::points::point::Point;
use crate::input::points::record::PointRecord;
use crate::input::points::rules::{PointCounts, PointRules};

/// Points handed to the sink at once, at most: 384 KiB of them, which stays in the second-level cache.
const SLICE: usize = 1 << 14;

/// Where the points of a source go, in record order.
pub(crate) type Sink<'a> = &'a mut dyn FnMut(&[Point]) -> Result<()>;

/// Lattice integers in x, y and z, and whether they were rounded; `None` where they do not fit.
type Mapped = [Option<(i32, bool)>; 3];

/// The rules at work on one chunk of a source.
pub(crate) struct PointFilter<'a> {
    path: &'a Path,
    axes: &'a [Axis; 3],
    rules: &'a PointRules,
    sink: Sink<'a>,
    points: Vec<Point>,
    tally: PointCounts,
}

impl<'a> PointFilter<'a> {
    pub(crate) fn new(path: &'a Path, axes: &'a [Axis; 3], rules: &'a PointRules, sink: Sink<'a>) -> PointFilter<'a> {
        PointFilter { path, axes, rules, sink, points: Vec::with_capacity(SLICE), tally: PointCounts::default() }
    }

    /// Judges record `number` of the source (from 0); `place` names it in an example ("point 12", "line 13").
    #[inline]
    pub(crate) fn push(&mut self, number: u64, record: &PointRecord, place: impl Fn() -> String) -> Result<()> {
        if record.withheld {
            self.tally.withheld += 1;
            return Ok(());
        }
        if !self.rules.classes[record.class as usize] {
            self.tally.other_class += 1;
            return Ok(());
        }
        // One by one: `map` would become a call here, for every record.
        let [x, y, z] = &self.rules.maps;
        let mapped = [x.apply(record.raw[0]), y.apply(record.raw[1]), z.apply(record.raw[2])];
        if !self.in_bounds(&mapped) {
            self.tally.out_of_bounds += 1;
            return Ok(());
        }
        match mapped {
            [Some((x, round_x)), Some((y, round_y)), Some((z, round_z))] if reached(x) && reached(y) => {
                self.tally.rounded_xy += (round_x | round_y | record.rounded[0]) as u64;
                self.tally.rounded_z += (round_z | record.rounded[1]) as u64;
                self.keep(Point::new([x, y], z, record.rgb, record.class, self.rules.first_order + number))
            }
            _ => {
                let (value, name) = self.outside(record, &mapped);
                self.malformed(1, || {
                    format!(
                        "{}: {name} = {value} lies outside the range the job's lattice reaches; leave such points out with \
                         bounds, or choose a coarser resolution",
                        place()
                    )
                });
                Ok(())
            }
        }
    }

    #[inline]
    fn in_bounds(&self, mapped: &Mapped) -> bool {
        let inside = |axis: usize, low, high| mapped[axis].is_some_and(|(value, _)| value >= low && value <= high);
        self.rules.bounds.is_none_or(|[x_min, y_min, x_max, y_max]| inside(0, x_min, x_max) && inside(1, y_min, y_max))
    }

    #[inline]
    fn keep(&mut self, point: Point) -> Result<()> {
        self.tally.kept += 1;
        self.tally.max_rgb = self.tally.max_rgb.max(point.rgb[0].max(point.rgb[1]).max(point.rgb[2]));
        self.points.push(point);
        if self.points.len() == SLICE { self.flush() } else { Ok(()) }
    }

    /// Counts `count` records that cannot be used.
    pub(crate) fn malformed(&mut self, count: u64, what: impl FnOnce() -> String) {
        let path = self.path;
        self.tally.add_malformed(count, || format!("{}: {}", path.display(), what()));
    }

    /// Hands on what is left and gives the tally.
    pub(crate) fn finish(mut self) -> Result<PointCounts> {
        self.flush()?;
        let PointCounts { withheld, other_class, out_of_bounds, malformed, kept, .. } = self.tally;
        self.tally.read = withheld + other_class + out_of_bounds + malformed + kept;
        Ok(self.tally)
    }

    fn flush(&mut self) -> Result<()> {
        if !self.points.is_empty() {
            (self.sink)(&self.points)?;
            self.points.clear();
        }
        Ok(())
    }

    /// The value that has left the lattice, and its axis.
    #[cold]
    fn outside(&self, record: &PointRecord, mapped: &Mapped) -> (f64, &'static str) {
        let out = |axis: usize| mapped[axis].is_none_or(|(v, _)| axis < 2 && !reached(v));
        let axis = (0..3).find(|&axis| out(axis)).unwrap_or(2);
        (self.axes[axis].value(record.raw[axis]), ["x", "y", "z"][axis])
    }
}

fn reached(value: i32) -> bool {
    (-REACH..=REACH).contains(&value)
}
