//! What takes the records of a node: it numbers them as records of the whole data set, and compares them with the octree.

use std::path::Path;

use crate::points::raw_bounds::RawBounds;
use crate::points::record::PointRecord;
use crate::points::record_sink::RecordSink;
use crate::points::returns::PulseReturn;
use sys::{Error, Result};

/// Passes the records of one node on.
pub(super) struct NodeSink<'a, S> {
    /// The index of the data set.
    pub(super) index: &'a Path,
    /// The file of the node, for messages.
    pub(super) file: &'a Path,
    /// The number of its first record in the data set.
    pub(super) first: u64,
    /// Where its points lie by the octree, if bounds make that matter.
    pub(super) cell: Option<RawBounds>,
    pub(super) inner: &'a mut S,
}

impl<S: RecordSink> RecordSink for NodeSink<'_, S> {
    fn push(&mut self, number: u64, record: &PointRecord, place: impl Fn() -> String) -> Result<()> {
        let file = self.file.display();
        if self.cell.is_some_and(|cell| !cell.hold(&record.raw)) {
            let what = format!(
                "{} of {file} lies outside its cell of the octree, so points within bounds cannot be found: build the data set \
                 again, or leave [input] bounds and clip out",
                place()
            );
            return Err(Error::input(self.index, what));
        }
        self.inner.push(self.first + number, record, || format!("{} of {file}", place()))
    }

    fn push_out_of_bounds(&mut self, class: u8) {
        self.inner.push_out_of_bounds(class);
    }

    fn push_outlier(&mut self, class: u8, pulse_return: PulseReturn, what: impl FnOnce() -> String) {
        self.inner.push_outlier(class, pulse_return, what);
    }

    fn malformed(&mut self, count: u64, what: impl FnOnce() -> String) {
        let file = self.file;
        self.inner.malformed(count, || format!("{}: {}", file.display(), what()));
    }

    fn not_decoded(&mut self, count: u64) {
        self.inner.not_decoded(count);
    }

    fn misplaced(&mut self, count: u64) {
        self.inner.misplaced(count);
    }
}
