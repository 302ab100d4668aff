//! What a GPU did for a job.

use serde::{Deserialize, Serialize};

/// What a GPU did for a job, as the report tells it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GpuFigures {
    /// Leaves that it helped with.
    pub helped: u64,
    /// Leaves that workers did alone.
    pub alone: u64,
    /// Leaves that workers did because no mesh came that could be used: it was late, gone, or does not suit so large a leaf.
    pub in_vain: u64,
    /// Those of them that it gave up itself.
    #[serde(default)]
    pub flagged: u64,
    /// Those of them whose mesh did not suit.
    #[serde(default)]
    pub rejected: u64,
    /// Nanoseconds of processor time a site with its help, among the last leaves; 0 if there were none.
    pub ns_per_site_helped: f64,
    /// As above, without its help.
    pub ns_per_site_alone: f64,
    /// Why it was not asked any more.
    pub given_up: Option<String>,
}
