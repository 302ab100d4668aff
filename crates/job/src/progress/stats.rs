//! The figures of a stage for the report.

use serde::{Deserialize, Serialize};

/// What a stage took.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct StageStats {
    /// Its name.
    pub stage: String,
    /// Seconds from the start of the job to its start.
    #[serde(default)]
    pub start_s: f64,
    /// Seconds from its start to its end.
    pub wall_s: f64,
    /// Seconds of processor time of all threads.
    pub cpu_s: f64,
    /// How many of its units this run did.
    pub done: u64,
    /// The name of its units.
    pub unit: String,
}

impl StageStats {
    /// Adds what the same stage of another part took.
    pub fn add(&mut self, other: &StageStats) {
        self.wall_s += other.wall_s;
        self.cpu_s += other.cpu_s;
        self.done += other.done;
    }
}
