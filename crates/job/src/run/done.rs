//! What a journal tells of a phase that is complete.

use crate::progress::stats::StageStats;
use serde::{Deserialize, Serialize};

/// A phase of a part that is complete.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Done<T> {
    /// What later phases and the report need to know of it.
    pub(crate) figures: T,
    /// How long it took, as far as the last process did it.
    pub(crate) seconds: f64,
    /// The largest resident set of that process, in bytes, up to the end of the phase.
    pub(crate) peak_memory: Option<u64>,
    pub(crate) stages: Vec<StageStats>,
    /// With `--update`, the key: a hash of everything that the phase was done with. It is done again if that has another key now. Else 0.
    #[serde(default)]
    pub(crate) key: u64,
}
