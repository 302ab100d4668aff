//! Marks the records whose heights stand for nodata on their way out of a file.

use crate::Result;
use crate::input::points::record::{NODATA, PointRecord};
use crate::input::points::record_sink::RecordSink;
use crate::input::points::returns::PulseReturn;

/// Marks records that have one of these raw heights, and hands all on.
pub(crate) struct NodataSink<'a, S> {
    pub(crate) heights: &'a [i64],
    pub(crate) inner: &'a mut S,
}

impl<S: RecordSink> RecordSink for NodataSink<'_, S> {
    #[inline]
    fn push(&mut self, number: u64, record: &PointRecord, place: impl Fn() -> String) -> Result<()> {
        if !self.heights.contains(&record.raw[2]) {
            return self.inner.push(number, record, place);
        }
        let [x, y, _] = record.raw;
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
