//! How many bytes the temporary files of a job take while parts of them are freed, for the report.

use crate::partition::result::Partition;
use crate::records::Store;
use std::sync::atomic::{AtomicU64, Ordering};

/// Bytes that were freed, and the most that there were.
#[derive(Default)]
pub(crate) struct TemporaryBytes {
    freed_points: AtomicU64,
    peak: AtomicU64,
}

impl TemporaryBytes {
    /// Notes that so many bytes of the points were freed.
    pub(crate) fn points_freed(&self, bytes: u64) {
        self.freed_points.fetch_add(bytes, Ordering::Relaxed);
    }

    /// Returns the most bytes that points and store took at any time when this was called.
    pub(crate) fn measure(&self, partition: &Partition, store: &Store) -> u64 {
        let points = partition.point_bytes.saturating_sub(self.freed_points.load(Ordering::Relaxed));
        let now = points + store.bytes();
        self.peak.fetch_max(now, Ordering::Relaxed).max(now)
    }
}
