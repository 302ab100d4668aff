//! The filter: applies the rules to one record at a time, maps its coordinates to the lattice, counts it, and hands points on.

use std::collections::BTreeMap;
use std::path::Path;

use crate::Result;
use crate::geometry::lattice::{BEYOND, REACH};
use crate::input::points::axis::{AXIS_NAMES, Axis};
use crate::input::points::classes::{is_ground, is_unclassified};
use crate::input::points::counts::PointCounts;
use crate::input::points::point::Point;
use crate::input::points::record::PointRecord;
use crate::input::points::record_sink::RecordSink;
use crate::input::points::returns::{KeptReturns, PulseReturn};
use crate::input::points::rules::PointRules;

/// The most points handed to the sink at once: 448 KiB of them, which stays in the second-level cache.
const SLICE: usize = 1 << 14;

/// Takes the points of a source, in record order.
pub(crate) type Sink<'a> = &'a mut dyn FnMut(&[Point]) -> Result<()>;

/// Lattice integers in x, y and z, each with whether it was rounded; `None` where the integer does not fit an `i32`.
type Mapped = [Option<(i32, bool)>; 3];

/// Filters the records of one chunk of a source.
pub(crate) struct PointFilter<'a> {
    path: &'a Path,
    axes: &'a [Axis; 3],
    rules: &'a PointRules,
    sink: Sink<'a>,
    points: Vec<Point>,
    counts: PointCounts,
    /// Records within the bounds and not withheld, by class.
    classes: [u64; 256],
    /// Points handed on, by class.
    kept: [u64; 256],
}

impl<'a> PointFilter<'a> {
    /// Returns a filter for records of the file at `path` with these `axes`; points that pass `rules` go to `sink`.
    pub(crate) fn new(path: &'a Path, axes: &'a [Axis; 3], rules: &'a PointRules, sink: Sink<'a>) -> PointFilter<'a> {
        let (points, counts) = (Vec::with_capacity(SLICE), PointCounts::default());
        PointFilter { path, axes, rules, sink, points, counts, classes: [0; 256], kept: [0; 256] }
    }

    #[inline]
    fn keep(&mut self, point: Point) -> Result<()> {
        self.kept[point.class as usize] += 1;
        self.counts.max_rgb = self.counts.max_rgb.max(point.rgb[0].max(point.rgb[1]).max(point.rgb[2]));
        self.points.push(point);
        if self.points.len() == SLICE { self.flush() } else { Ok(()) }
    }

    /// Hands on the last points and returns the counts.
    pub(crate) fn finish(mut self) -> Result<PointCounts> {
        self.flush()?;
        for (class, kept) in (0..=u8::MAX).zip(self.kept) {
            self.counts.kept += kept;
            self.counts.ground += if is_ground(class) { kept } else { 0 };
            self.counts.unclassified += if is_unclassified(class) { kept } else { 0 };
        }
        let PointCounts { withheld, other_class, other_return, out_of_bounds, malformed, kept, .. } = self.counts;
        self.counts.read = withheld + other_class + other_return + out_of_bounds + malformed + kept;
        let classes: BTreeMap<u8, u64> = (0..=u8::MAX).zip(self.classes).filter(|(_, count)| *count > 0).collect();
        self.counts.classes = classes;
        Ok(self.counts)
    }

    /// Returns whether the job keeps a return, and counts it if it does not, or if the record does not say clearly which it is.
    #[inline]
    fn keeps_return(&mut self, pulse_return: PulseReturn) -> bool {
        if self.rules.returns == KeptReturns::All {
            return true;
        }
        self.counts.unclear_returns += u64::from(!pulse_return.is_clear());
        let is_kept = self.rules.returns.has(pulse_return);
        self.counts.other_return += u64::from(!is_kept);
        is_kept
    }

    fn flush(&mut self) -> Result<()> {
        if !self.points.is_empty() {
            (self.sink)(&self.points)?;
            self.points.clear();
        }
        Ok(())
    }

    /// Returns the first coordinate that is outside the lattice's reach, and the name of its axis.
    #[cold]
    fn out_of_reach(&self, record: &PointRecord, mapped: &Mapped) -> (String, &'static str) {
        let is_out = |axis: usize| mapped[axis].is_none_or(|(v, _)| axis < 2 && !in_reach(v));
        let axis = (0..3).find(|&axis| is_out(axis)).unwrap_or(2);
        let value = match record.raw[axis] {
            BEYOND => format!("more than 10^18 steps of {}", self.axes[axis].scale),
            raw => self.axes[axis].value(raw).to_string(),
        };
        (value, AXIS_NAMES[axis])
    }
}

impl RecordSink for PointFilter<'_> {
    #[inline]
    fn push(&mut self, number: u64, record: &PointRecord, place: impl Fn() -> String) -> Result<()> {
        if self.rules.bounds.as_ref().is_some_and(|bounds| !bounds.hold(&record.raw)) {
            self.counts.out_of_bounds += 1;
            return Ok(());
        }
        if record.withheld {
            self.counts.withheld += 1;
            return Ok(());
        }
        self.classes[record.class as usize] += 1;
        if !self.rules.classes[record.class as usize] {
            self.counts.other_class += 1;
            return Ok(());
        }
        if !self.keeps_return(record.pulse_return) {
            return Ok(());
        }
        // One by one: `array::map` compiles to a call for every record here.
        let [x, y, z] = &self.rules.maps;
        let mapped = [x.apply(record.raw[0]), y.apply(record.raw[1]), z.apply(record.raw[2])];
        match mapped {
            [Some((x, round_x)), Some((y, round_y)), Some((z, round_z))] if in_reach(x) && in_reach(y) => {
                self.counts.rounded_xy += (round_x | round_y | record.rounded[0]) as u64;
                self.counts.rounded_z += (round_z | record.rounded[1]) as u64;
                let point = Point::new([x, y], z, record.rgb, record.class, self.rules.first_order + number);
                self.keep(point.with_intensity(record.intensity))
            }
            _ => {
                let (value, name) = self.out_of_reach(record, &mapped);
                self.malformed(1, || {
                    format!(
                        "{}: {name} = {value} lies outside the range that the job's lattice reaches; leave such points out \
                         with bounds, or choose a coarser resolution",
                        place()
                    )
                });
                Ok(())
            }
        }
    }

    #[inline]
    fn push_out_of_bounds(&mut self, _: u8) {
        self.counts.out_of_bounds += 1;
    }

    #[cold]
    fn push_outlier(&mut self, class: u8, pulse_return: PulseReturn, what: impl FnOnce() -> String) {
        // A text leaves rows beyond the bounds out by itself. What has no place in another system is not within bounds there.
        let is_out_of_bounds = self.rules.bounds.is_some();
        if is_out_of_bounds {
            self.push_out_of_bounds(class);
        } else if !self.rules.classes[class as usize] {
            self.counts.other_class += 1;
        } else if self.keeps_return(pulse_return) {
            self.malformed(1, what);
        }
    }

    fn malformed(&mut self, count: u64, what: impl FnOnce() -> String) {
        let path = self.path;
        self.counts.add_malformed(count, || format!("{}: {}", path.display(), what()));
    }

    fn not_decoded(&mut self, count: u64) {
        self.counts.out_of_bounds += count;
        self.counts.not_decoded += count;
    }

    fn misplaced(&mut self, count: u64) {
        self.counts.misplaced += count;
    }
}

/// Returns whether a lattice integer in x or y is within reach. Unlike `value.abs() <= REACH`, this is right for `i32::MIN`.
fn in_reach(value: i32) -> bool {
    (-REACH..=REACH).contains(&value)
}
