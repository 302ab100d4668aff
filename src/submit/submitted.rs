//! What was sent to an engine.

use crate::submit::slurm_script::ranges;
use job::phase::Phase;
use serde::Serialize;
use std::fmt;
use std::path::PathBuf;

/// What was sent.
#[derive(Debug, Serialize)]
pub struct Submitted {
    /// The name of the engine.
    pub engine: &'static str,
    /// The tasks, as the engine knows them.
    pub jobs: Vec<SentTasks>,
    /// A command that shows how they fare.
    pub watch: String,
    /// Where the tasks' logs are, if they are files.
    #[serde(serialize_with = "sys::path_text::shown_if_any")]
    pub logs: Option<PathBuf>,
}

/// Tasks of a phase that have one number or name in the engine.
#[derive(Debug, Serialize)]
pub struct SentTasks {
    /// The phase.
    pub phase: Phase,
    /// The number or name.
    pub job: String,
    /// The numbers of the tasks.
    pub tasks: Vec<u32>,
}

impl fmt::Display for Submitted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for SentTasks { phase, job, tasks } in &self.jobs {
            let word = if tasks.len() == 1 { "task" } else { "tasks" };
            writeln!(f, "{phase}: {word} {} in job {job}", ranges(tasks))?;
        }
        if let Some(logs) = &self.logs {
            writeln!(f, "logs: {}", logs.display())?;
        }
        write!(f, "watch: {}", self.watch)
    }
}
