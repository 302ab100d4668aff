//! What the steps of the pipeline count, and how long they take.

use crate::host::cpu_seconds;

/// The steps that [`PipelineCounts::nanoseconds`] distinguishes.
pub const STEP_NAMES: [&str; 8] = [
    "G1 write sites",
    "G2-G6 Voronoi, triangles, most flips",
    "G3 islands",
    "C2 shift",
    "C1 hull",
    "C4 flip",
    "C3 insert",
    "accept",
];

/// What the steps count: sites, triangles or edges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PipelineCounts {
    /// Leaves whose mesh a GPU has made.
    pub on_gpu: u64,
    /// Sites given.
    pub sites: u64,
    /// Sites that found no free pixel and were inserted one by one.
    pub missing: u64,
    /// Sites that were moved to a neighbouring pixel.
    pub moved: u64,
    /// Pieces of Voronoi regions that are not connected to their site.
    pub islands: u64,
    /// Triangles that were not counterclockwise once the sites were at their true places.
    pub inverted: u64,
    /// Sites that were removed for that reason and inserted again.
    pub removed: u64,
    /// Edges that were flipped to make the mesh Delaunay.
    pub flips: u64,
    /// The processor time of each step; see [`STEP_NAMES`].
    pub nanoseconds: [u64; STEP_NAMES.len()],
}

impl std::ops::AddAssign for PipelineCounts {
    fn add_assign(&mut self, other: PipelineCounts) {
        self.on_gpu += other.on_gpu;
        self.sites += other.sites;
        self.missing += other.missing;
        self.moved += other.moved;
        self.islands += other.islands;
        self.inverted += other.inverted;
        self.removed += other.removed;
        self.flips += other.flips;
        for (mine, theirs) in self.nanoseconds.iter_mut().zip(other.nanoseconds) {
            *mine += theirs;
        }
    }
}

/// Measures the processor time of the steps one after the other. Where the system does not tell it, all are zero.
pub(super) struct StepTimer(f64);

impl StepTimer {
    /// Starts the first step.
    pub(super) fn start() -> StepTimer {
        StepTimer(cpu_seconds())
    }

    /// Adds the time since the last call to `step`, and starts the next step.
    pub(super) fn finish(&mut self, counts: &mut PipelineCounts, step: usize) {
        let now = cpu_seconds();
        counts.nanoseconds[step] += ((now - self.0) * 1e9) as u64;
        self.0 = now;
    }
}
