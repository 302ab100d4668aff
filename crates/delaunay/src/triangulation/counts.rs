//! How leaves were triangulated.

use crate::voronoi::counts::PipelineCounts;
use std::ops::AddAssign;

/// How many leaves were triangulated in which way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct TriangulationCounts {
    /// Leaves that the discrete-Voronoi pipeline triangulated.
    pub pipeline: u64,
    /// Leaves that `spade` triangulated: all with `backend = "reference"`.
    pub reference: u64,
    /// Leaves that are too small (or too large) for the pipeline, and were divided and conquered.
    pub small: u64,
    /// Leaves that the pipeline gave up because too many sites shared a pixel, and that were divided and conquered.
    pub crowded: u64,
    /// Leaves whose mesh failed the pipeline's acceptance check, and that were divided and conquered.
    pub not_accepted: u64,
    /// What the pipeline counted.
    pub counts: PipelineCounts,
}

impl TriangulationCounts {
    /// Returns the number of all leaves.
    pub fn leaves(&self) -> u64 {
        self.pipeline + self.reference + self.small + self.crowded + self.not_accepted
    }
}

impl AddAssign for TriangulationCounts {
    fn add_assign(&mut self, other: TriangulationCounts) {
        self.pipeline += other.pipeline;
        self.reference += other.reference;
        self.small += other.small;
        self.crowded += other.crowded;
        self.not_accepted += other.not_accepted;
        self.counts += other.counts;
    }
}
