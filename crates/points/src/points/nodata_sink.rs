//! Leaves the heights out that a job does not want, on the way of the records out of a LAS or LAZ file.

use crate::points::kept_heights::RawHeights;
use crate::points::record::{NODATA, PointRecord};
use crate::points::record_sink::RecordSink;
use crate::points::returns::PulseReturn;
use sys::Result;

/// Marks records whose raw heights stand for nodata, counts those as out of bounds that the job does not keep, and hands all others on.
pub(crate) struct NodataSink<'a, S> {
    pub(crate) nodata: &'a [i64],
    pub(crate) kept: Option<RawHeights>,
    pub(crate) inner: &'a mut S,
}

impl<S: RecordSink> RecordSink for NodataSink<'_, S> {
    #[inline]
    fn push(&mut self, number: u64, record: &PointRecord, place: impl Fn() -> String) -> Result<()> {
        let [x, y, z] = record.raw;
        if self.kept.is_some_and(|kept| !kept.hold(z)) {
            self.inner.push_out_of_bounds(record.class);
            return Ok(());
        }
        if !self.nodata.contains(&z) {
            return self.inner.push(number, record, place);
        }
        self.inner.push(number, &PointRecord { raw: [x, y, NODATA], ..*record }, place)
    }

    fn push_out_of_bounds(&mut self, class: u8) {
        self.inner.push_out_of_bounds(class);
    }

    fn push_outlier(&mut self, class: u8, pulse_return: PulseReturn, what: impl FnOnce() -> String) {
        self.inner.push_outlier(class, pulse_return, what);
    }

    fn malformed(&mut self, count: u64, what: impl FnOnce() -> String) {
        self.inner.malformed(count, what);
    }

    fn not_decoded(&mut self, count: u64) {
        self.inner.not_decoded(count);
    }

    fn misplaced(&mut self, count: u64) {
        self.inner.misplaced(count);
    }
}
