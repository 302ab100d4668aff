//! What all phases of a job know.

use crate::durable::directory::JobDirectory;
use crate::index::PartIndex;
use crate::partition::parts::Parts;
use crate::plan::job_plan::Plan;
use crate::progress::clock::JobClock;
use crate::progress::stage::JobProgress;
use crate::run::part_entries::PartHeader;
use delaunay_gpu::triangulator::Triangulator;
use sys::fault;

/// A job that has run for so many seconds should not depend on what the system has yet to bring to the disk.
const WORTH_SYNCING: f64 = 60.0;

/// A job, of which this process does all or a task.
pub(crate) struct Job<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) parts: &'a Parts,
    pub(crate) directory: &'a JobDirectory,
    pub(crate) triangulator: &'a Triangulator,
    pub(crate) progress: &'a JobProgress,
    pub(crate) threads: usize,
    pub(crate) clock: JobClock,
    /// Tells the folders of this job's parts from those of others.
    pub(crate) id: u64,
    /// Whether points that were read before may be damaged, because a power failure may have come since.
    pub(crate) checks_points: bool,
    /// Whether this process does a task, and other machines the others.
    pub(crate) is_task: bool,
}

impl Job<'_> {
    /// Returns the first line of the journal of `part`.
    pub(crate) fn header(&self, part: PartIndex) -> PartHeader {
        PartHeader { job: self.id, part }
    }

    /// Returns the number of the nodes above the parts.
    pub(crate) fn above(&self) -> PartIndex {
        self.parts.tree.part
    }

    /// Tells whether what later phases need must be on the disk before they count on it. A small job that has not run for long is done again
    /// soon, but tasks on other machines may go on with a larger one at any time.
    pub(crate) fn syncs(&self) -> bool {
        self.parts.all().len() > 1 || self.clock.wall_s() > WORTH_SYNCING || fault::syncs_always()
    }
}
