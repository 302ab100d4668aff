//! Tasks: a job of several parts done by many processes, on any machines that share the output directory.
//!
//! A task takes the parts that fall to it, and does one phase of each. Nothing passes between tasks but the plan and the folders of
//! parts, each of which has one writer at a time. So a task may be killed, run twice or run elsewhere, and the results have the same
//! bytes, however many tasks there are.

mod dealing;
pub(crate) mod missing;
mod part_tasks;
mod plan_task;
pub(crate) mod status;

use crate::Result;
use crate::durable::directory::JobDirectory;
use crate::options::{JobOptions, RunOptions};
use crate::phase::{Phase, Task};
use crate::progress::clock::JobClock;
use crate::report::job_report::Report;
use crate::report::task_outcome::{DoneTask, TaskOutcome};
use crate::run::attempt::run_until_it_fits;
use crate::run::finished::{InPlace, remove_rest, results_in_place};
use crate::run::planned_job::PlannedJob;
use crate::run::single_process;
use crate::run::tasks::missing::{JobProgressByPart, not_planned};
use crate::run::tasks::part_tasks::work_on_parts;
use crate::run::tasks::plan_task::plan;

/// Does one task of one phase of a job.
///
/// # Errors
/// See [`crate::work`].
pub(crate) fn work(options: &JobOptions, run: RunOptions, phase: Phase, task: Task) -> Result<TaskOutcome> {
    let clock = JobClock::start();
    let mut done = DoneTask::new(phase, task);
    // A phase with one task is done by the first.
    if phase.is_by_part() || task.number == 1 {
        let directory = &JobDirectory::new(&options.output.directory);
        match (phase, results_in_place(directory, options, run.submission)?) {
            (Phase::Publish, InPlace::ThisJob(report)) => {
                remove_rest(directory, options.threads())?;
                return Ok(TaskOutcome::Published(report));
            }
            (_, InPlace::ThisJob(_)) => done.note = Some("nothing to do: all results are in place".into()),
            (Phase::Publish, _) => {
                return publish(directory, options, run, task).map(|report| TaskOutcome::Published(report.into()));
            }
            (Phase::Plan, _) => done.note = plan(options, run)?,
            (_, _) => (done.parts, done.note) = work_on_parts(options, run, phase, task)?,
        }
    }
    done.seconds = clock.wall_s();
    Ok(TaskOutcome::Done(done))
}

/// Publishes a job whose other phases are complete, or does all of a job that tasks have left to one process.
fn publish(directory: &JobDirectory, options: &JobOptions, run: RunOptions, task: Task) -> Result<Report> {
    let is_by_tasks = !single_process::is_noted(directory, run.submission)?;
    if is_by_tasks {
        let job = PlannedJob::open(directory, options, run.submission)?.ok_or_else(not_planned)?;
        if !job.is_complete {
            let progress = JobProgressByPart::of(&job)?;
            let mut before = Phase::of_job(options.leaves_points_out()).filter(|phase| *phase != Phase::Publish);
            before.try_for_each(|phase| progress.require(phase, task.count))?;
        }
    }
    run_until_it_fits(options, run, is_by_tasks)
}
