//! Sending a job to an engine, which starts its tasks on many machines: `gdt-batch submit`.
//!
//! An engine gets every phase as an array of tasks (`gdt-batch work`), without a plan: a task to which no part falls ends at once. If the
//! job is under way, it gets only the tasks that are missing.

mod kubernetes;
pub mod request;
mod shell;
mod slurm;
mod slurm_script;
pub mod submitted;

use crate::Result;
use crate::submit::request::Request;
use crate::submit::submitted::Submitted;
use clap::ValueEnum;

/// What starts the tasks of a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Engine {
    /// Slurm: an array job for each phase.
    Slurm,
    /// Kubernetes: an Indexed Job for each phase.
    Kubernetes,
}

impl Engine {
    /// Returns its name on the command line.
    fn name(self) -> &'static str {
        match self {
            Engine::Slurm => slurm_script::ENGINE,
            Engine::Kubernetes => kubernetes::ENGINE,
        }
    }

    /// Sends the tasks of `request`, with the options for the engine that the user has `added`.
    ///
    /// # Errors
    /// [`crate::Error::Config`] if the engine is not here or an option is wrong, [`crate::Error::Engine`] if it refuses.
    pub fn send(self, request: &Request, added: &[String]) -> Result<Submitted> {
        if request.phases.is_empty() {
            return Ok(Submitted { engine: self.name(), jobs: Vec::new(), watch: None, logs: None });
        }
        match self {
            Engine::Slurm => slurm::send(request, added),
            Engine::Kubernetes => kubernetes::send(request, added),
        }
    }

    /// Returns what [`Engine::send`] would give to the engine: for Slurm a script of the shell, for Kubernetes YAML.
    ///
    /// # Errors
    /// [`crate::Error::Config`] if an option is wrong.
    pub fn show(self, request: &Request, added: &[String]) -> Result<String> {
        match self {
            Engine::Slurm => slurm::show(request, added),
            Engine::Kubernetes => kubernetes::show(request, added),
        }
    }
}
