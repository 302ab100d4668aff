//! What the steps of a running job share.

use crate::durable::directory::JobDirectory;
use crate::durable::journal::JournalPosition;
use crate::plan::fingerprint::JobIdentity;
use crate::progress::clock::JobClock;
use crate::progress::stage::{JobProgress, Stage};
use crate::progress::stats::StageStats;
use crate::records::{JobStep, Journal, Store};
use crate::run::temporary_bytes::TemporaryBytes;
use delaunay_gpu::triangulator::Triangulator;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::SystemTime;
use sys::Result;

/// A run whose directory is locked, with its store and journal.
pub(crate) struct RunContext<'a> {
    pub(crate) triangulator: &'a Triangulator,
    pub(crate) directory: &'a JobDirectory,
    pub(crate) store: &'a Store,
    pub(crate) journal: &'a Journal<'a>,
    pub(crate) progress: &'a JobProgress,
    pub(crate) threads: usize,
    pub(crate) clock: JobClock,
    /// When tasks began what this run ends.
    pub(crate) begun: Option<SystemTime>,
    /// What tells the job from others.
    pub(crate) identity: JobIdentity,
    /// Tells the folders of this job's parts from those of others.
    pub(crate) job_id: u64,
    /// The number of steps that an interrupted run had finished.
    pub(crate) resumed: u64,
    /// Whether what is there is the work of tasks, which is not compared with its hashes.
    pub(crate) is_by_tasks: bool,
    /// What the temporary files take.
    pub(crate) temporary: TemporaryBytes,
    /// The stages that have ended.
    pub(crate) stages: Mutex<Vec<StageStats>>,
}

impl RunContext<'_> {
    /// Counts the units of `step` as done, by this run or by an earlier one.
    pub(crate) fn count(&self, stage: &Stage, step: JobStep, amount: u64) {
        if self.journal.has(step) { stage.take_over(amount) } else { stage.advance(amount) }
    }

    /// Returns the seconds since the job began. Machines may have clocks that differ, so it is no less than what this process took.
    pub(crate) fn wall_s(&self) -> f64 {
        let since = self.begun.and_then(|begun| begun.elapsed().ok()).map_or(0.0, |since| since.as_secs_f64());
        since.max(self.clock.wall_s())
    }

    /// Adds a stage to the report, or to the stage of the same name: parts have the same stages.
    pub(crate) fn add_stage(&self, added: StageStats) {
        let mut stages = self.stages();
        match stages.iter_mut().find(|stage| stage.stage == added.stage) {
            Some(stage) => stage.add(&added),
            None => stages.push(added),
        }
    }

    /// Returns the stages that have ended.
    pub(crate) fn stages(&self) -> MutexGuard<'_, Vec<StageStats>> {
        self.stages.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Removes the points. At `all_leaves` the journal has all leaves: from there on the store is enough.
    pub(crate) fn remove_points(&self, all_leaves: JournalPosition) -> Result<()> {
        self.journal.commit_to(all_leaves)?;
        if self.journal.is_worth_syncing() {
            self.store.sync()?;
        }
        self.directory.remove_points()
    }
}
