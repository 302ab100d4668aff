//! What takes the records of a source: the filter of a job, or a count.

use crate::points::record::PointRecord;
use crate::points::returns::PulseReturn;
use sys::Result;

/// Takes records, in their order. Every record of a source comes once, or is counted by [`RecordSink::malformed`].
pub(crate) trait RecordSink {
    /// Takes record `number` of the source (from 0). `place` names it for a message ("point 12", "line 13").
    fn push(&mut self, number: u64, record: &PointRecord, place: impl Fn() -> String) -> Result<()>;

    /// Takes a record of this class that lies outside the job's bounds, though its lattice point may not.
    fn push_out_of_bounds(&mut self, class: u8);

    /// Takes a record of this class and return within the job's bounds that lies too far from all others. `what` describes it.
    fn push_outlier(&mut self, class: u8, pulse_return: PulseReturn, what: impl FnOnce() -> String);

    /// Takes notice of `count` records that cannot be used; `what` says why.
    fn malformed(&mut self, count: u64, what: impl FnOnce() -> String);

    /// Takes notice of `count` records that are not decoded, because the index of the source says that they lie out of bounds.
    fn not_decoded(&mut self, count: u64);

    /// Takes notice of `count` records that lie elsewhere than the index of the source says. They come by [`RecordSink::push`] too.
    fn misplaced(&mut self, count: u64);
}

/// A sink that changes records, or leaves some out, on their way to another sink.
pub(crate) trait PassingSink {
    /// Where they go.
    type Inner: RecordSink;

    /// Returns where they go.
    fn inner(&mut self) -> &mut Self::Inner;

    /// As [`RecordSink::push`].
    fn pass(&mut self, number: u64, record: &PointRecord, place: impl Fn() -> String) -> Result<()>;
}

impl<T: PassingSink> RecordSink for T {
    #[inline]
    fn push(&mut self, number: u64, record: &PointRecord, place: impl Fn() -> String) -> Result<()> {
        self.pass(number, record, place)
    }

    fn push_out_of_bounds(&mut self, class: u8) {
        self.inner().push_out_of_bounds(class);
    }

    fn push_outlier(&mut self, class: u8, pulse_return: PulseReturn, what: impl FnOnce() -> String) {
        self.inner().push_outlier(class, pulse_return, what);
    }

    fn malformed(&mut self, count: u64, what: impl FnOnce() -> String) {
        self.inner().malformed(count, what);
    }

    fn not_decoded(&mut self, count: u64) {
        self.inner().not_decoded(count);
    }

    fn misplaced(&mut self, count: u64) {
        self.inner().misplaced(count);
    }
}
