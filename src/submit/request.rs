//! What is sent to an engine: the tasks that are missing, and what they need of a machine.

use job::options::JobOptions;
use job::phase::PhaseTasks;
use std::path::{Path, PathBuf};
use sys::{Error, Result};

/// The tasks of a job that an engine has to start.
#[derive(Clone, Debug)]
pub struct Request {
    /// The configuration of the job, with its whole path.
    pub config: PathBuf,
    /// This program.
    pub program: PathBuf,
    /// How many tasks a phase is dealt out to.
    pub tasks: u32,
    /// The number of this submission, if it starts the job over.
    pub submission: Option<u64>,
    /// The phases that have tasks to do, in their order.
    pub phases: Vec<PhaseTasks>,
    /// The memory that a task may take, in bytes.
    pub memory: u64,
    /// The threads that the configuration asks for; 0: as many as there are.
    pub threads: usize,
}

impl Request {
    /// Returns the request for the tasks that are missing of the job that the configuration at `config` describes: those in `phases`,
    /// which are dealt out to `tasks` tasks.
    ///
    /// # Errors
    /// [`Error::Io`] if the system does not tell where the configuration or this program is.
    pub fn new(
        config: &Path,
        options: &JobOptions,
        tasks: u32,
        submission: Option<u64>,
        mut phases: Vec<PhaseTasks>,
    ) -> Result<Request> {
        phases.retain(|phase| !phase.missing.is_empty());
        Ok(Request {
            config: std::path::absolute(config).map_err(Error::io("find", config))?,
            program: std::env::current_exe().map_err(Error::io("find", "this program"))?,
            tasks,
            submission,
            phases,
            memory: options.limits.memory.0,
            threads: options.limits.threads.0,
        })
    }

    /// Returns the name of the job: that of its configuration, with nothing but letters, digits and hyphens, as engines like it, and no
    /// longer than `longest`. Jobs may have the same name.
    pub fn name(&self, longest: usize) -> String {
        let stem = self.config.file_stem().unwrap_or_default().to_string_lossy().to_lowercase();
        let plain = |c: char| if c.is_ascii_lowercase() || c.is_ascii_digit() { c } else { '-' };
        let name: String = stem.chars().map(plain).take(longest).collect();
        let name = name.trim_matches('-');
        if name.is_empty() { "gdt-batch".into() } else { name.into() }
    }

    /// Returns what tells a task that this submission starts the job over: words after the command.
    pub fn submission_words(&self) -> Vec<String> {
        self.submission.map_or(Vec::new(), |number| vec!["--submission".into(), number.to_string()])
    }

    /// Returns the memory to ask for, for each task.
    pub fn mebibytes(&self) -> u64 {
        (self.memory + SPARE_MEMORY).div_ceil(1 << 20)
    }

    /// Returns the folder of what an engine keeps beside the configuration. It is not in the job's own folder, because that goes when
    /// the job ends, also when it fails: then the logs say why.
    pub fn folder(&self, engine: &str) -> PathBuf {
        self.config.with_extension(engine)
    }
}

/// What a task takes besides the memory that the configuration allows: a shell, and files that the system has just read ahead.
const SPARE_MEMORY: u64 = 256 << 20;

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Returns the request for all of `tasks` tasks of each phase.
    pub(crate) fn request(config: &str, tasks: u32) -> Request {
        Request {
            config: config.into(),
            program: "/opt/gdt-batch".into(),
            tasks,
            submission: None,
            phases: PhaseTasks::all(tasks, true),
            memory: 4 << 30,
            threads: 0,
        }
    }

    #[test]
    fn a_name_is_one_that_engines_take() {
        let name = |config: &str| request(config, 1).name(40);
        assert_eq!(name("/data/job.toml"), "job");
        assert_eq!(name("/data/Böhmen 2024_v2.toml"), "b-hmen-2024-v2");
        assert_eq!(name("/data/---.toml"), "gdt-batch");
        assert_eq!(name(&format!("/data/{}.toml", "x".repeat(90))).len(), 40);
    }
}
