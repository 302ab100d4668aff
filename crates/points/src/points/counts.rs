//! The count of what happened to every record.

use std::collections::BTreeMap;
use std::ops::AddAssign;

use serde::{Deserialize, Serialize};

/// The number of malformed records that a [`PointCounts`] describes.
pub(crate) const MOST_EXAMPLES: usize = 5;

/// What happened to the records of a source, or of a part of it:
/// `read = out_of_bounds + outside_clip + withheld + other_class + other_return + nodata + malformed + at_breaklines +
/// kept`. The first reason that applies counts, in the order
/// out of bounds, outside the polygons, withheld, class, return, nodata, lattice. So the numbers do not depend on whether an index tells what is out of bounds.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PointCounts {
    /// Records seen, including the records missing from a truncated file.
    pub read: u64,
    /// Dropped: flagged as withheld.
    pub withheld: u64,
    /// Dropped: of a class that the job does not want.
    pub other_class: u64,
    /// Dropped: of a return that the job does not want.
    #[serde(default)]
    pub other_return: u64,
    /// Dropped: outside the job's bounds, or the box of the polygons of its clip, or its heights.
    pub out_of_bounds: u64,
    /// Dropped: within all these, but outside the polygons of the clip.
    #[serde(default)]
    pub outside_clip: u64,
    /// Those out of bounds that were not even decoded, because the index or the header of the file says where they lie.
    #[serde(default)]
    pub not_decoded: u64,
    /// Dropped: their height stands for nodata.
    #[serde(default)]
    pub nodata: u64,
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
    /// Those of them that are on the ground or on water.
    #[serde(default)]
    pub ground: u64,
    /// Those of them that have no class that says something.
    #[serde(default)]
    pub unclassified: u64,
    /// Records within the bounds and not withheld, by class.
    #[serde(default)]
    pub classes: BTreeMap<u8, u64>,
    /// Records that do not say clearly which return of how many they are, if the job asks for that.
    #[serde(default)]
    pub unclear_returns: u64,
    /// Records that lie elsewhere than the index of the file says.
    #[serde(default)]
    pub misplaced: u64,
    /// The largest red, green or blue of the points handed on, and of those at breaklines.
    pub max_rgb: u16,
    /// The first few malformed records: file, record or line, and what is wrong.
    pub examples: Vec<String>,
    /// What else the user should know about the files, as far as only reading them shows it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
}

impl PointCounts {
    /// Counts points that were handed on as dropped at breaklines: how many, and how many of them on the ground and without a class that
    /// says something.
    pub fn drop_at_breaklines(&mut self, [count, ground, unclassified]: [u64; 3]) {
        self.kept -= count;
        self.ground -= ground;
        self.unclassified -= unclassified;
        self.at_breaklines += count;
    }

    /// Counts `count` malformed records that `example` describes.
    pub(crate) fn add_malformed(&mut self, count: u64, example: impl FnOnce() -> String) {
        self.malformed += count;
        if self.examples.len() < MOST_EXAMPLES {
            self.examples.push(example());
        }
    }

    /// Takes the records back that were not decoded: they are decoded after all.
    pub fn take_back_not_decoded(&mut self) {
        self.read -= self.not_decoded;
        self.out_of_bounds -= self.not_decoded;
        self.not_decoded = 0;
    }
}

impl AddAssign for PointCounts {
    fn add_assign(&mut self, other: PointCounts) {
        self.read += other.read;
        self.withheld += other.withheld;
        self.other_class += other.other_class;
        self.other_return += other.other_return;
        self.out_of_bounds += other.out_of_bounds;
        self.outside_clip += other.outside_clip;
        self.not_decoded += other.not_decoded;
        self.nodata += other.nodata;
        self.malformed += other.malformed;
        self.at_breaklines += other.at_breaklines;
        self.rounded_xy += other.rounded_xy;
        self.rounded_z += other.rounded_z;
        self.kept += other.kept;
        self.ground += other.ground;
        self.unclassified += other.unclassified;
        other.classes.into_iter().for_each(|(class, count)| *self.classes.entry(class).or_default() += count);
        self.unclear_returns += other.unclear_returns;
        self.misplaced += other.misplaced;
        self.max_rgb = self.max_rgb.max(other.max_rgb);
        self.examples.extend(other.examples);
        self.examples.truncate(MOST_EXAMPLES);
        self.notes.extend(other.notes);
    }
}
