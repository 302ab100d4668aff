//! Sending a job to an engine, which starts its tasks: `gdt-batch submit`.
//!
//! An engine gets every phase as an array of tasks (`gdt-batch work`), without a plan: a task to which no part falls ends at once. If the
//! job is under way, it gets only the tasks that are missing.

pub mod kubernetes;
pub mod local;
pub mod request;
pub mod slurm;
mod slurm_script;
pub mod submitted;

use clap::ValueEnum;

/// What starts the tasks of a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Engine {
    /// Slurm: an array job for each phase.
    Slurm,
    /// Kubernetes: an Indexed Job for each phase.
    Kubernetes,
    /// Processes on this machine, phase after phase.
    Local,
}
