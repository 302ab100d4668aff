//! Which parts and tasks of a job are missing.

use crate::durable::directory::JobDirectory;
use crate::index::PartIndex;
use crate::options::JobOptions;
use crate::phase::{Phase, PhaseTasks};
use crate::plan::budget::workers;
use crate::plan::fingerprint::Fingerprint;
use crate::run::finished::{InPlace, is_rest, results_in_place};
use crate::run::part_entries::PartEntries;
use crate::run::planned_job::{PlannedJob, is_planned};
use crate::run::single_process;
use crate::run::tasks::dealing::deal;
use std::collections::{BTreeMap, BTreeSet};
use sys::Result;
use sys::threads::on_threads;

/// What is done of a planned job.
pub(crate) struct JobProgressByPart<'a> {
    pub(crate) job: &'a PlannedJob,
    /// The parts that are asked about.
    pub(crate) parts: BTreeMap<PartIndex, PartEntries>,
}

impl<'a> JobProgressByPart<'a> {
    /// Reads the journals of all parts.
    ///
    /// # Errors
    /// [`sys::Error::Io`] on a journal.
    pub(crate) fn of(job: &'a PlannedJob) -> Result<JobProgressByPart<'a>> {
        JobProgressByPart::of_parts(job, job.parts.all())
    }

    /// Reads the journals of these parts. Nothing is missing of the others.
    ///
    /// # Errors
    /// [`sys::Error::Io`] on a journal.
    pub(crate) fn of_parts(
        job: &'a PlannedJob,
        parts: impl IntoIterator<Item = PartIndex>,
    ) -> Result<JobProgressByPart<'a>> {
        let parts = parts.into_iter().map(|part| Ok((part, job.entries(part)?))).collect::<Result<_>>()?;
        Ok(JobProgressByPart { job, parts })
    }

    /// Tells whether `phase`, which has one task, is done.
    ///
    /// # Errors
    /// [`sys::Error::Io`] or [`sys::Error::Broken`] on a journal.
    pub(crate) fn is_done(&self, phase: Phase) -> Result<bool> {
        match phase {
            Phase::Plan => Ok(true),
            Phase::Select => Ok(self.missing(phase, 1)?.is_empty()),
            Phase::Join => self.job.entries(self.job.parts.tree.part)?.has_phase(phase),
            _ => Ok(false),
        }
    }

    /// Returns how many parts `phase` has.
    pub(crate) fn parts_of(&self, phase: Phase) -> u64 {
        deal(&self.job.plan, &self.job.parts, phase, 1).len() as u64
    }

    /// Returns the parts of `phase` that are missing, each with the number of the task that it falls to, of `tasks`.
    ///
    /// # Errors
    /// [`sys::Error::Broken`] if a journal is not understood.
    pub(crate) fn missing(&self, phase: Phase, tasks: u32) -> Result<Vec<(PartIndex, u32)>> {
        let mut missing = Vec::new();
        for (part, task) in deal(&self.job.plan, &self.job.parts, phase, tasks) {
            if let Some(entries) = self.parts.get(&part)
                && !entries.has_phase(phase)?
            {
                missing.push((part, task));
            }
        }
        Ok(missing)
    }

    /// Returns the tasks of `phase` that are missing, of `tasks`.
    ///
    /// # Errors
    /// As [`JobProgressByPart::is_done`].
    pub(crate) fn missing_tasks(&self, phase: Phase, tasks: u32) -> Result<Vec<u32>> {
        if phase.is_by_part() {
            let numbers: BTreeSet<u32> = self.missing(phase, tasks)?.into_iter().map(|(_, task)| task).collect();
            return Ok(numbers.into_iter().collect());
        }
        Ok(if self.is_done(phase)? { Vec::new() } else { vec![1] })
    }

    /// Checks that `phase` is complete.
    ///
    /// # Errors
    /// [`crate::Error::TooEarly`] names the tasks that are missing.
    pub(crate) fn require(&self, phase: Phase, tasks: u32) -> crate::Result<()> {
        match self.missing_tasks(phase, tasks)?.as_slice() {
            [] => Ok(()),
            missing => Err(too_early(phase, missing, phase.tasks(tasks))),
        }
    }
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
        return publish_alone(options, tasks, is_rest(&directory)?);
    }
    let fingerprint = on_threads(workers(options, 0)?, || Fingerprint::of(options))?;
    match is_planned(&directory, options, &fingerprint, 0)? {
        true => missing_tasks_of_planned(options, tasks),
        false => Ok(PhaseTasks::all(tasks, options.leaves_points_out())),
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
            of_each(options, tasks, |phase| progress.missing_tasks(phase, tasks))
        }
        None => publish_alone(options, tasks, true),
    }
}

/// Returns all phases, of which none is missing but `publish`, and that only if it `is_missing`.
fn publish_alone(options: &JobOptions, tasks: u32, is_missing: bool) -> Result<Vec<PhaseTasks>> {
    let missing = |phase| if phase == Phase::Publish && is_missing { vec![1] } else { Vec::new() };
    of_each(options, tasks, |phase| Ok(missing(phase)))
}

fn of_each(options: &JobOptions, tasks: u32, missing: impl Fn(Phase) -> Result<Vec<u32>>) -> Result<Vec<PhaseTasks>> {
    let of_phase = |phase: Phase| Ok(PhaseTasks { phase, count: phase.tasks(tasks), missing: missing(phase)? });
    Phase::of_job(options.leaves_points_out()).map(of_phase).collect()
}
