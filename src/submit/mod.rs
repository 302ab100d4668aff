//! Sending a job to an engine, which starts its tasks: `gdt-batch submit`.
//!
//! An engine gets every phase as an array of tasks (`gdt-batch work`), without a plan: a task to which no part falls ends at once. If the
//! job is under way, it gets only the tasks that are missing.

pub mod local;
pub mod request;

use clap::ValueEnum;

/// What starts the tasks of a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Engine {
    /// Processes on this machine, phase after phase.
    Local,
}
