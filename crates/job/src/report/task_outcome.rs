//! What became of a task.

use crate::phase::{Phase, Task};
use crate::report::job_report::Report;
use serde::Serialize;
use std::fmt;

/// What became of a task.
#[derive(Debug)]
pub enum TaskOutcome {
    /// It is done.
    Done(DoneTask),
    /// It published the job.
    Published(Box<Report>),
}

/// A task that is done.
#[derive(Debug, Serialize)]
pub struct DoneTask {
    /// The phase.
    pub phase: Phase,
    /// The number of the task.
    pub task: u32,
    /// How many tasks the phase is dealt out to.
    pub tasks: u32,
    /// How many parts fell to it.
    pub parts: u64,
    /// Seconds that it took.
    pub seconds: f64,
    /// What else there is to say.
    pub note: Option<String>,
}

impl DoneTask {
    /// Returns the outcome of a task to which no part fell.
    pub fn new(phase: Phase, task: Task) -> DoneTask {
        DoneTask { phase, task: task.number, tasks: task.count, parts: 0, seconds: 0.0, note: None }
    }
}

impl fmt::Display for DoneTask {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let DoneTask { phase, task, tasks, parts, seconds, note } = self;
        write!(f, "{phase} {task}/{tasks}: ")?;
        match note {
            Some(note) => f.write_str(note),
            None if phase.is_by_part() => write!(f, "done, {parts} parts in {seconds:.1} s"),
            None => write!(f, "done in {seconds:.1} s"),
        }
    }
}
