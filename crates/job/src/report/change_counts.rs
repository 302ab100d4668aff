//! How much an update has changed.

use serde::{Deserialize, Serialize};

/// How many results have changed, as the report has it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ChangeCounts {
    /// Results that were there before and hold something else now.
    pub changed: u64,
    /// Results that were not there.
    pub added: u64,
    /// Results that are no longer there.
    pub removed: u64,
}
