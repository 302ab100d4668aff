//! What this process has asked of other machines so far.

use std::sync::atomic::{AtomicU64, Ordering};

use serde::{Deserialize, Serialize};

static REQUESTS: AtomicU64 = AtomicU64::new(0);
static BYTES: AtomicU64 = AtomicU64::new(0);

/// What a process has asked of other machines and what came back.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct NetworkTraffic {
    /// Requests, repeated ones included.
    pub requests: u64,
    /// Bytes of files that came, repeated ones included.
    pub bytes: u64,
}

impl NetworkTraffic {
    /// Returns that of this process so far.
    pub fn so_far() -> NetworkTraffic {
        NetworkTraffic { requests: REQUESTS.load(Ordering::Relaxed), bytes: BYTES.load(Ordering::Relaxed) }
    }
}

/// Counts a request.
#[cfg(feature = "remote")]
pub(crate) fn count_request() {
    REQUESTS.fetch_add(1, Ordering::Relaxed);
}

/// Counts bytes that came.
#[cfg(feature = "remote")]
pub(crate) fn count_bytes(bytes: usize) {
    BYTES.fetch_add(bytes as u64, Ordering::Relaxed);
}
