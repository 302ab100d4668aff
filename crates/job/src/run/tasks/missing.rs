//! Which parts and tasks of a job are missing.

use crate::durable::directory::JobDirectory;
use crate::index::PartIndex;
use crate::options::JobOptions;
use crate::phase::{Phase, PhaseTasks};
use crate::plan::budget::workers;
use crate::plan::fingerprint::Fingerprint;
use crate::records::JobStep;
use crate::run::finished::{InPlace, is_rest, results_in_place};
use crate::run::phases::part_progress::PartProgress;
use crate::run::planned_job::{PlannedJob, planned};
use crate::run::single_process;
use crate::run::tasks::dealing::deal;
use std::collections::BTreeSet;
use sys::Result;
use sys::threads::on_threads;

/// What is done of a planned job.
pub(crate) struct JobProgressByPart<'a> {
    pub(crate) job: &'a PlannedJob,
    pub(crate) parts: Vec<PartProgress>,
    is_joined: bool,
}

impl<'a> JobProgressByPart<'a> {
    /// Reads the journals of all parts.
    ///
    /// # Errors
    /// [`sys::Error::Io`] or [`sys::Error::Broken`] on a journal.
    pub(crate) fn of(job: &'a PlannedJob) -> Result<JobProgressByPart<'a>> {
        JobProgressByPart::of_parts(job, |_| true)
    }

    /// Reads the journals of the `wanted` parts. Nothing of the others counts as done.
    ///
    /// # Errors
    /// [`sys::Error::Io`] or [`sys::Error::Broken`] on a journal.
    pub(crate) fn of_parts(job: &'a PlannedJob, wanted: impl Fn(PartIndex) -> bool) -> Result<JobProgressByPart<'a>> {
        let part = |part| match wanted(part) {
            true => PartProgress::of(&job.entries(part)?),
            false => Ok(PartProgress::default()),
        };
        let parts = job.parts.all().map(part).collect::<Result<_>>()?;
        let is_joined = job.entries(job.parts.tree.part)?.has(JobStep::Join);
        Ok(JobProgressByPart { job, parts, is_joined })
    }

    /// Tells whether `phase`, which has one task, is done.
    pub(crate) fn is_done(&self, phase: Phase) -> bool {
        match phase {
            Phase::Plan => true,
            Phase::Select => self.parts.iter().all(|part| part.selected.is_some()),
            Phase::Join => self.is_joined,
            _ => false,
        }
    }

    /// Returns how many parts `phase` has.
    pub(crate) fn parts_of(&self, phase: Phase) -> u64 {
        deal(&self.job.plan, &self.job.parts, phase, 1).len() as u64
    }

    /// Returns the parts of `phase` that are missing, each with the number of the task that it falls to, of `tasks`.
    pub(crate) fn missing(&self, phase: Phase, tasks: u32) -> Vec<(PartIndex, u32)> {
        let mut dealt = deal(&self.job.plan, &self.job.parts, phase, tasks);
        dealt.retain(|(part, _)| !self.parts[part.get()].has(phase));
        dealt
    }

    /// Returns the tasks of `phase` that are missing, of `tasks`.
    pub(crate) fn missing_tasks(&self, phase: Phase, tasks: u32) -> Vec<u32> {
        match phase.is_by_part() {
            true => numbers(&self.missing(phase, tasks)),
            false if self.is_done(phase) => Vec::new(),
            false => vec![1],
        }
    }

    /// Checks that `phase` is complete, as far as it is about the `wanted` parts.
    ///
    /// # Errors
    /// [`crate::Error::TooEarly`] names the tasks that are missing.
    pub(crate) fn require(&self, phase: Phase, tasks: u32, wanted: impl Fn(PartIndex) -> bool) -> crate::Result<()> {
        let mut missing = self.missing(phase, tasks);
        missing.retain(|(part, _)| wanted(*part));
        let numbers = if phase.is_by_part() { numbers(&missing) } else { self.missing_tasks(phase, tasks) };
        if numbers.is_empty() { Ok(()) } else { Err(too_early(phase, &numbers, phase.tasks(tasks))) }
    }
}

fn numbers(missing: &[(PartIndex, u32)]) -> Vec<u32> {
    missing.iter().map(|(_, task)| *task).collect::<BTreeSet<u32>>().into_iter().collect()
}

/// Returns the error of a task that came before `phase` was complete: its `missing` tasks, of `count`.
pub(crate) fn too_early(phase: Phase, missing: &[u32], count: u32) -> crate::Error {
    let numbers: Vec<String> = missing.iter().map(u32::to_string).collect();
    let tasks = match missing.len() {
        1 => format!("task {} of {count} is", numbers[0]),
        _ => format!("tasks {} of {count} are", numbers.join(", ")),
    };
    crate::Error::TooEarly(format!(
        "the phase {phase} is not complete: {tasks} missing. Run them first; gdt-batch submit sends the tasks that are missing"
    ))
}

/// Returns the error of a task of a job that is not planned.
pub(crate) fn not_planned() -> crate::Error {
    too_early(Phase::Plan, &[1], 1)
}

/// Returns all phases of a job with the tasks that are missing; of a finished job only `publish`, if it has something to remove.
///
/// # Errors
/// [`sys::Error::Config`] if there are no inputs, [`sys::Error::Io`] if one of them, or a journal, cannot be read.
pub(crate) fn missing_tasks(options: &JobOptions, tasks: u32) -> Result<Vec<PhaseTasks>> {
    let directory = JobDirectory::new(&options.output.directory);
    if let InPlace::ThisJob(_) = results_in_place(&directory, options, 0)? {
        let has_rest = is_rest(&directory)?;
        return Ok(of_each(options, tasks, |phase| publish_alone(phase, has_rest)));
    }
    let fingerprint = on_threads(workers(options, 0)?, || Fingerprint::of(options))?;
    let known = planned(&directory, 0)?;
    let is_same = known.is_some_and(|(header, _)| fingerprint.is_same_job(&header));
    // One process may have begun a small job, which has no tasks.
    if is_same && PlannedJob::open(&directory, options, 0)?.is_some() {
        missing_tasks_of_planned(options, tasks)
    } else {
        Ok(PhaseTasks::all(tasks, options.leaves_points_out()))
    }
}

/// Returns all phases of a job that is planned with the tasks that are missing.
///
/// # Errors
/// [`sys::Error::Io`] or [`sys::Error::Broken`] on the job directory.
pub(crate) fn missing_tasks_of_planned(options: &JobOptions, tasks: u32) -> Result<Vec<PhaseTasks>> {
    let directory = JobDirectory::new(&options.output.directory);
    let is_left_to_one = single_process::is_noted(&directory, 0)?;
    let planned = if is_left_to_one { None } else { PlannedJob::open(&directory, options, 0)? };
    match planned.filter(|job| !job.is_complete) {
        Some(job) => {
            let progress = JobProgressByPart::of(&job)?;
            Ok(of_each(options, tasks, |phase| progress.missing_tasks(phase, tasks)))
        }
        None => Ok(of_each(options, tasks, |phase| publish_alone(phase, true))),
    }
}

fn publish_alone(phase: Phase, is_missing: bool) -> Vec<u32> {
    if phase == Phase::Publish && is_missing { vec![1] } else { Vec::new() }
}

fn of_each(options: &JobOptions, tasks: u32, missing: impl Fn(Phase) -> Vec<u32>) -> Vec<PhaseTasks> {
    let of_phase = |phase: Phase| PhaseTasks { phase, count: phase.tasks(tasks), missing: missing(phase) };
    Phase::of_job(options.leaves_points_out()).map(of_phase).collect()
}
