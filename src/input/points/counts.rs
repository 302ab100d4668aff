//! The count of what happened to every record.

use std::ops::AddAssign;

use serde::{Deserialize, Serialize};

/// The number of malformed records that a [`PointCounts`] describes.
pub(crate) const MOST_EXAMPLES: usize = 5;

/// What happened to the records of a source, or of a part of it:
/// `read = withheld + other_class + out_of_bounds + malformed + at_breaklines + kept`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PointCounts {
    /// Records seen, including the records missing from a truncated file.
    pub read: u64,
    /// Dropped: flagged as withheld.
    pub withheld: u64,
    /// Dropped: of a class that the job does not want.
    pub other_class: u64,
    /// Dropped: outside the job's bounds.
    pub out_of_bounds: u64,
    /// Dropped: not readable, or outside the lattice.
    pub malformed: u64,
    /// Dropped: they lie at a breakline, or in a lake.
    #[serde(default)]
    pub at_breaklines: u64,
    /// Points whose x or y was rounded to the lattice.
    pub rounded_xy: u64,
    /// Points whose z was rounded to the lattice.
    pub rounded_z: u64,
    /// Points handed on.
    pub kept: u64,
    /// The largest red, green or blue of the points handed on, and of those at breaklines.
    pub max_rgb: u16,
    /// The first few malformed records: file, record or line, and what is wrong.
    pub examples: Vec<String>,
}

impl PointCounts {
    /// Counts `count` points that were handed on as dropped at breaklines.
    pub(crate) fn drop_at_breaklines(&mut self, count: u64) {
        self.kept -= count;
        self.at_breaklines += count;
    }

    /// Counts `count` malformed records that `example` describes.
    pub(crate) fn add_malformed(&mut self, count: u64, example: impl FnOnce() -> String) {
        self.malformed += count;
        if self.examples.len() < MOST_EXAMPLES {
            self.examples.push(example());
        }
    }
}

impl AddAssign for PointCounts {
    fn add_assign(&mut self, other: PointCounts) {
        self.read += other.read;
        self.withheld += other.withheld;
        self.other_class += other.other_class;
        self.out_of_bounds += other.out_of_bounds;
        self.malformed += other.malformed;
        self.at_breaklines += other.at_breaklines;
        self.rounded_xy += other.rounded_xy;
        self.rounded_z += other.rounded_z;
        self.kept += other.kept;
        self.max_rgb = self.max_rgb.max(other.max_rgb);
        self.examples.extend(other.examples);
        self.examples.truncate(MOST_EXAMPLES);
    }
}
