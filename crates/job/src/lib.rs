//! A job, from the options to the report. `run/phases` walks through its phases, part by part; each step has a module of its own.
//!
//! A step that runs once for each tile or node takes the plan, the results of the steps for the whole job (the tree, the style), the
//! index and the store, but never the running job. It finds in the store what earlier steps wrote, and writes its own result there.
//! So steps can run in any order that puts children before parents. An interrupted job goes on from the phases that its journals
//! have.

#![warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable)]

pub mod durable;
mod error;
pub mod index;
pub(crate) mod levels;
pub(crate) mod machine;
pub mod merge_records;
pub mod mesh;
pub mod options;
pub mod partition;
pub mod phase;
pub mod plan;
pub mod preflight;
pub mod progress;
pub(crate) mod publish;
pub mod records;
pub mod report;
pub mod run;
pub(crate) mod tiles;

pub use crate::error::{Error, Result};

use crate::options::{JobOptions, RunOptions};
use crate::phase::{Phase, PhaseTasks, Task};
use crate::report::job_report::Report;
use crate::report::job_status::JobStatus;
use crate::report::task_outcome::TaskOutcome;
use crate::run::attempt::run_until_it_fits;
use crate::run::tasks;
use std::time::SystemTime;

/// Runs the whole job, or what an interrupted run left of it.
///
/// # Errors
/// Every error of every step; see [`Error`]. Whatever fails, the results of an earlier job stay as they are. With
/// [`Error::Resumable`] the complete phases are kept. With any other error of a step no temporary files are left; an error before the
/// first step leaves the directory as it was.
pub fn run(options: &JobOptions, run: impl Into<RunOptions>) -> Result<Report> {
    // The plan, what is around every attempt (the directory, its lock, the journal), and the walk through the phases.
    let run = run.into();
    match run.update {
        true => run_until_it_fits(&options.clone().with_updates(), run, false),
        false => run_until_it_fits(options, run, false),
    }
}

/// Does one task of one phase of the job.
///
/// # Errors
/// [`Error::TooEarly`] if an earlier phase is not complete, [`Error::InUse`] if another process has one of the task's parts, and the
/// errors of the steps. What is done is kept in any case.
pub fn work(options: &JobOptions, run: impl Into<RunOptions>, phase: Phase, task: Task) -> Result<TaskOutcome> {
    tasks::work(options, run.into(), phase, task)
}

/// Returns all phases of the job with the tasks that are missing, where phases are dealt out to `tasks` tasks: all of them if there is no
/// plan of this job, and none if its results are in place.
///
/// # Errors
/// [`sys::Error::Config`] if there are no inputs, [`sys::Error::Io`] if one of them, or a journal, cannot be read.
pub fn missing_tasks(options: &JobOptions, tasks: u32) -> sys::Result<Vec<PhaseTasks>> {
    tasks::missing::missing_tasks(options, tasks)
}

/// As [`missing_tasks`], of a job that has just been planned: its phase `plan` is not missing.
///
/// # Errors
/// [`sys::Error::Io`] or [`sys::Error::Broken`] on the job directory.
pub fn missing_tasks_of_planned(options: &JobOptions, tasks: u32) -> sys::Result<Vec<PhaseTasks>> {
    tasks::missing::missing_tasks_of_planned(options, tasks)
}

/// Returns a number for a submission that starts the job over. It is greater than those of earlier submissions, as far as clocks agree.
pub fn new_submission() -> u64 {
    let time = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    time.map_or(1, |time| time.as_millis() as u64)
}

/// Returns how far the job is. If `tasks` is given, also which tasks are missing, where phases are dealt out to so many.
///
/// # Errors
/// [`sys::Error::Io`] or [`sys::Error::Broken`] on the job directory.
pub fn status(options: &JobOptions, tasks: Option<u32>) -> sys::Result<JobStatus> {
    tasks::status::status(options, tasks)
}
