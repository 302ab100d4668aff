//! What takes the records of a node: it numbers them as records of the whole data set, and compares them with the octree.

use std::path::Path;

use crate::ept::key::NodeKey;
use crate::points::axis::Axis;
use crate::points::octree::{cell_of, ends_of};
use crate::points::raw_bounds::RawBounds;
use crate::points::record::PointRecord;
use crate::points::record_sink::RecordSink;
use crate::points::returns::PulseReturn;
use sys::{Error, Result};

/// Where the points of a node lie by the octree, in raw steps.
#[derive(Clone, Copy)]
pub(super) struct NodeCell {
    pub(super) plane: RawBounds,
    /// Least and greatest z.
    heights: [i64; 2],
}

impl NodeCell {
    /// Returns the cell of a node. `min` is the least x, y, z of the octree's cube, and `side` its sides, in raw steps.
    pub(super) fn of(min: [f64; 3], side: [f64; 3], NodeKey(level, [x, y, z]): NodeKey) -> NodeCell {
        let [x_min, y_min, z_min] = min;
        let [x_side, y_side, z_side] = side;
        NodeCell {
            plane: cell_of([x_min, y_min], [x_side, y_side], level, [x, y]),
            heights: ends_of(z_min, z_side, level, z),
        }
    }

    #[inline]
    fn holds(&self, raw: &[i64; 3]) -> bool {
        let [least, greatest] = self.heights;
        self.plane.hold(raw) && least <= raw[2] && raw[2] <= greatest
    }
}

/// Passes the records of one node on.
pub(super) struct NodeSink<'a, S> {
    /// The index of the data set.
    pub(super) index: &'a Path,
    /// The file of the node, for messages.
    pub(super) file: &'a Path,
    /// The number of its first record in the data set.
    pub(super) first: u64,
    /// Where its points lie by the octree, if they are compared with it.
    pub(super) cell: Option<NodeCell>,
    /// What raw integers mean, for messages.
    pub(super) axes: &'a [Axis; 3],
    pub(super) inner: &'a mut S,
}

impl<S: RecordSink> RecordSink for NodeSink<'_, S> {
    fn push(&mut self, number: u64, record: &PointRecord, place: impl Fn() -> String) -> Result<()> {
        let file = self.file.display();
        if self.cell.is_some_and(|cell| !cell.holds(&record.raw)) {
            let [x, y, z] = [0, 1, 2].map(|axis| self.axes[axis].value(record.raw[axis]));
            let what = format!(
                "{} of {file}, at ({x}, {y}, {z}), lies outside its cell of the octree: bounds, scale or offset of the index are wrong, or this \
                 node is not its own; build or copy the data set again",
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
