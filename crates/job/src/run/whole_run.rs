//! A run that does all of a job, or ends what tasks have done: what the phases for the whole job share.

use crate::durable::directory::JobDirectory;
use crate::partition::parts::Parts;
use crate::plan::fingerprint::JobIdentity;
use crate::plan::job_plan::Plan;
use crate::progress::clock::JobClock;
use crate::progress::stage::JobProgress;
use crate::progress::stats::StageStats;
use crate::records::Journal;
use crate::run::job::Job;
use delaunay_gpu::triangulator::Triangulator;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::SystemTime;

/// A run whose directory is locked, with the journal of the job.
pub(crate) struct WholeRun<'a> {
    pub(crate) triangulator: &'a Triangulator,
    pub(crate) directory: &'a JobDirectory,
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
    /// The number of phases that an interrupted run had completed.
    pub(crate) resumed: u64,
    /// The stages that have ended.
    pub(crate) stages: Mutex<Vec<StageStats>>,
}

impl<'a> WholeRun<'a> {
    /// Returns the job, of which this run does all.
    pub(crate) fn job<'j>(&self, plan: &'j Plan, parts: &'j Parts) -> Job<'j>
    where
        'a: 'j,
    {
        Job {
            plan,
            parts,
            directory: self.directory,
            triangulator: self.triangulator,
            progress: self.progress,
            threads: self.threads,
            clock: self.clock,
            id: self.job_id,
            checks_points: self.resumed > 0 || plan.options.updates,
            is_task: false,
        }
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
}
