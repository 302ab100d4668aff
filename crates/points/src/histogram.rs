//! How many points of each class and of each return a point cloud holds: for people, and as JSON.

use std::collections::BTreeMap;
use std::fmt;

use rayon::prelude::*;
use serde::Serialize;

use crate::points::chunk_request::ChunkRequest;
use crate::points::classes;
use crate::points::record::PointRecord;
use crate::points::record_sink::RecordSink;
use crate::points::returns::PulseReturn;
use crate::source::Source;
use crate::surface::SurfaceShares;
use sys::Result;

/// The number of points of each kind. Points flagged as withheld count with the others.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Histogram {
    /// Points by classification; empty if the file has none.
    pub classes: BTreeMap<u8, u64>,
    /// Points by the number of the return; empty if the file does not say. No return has the number 0: such points are not as they
    /// should be.
    pub returns: BTreeMap<u8, u64>,
    /// Points that are flagged as withheld.
    pub withheld: u64,
    /// Records that cannot be read.
    pub malformed: u64,
}

impl Histogram {
    /// Returns the shares that tell what a mesh of all points but noise is. Of a file without classes they are of no point.
    pub fn shares(&self) -> SurfaceShares {
        let mut shares = SurfaceShares::default();
        self.classes.iter().for_each(|(&class, &count)| shares.add(class, count));
        shares
    }

    /// Counts all points of `source`, on the threads of the current rayon pool. Calls `done` with numbers of points that were counted.
    ///
    /// # Errors
    /// [`sys::Error::Io`] or [`sys::Error::Input`] if the file cannot be read or has changed since it was opened.
    pub fn of(source: &Source, done: &(dyn Fn(u64) + Sync)) -> Result<Histogram> {
        let count = |chunk| {
            let mut counts = RecordCounts::default();
            source.read_chunk(chunk, ChunkRequest::all(), &mut counts)?;
            done(counts.records());
            Ok(counts)
        };
        let none = RecordCounts::default;
        let _ahead = source.read_ahead(None, false)?;
        let counts = (0..source.chunks()).into_par_iter().map(count).try_reduce(none, |a, b| Ok(a.with(&b)))?;
        let returns = if source.format.is_text() { &[] } else { &counts.returns[..] };
        Ok(Histogram {
            classes: present(if source.has_class { &counts.classes } else { &[] }),
            returns: present(returns),
            withheld: counts.withheld,
            malformed: counts.malformed,
        })
    }
}

/// Returns the counts that are not 0, each with its number.
fn present(counts: &[u64]) -> BTreeMap<u8, u64> {
    (0..=u8::MAX).zip(counts).filter(|(_, count)| **count > 0).map(|(number, count)| (number, *count)).collect()
}

impl fmt::Display for Histogram {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write_counts(f, "class", &self.classes, classes::name)?;
        write_counts(f, "return", &self.returns, |number| if number == 0 { "no return has this number" } else { "" })?;
        for (name, count) in [("withheld", self.withheld), ("malformed", self.malformed)] {
            if count > 0 {
                writeln!(f, "  {name:<8} {count}")?;
            }
        }
        Ok(())
    }
}

/// Writes a line for each count: its number, the points, their share, and a name.
fn write_counts(
    f: &mut fmt::Formatter,
    kind: &str,
    counts: &BTreeMap<u8, u64>,
    name: impl Fn(u8) -> &'static str,
) -> fmt::Result {
    let all = counts.values().sum::<u64>().max(1);
    for (number, count) in counts {
        let share = *count as f64 * 100.0 / all as f64;
        let line = format!("  {kind:<8} {number:>3} {count:>14} {share:>5.1} %  {}", name(*number));
        writeln!(f, "{}", line.trim_end())?;
    }
    Ok(())
}

/// Counts records.
struct RecordCounts {
    classes: [u64; 256],
    returns: [u64; 16],
    withheld: u64,
    malformed: u64,
}

impl Default for RecordCounts {
    fn default() -> RecordCounts {
        RecordCounts { classes: [0; 256], returns: [0; 16], withheld: 0, malformed: 0 }
    }
}

impl RecordCounts {
    fn records(&self) -> u64 {
        self.classes.iter().sum::<u64>() + self.malformed
    }

    fn with(mut self, other: &RecordCounts) -> RecordCounts {
        self.classes.iter_mut().zip(&other.classes).for_each(|(count, other)| *count += other);
        self.returns.iter_mut().zip(&other.returns).for_each(|(count, other)| *count += other);
        self.withheld += other.withheld;
        self.malformed += other.malformed;
        self
    }
}

impl RecordSink for RecordCounts {
    fn push(&mut self, _: u64, record: &PointRecord, _: impl Fn() -> String) -> Result<()> {
        self.classes[record.class as usize] += 1;
        self.returns[(record.pulse_return.number & 15) as usize] += 1;
        self.withheld += u64::from(record.withheld);
        Ok(())
    }

    fn push_out_of_bounds(&mut self, class: u8) {
        self.classes[class as usize] += 1;
    }

    fn push_outlier(&mut self, class: u8, _: PulseReturn, _: impl FnOnce() -> String) {
        self.classes[class as usize] += 1;
    }

    fn malformed(&mut self, count: u64, _: impl FnOnce() -> String) {
        self.malformed += count;
    }

    /// All records are decoded.
    fn not_decoded(&mut self, _: u64) {}

    /// Only bounds make an index count.
    fn misplaced(&mut self, _: u64) {}
}
