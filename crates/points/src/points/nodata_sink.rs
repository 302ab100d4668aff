//! Leaves the heights out that a job does not want, on the way of the records out of a LAS or LAZ file.

use crate::points::kept_heights::RawHeights;
use crate::points::record::{NODATA, PointRecord};
use crate::points::record_sink::{PassingSink, RecordSink};
use sys::Result;

/// Marks records whose raw heights stand for nodata, counts those as out of bounds that the job does not keep, and hands all others on.
pub(crate) struct NodataSink<'a, S> {
    pub(crate) nodata: &'a [i64],
    pub(crate) kept: Option<RawHeights>,
    pub(crate) inner: &'a mut S,
}

impl<S: RecordSink> PassingSink for NodataSink<'_, S> {
    type Inner = S;

    fn inner(&mut self) -> &mut S {
        self.inner
    }

    #[inline]
    fn pass(&mut self, number: u64, record: &PointRecord, place: impl Fn() -> String) -> Result<()> {
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
}
