//! What the report says of breaklines.

use crate::plan::breaklines::PlannedBreaklines;
use breaklines::Findings;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// What came of the breaklines of a job. How many points they made drop is among the counts of points.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct BreaklineReport {
    /// The files of lines. Ids of features have the numbers of their files in this list, from 0 on.
    #[serde(serialize_with = "sys::path_text::all_shown")]
    pub files: Vec<PathBuf>,
    /// Features that lie outside the box of the points. No other figure counts them.
    pub features_outside: u64,
    /// What cutting them has shown. Places and heights are in lattice steps.
    #[serde(flatten)]
    pub findings: Findings,
}

impl BreaklineReport {
    /// Returns the report about the breaklines of a plan.
    pub(crate) fn of(planned: &PlannedBreaklines) -> BreaklineReport {
        let PlannedBreaklines { files, findings, features_outside, .. } = planned;
        BreaklineReport { files: files.clone(), features_outside: *features_outside, findings: findings.clone() }
    }
}
