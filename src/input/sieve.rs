//! One record at a time through the rules: filters, the way to the lattice, the tally, and slices of points to the sink.

use std::path::Path;

use super::Point;
use super::rules::{Rules, Tally};
use super::source::Axis;
use crate::Result;
use crate::geometry::lattice::REACH;

/// Points handed to the sink at once, at most: 384 KiB of them, which stays in the second-level cache.
const SLICE: usize = 1 << 14;

/// Where the points of a source go, in record order.
pub(super) type Sink<'a> = &'a mut dyn FnMut(&[Point]) -> Result<()>;

/// What a record says before it is judged. `raw` is in steps of the source's axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Record {
    pub(super) raw: [i64; 3],
    pub(super) rgb: [u16; 3],
    pub(super) class: u8,
    pub(super) withheld: bool,
    /// Whether x or y, and whether z, was rounded on the way to `raw`.
    pub(super) rounded: [bool; 2],
}

/// The rules at work on one piece of a source.
pub(super) struct Sieve<'a> {
    path: &'a Path,
    axes: &'a [Axis; 3],
    rules: &'a Rules,
    sink: Sink<'a>,
    points: Vec<Point>,
    pub(super) tally: Tally,
}

impl<'a> Sieve<'a> {
    pub(super) fn new(path: &'a Path, axes: &'a [Axis; 3], rules: &'a Rules, sink: Sink<'a>) -> Sieve<'a> {
        Sieve { path, axes, rules, sink, points: Vec::with_capacity(SLICE), tally: Tally::default() }
    }

    /// Judges record `number` of the source (from 0); `place` names it in an example ("record 12", "line 13").
    #[inline]
    pub(super) fn push(&mut self, number: u64, record: &Record, place: impl Fn() -> String) -> Result<()> {
        self.tally.read += 1;
        if record.withheld {
            self.tally.withheld += 1;
            return Ok(());
        }
        if !self.rules.classes[record.class as usize] {
            self.tally.other_class += 1;
            return Ok(());
        }
        let mapped = [0, 1, 2].map(|axis| self.rules.maps[axis].apply(record.raw[axis]));
        if let Some([x_min, y_min, x_max, y_max]) = self.rules.bounds {
            let inside = |value: Option<(i32, bool)>, low, high| value.is_some_and(|(v, _)| v >= low && v <= high);
            if !inside(mapped[0], x_min, x_max) || !inside(mapped[1], y_min, y_max) {
                self.tally.out_of_bounds += 1;
                return Ok(());
            }
        }
        match mapped {
            [Some((x, round_x)), Some((y, round_y)), Some((z, round_z))] if reached(x) && reached(y) => {
                self.tally.kept += 1;
                self.tally.rounded_xy += (round_x | round_y | record.rounded[0]) as u64;
                self.tally.rounded_z += (round_z | record.rounded[1]) as u64;
                let brightest = record.rgb[0].max(record.rgb[1]).max(record.rgb[2]);
                self.tally.max_rgb = self.tally.max_rgb.max(brightest);
                self.points.push(Point::new([x, y], z, record.rgb, record.class, self.rules.first_order + number));
                if self.points.len() == SLICE { self.flush() } else { Ok(()) }
            }
            _ => {
                let example = || self.outside(record, &mapped, &place());
                let text = if self.tally.examples.len() < super::rules::EXAMPLES { example() } else { String::new() };
                self.tally.add_malformed(1, || text);
                Ok(())
            }
        }
    }

    /// Counts `count` records that could not be read.
    pub(super) fn malformed(&mut self, count: u64, what: impl FnOnce() -> String) {
        let path = self.path;
        self.tally.read += count;
        self.tally.add_malformed(count, || format!("{}: {}", path.display(), what()));
    }

    /// Hands on what is left and gives the tally.
    pub(super) fn finish(mut self) -> Result<Tally> {
        self.flush()?;
        Ok(self.tally)
    }

    fn flush(&mut self) -> Result<()> {
        if !self.points.is_empty() {
            (self.sink)(&self.points)?;
            self.points.clear();
        }
        Ok(())
    }

    #[cold]
    fn outside(&self, record: &Record, mapped: &[Option<(i32, bool)>; 3], place: &str) -> String {
        let out = |axis: usize| mapped[axis].is_none_or(|(v, _)| axis < 2 && !reached(v));
        let axis = (0..3).find(|&axis| out(axis)).unwrap_or(2);
        let value = self.axes[axis].value(record.raw[axis]);
        let name = ["x", "y", "z"][axis];
        format!(
            "{}: {place}: {name} = {value} lies outside the range the job's lattice reaches; leave such points out with \
             bounds, or choose a coarser resolution",
            self.path.display()
        )
    }
}

fn reached(value: i32) -> bool {
    (-REACH..=REACH).contains(&value)
}
