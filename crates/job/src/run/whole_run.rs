//! A run that does all of a job, or ends what tasks have done: what the phases for the whole job share.

use crate::durable::atomic_file::PendingFile;
use crate::plan::fingerprint::JobIdentity;
use crate::progress::stage::Stage;
use crate::progress::stats::StageStats;
use crate::records::{JobStep, Journal};
use crate::run::job::Process;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::cell::RefCell;
use std::time::SystemTime;
use sys::Result;

/// A run whose directory is locked, with the journal of the job.
pub(crate) struct WholeRun<'a> {
    pub(crate) process: Process<'a>,
    pub(crate) journal: &'a Journal,
    /// When tasks began what this run ends.
    pub(crate) begun: Option<SystemTime>,
    /// What tells the job from others.
    pub(crate) identity: JobIdentity,
    /// The number of phases that an interrupted run had completed.
    pub(crate) resumed: u64,
    /// The stages that have ended.
    pub(crate) stages: RefCell<Vec<StageStats>>,
}

impl WholeRun<'_> {
    /// Returns the seconds since the job began. Machines may have clocks that differ, so it is no less than what this process took.
    pub(crate) fn wall_s(&self) -> f64 {
        let since = self.begun.and_then(|begun| begun.elapsed().ok()).map_or(0.0, |since| since.as_secs_f64());
        since.max(self.process.clock.wall_s())
    }

    /// Returns the figures of `step`, which `work` does unless that is done. It is a stage with this name, of so many units.
    ///
    /// # Errors
    /// Those of `work`, and of [`Journal::step`].
    pub(crate) fn write<T: Serialize + DeserializeOwned>(
        &self,
        step: JobStep,
        (name, total, unit): (&'static str, u64, &'static str),
        work: impl FnOnce(&Stage) -> Result<(T, Vec<PendingFile>)>,
    ) -> Result<T> {
        let stage = self.process.progress.stage(name, total, unit);
        let figures = self.journal.step(step, || work(&stage))?;
        self.add_stage(stage.finish());
        Ok(figures)
    }

    /// Adds a stage to the report, or to the stage of the same name: parts have the same stages.
    pub(crate) fn add_stage(&self, added: StageStats) {
        let mut stages = self.stages.borrow_mut();
        match stages.iter_mut().find(|stage| stage.stage == added.stage) {
            Some(stage) => stage.add(&added),
            None => stages.push(added),
        }
    }
}
