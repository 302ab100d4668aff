//! What all phases of a job of several parts know.

use crate::durable::directory::JobDirectory;
use crate::index::PartIndex;
use crate::partition::parts::Parts;
use crate::plan::job_plan::Plan;
use crate::progress::clock::JobClock;
use crate::progress::stage::JobProgress;
use crate::records::Journal;
use crate::run::part_entries::PartHeader;
use crate::run::run_context::RunContext;
use delaunay_gpu::triangulator::Triangulator;

/// A job of several parts, of which this process does all or a task.
pub(crate) struct PartsJob<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) parts: &'a Parts,
    pub(crate) directory: &'a JobDirectory,
    pub(crate) triangulator: &'a Triangulator,
    pub(crate) progress: &'a JobProgress,
    pub(crate) threads: usize,
    pub(crate) clock: JobClock,
    /// Tells the folders of this job's parts from those of others.
    pub(crate) job_id: u64,
    /// The number of steps that an interrupted run had finished.
    pub(crate) resumed: u64,
    /// What an interrupted run left may be damaged, because a power failure may have interrupted it.
    pub(crate) checks: bool,
    /// The journal of the job, if this process does all of it.
    pub(crate) journal: Option<&'a Journal<'a>>,
}

impl<'a> PartsJob<'a> {
    /// Returns the job of a run that does all of it.
    pub(crate) fn of_run(run: &'a RunContext<'a>, plan: &'a Plan, parts: &'a Parts) -> PartsJob<'a> {
        PartsJob {
            plan,
            parts,
            directory: run.directory,
            triangulator: run.triangulator,
            progress: run.progress,
            threads: run.threads,
            clock: run.clock,
            job_id: run.job_id,
            resumed: run.resumed,
            checks: run.resumed > 0 && !run.is_by_tasks,
            journal: Some(run.journal),
        }
    }

    /// Returns the first line of the journal of `part`.
    pub(crate) fn header(&self, part: PartIndex) -> PartHeader {
        PartHeader { job: self.job_id, part }
    }

    /// Returns the number of the nodes above the parts.
    pub(crate) fn above(&self) -> PartIndex {
        PartIndex::new(self.parts.all().len())
    }

    /// Tells whether points must be on the disk before others count on them. Other machines do so at once.
    pub(crate) fn syncs_points(&self) -> bool {
        self.journal.is_none_or(Journal::is_worth_syncing)
    }
}
