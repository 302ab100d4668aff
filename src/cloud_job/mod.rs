//! A job of point clouds that the command line names, without a configuration: `gdt-batch cloud.laz`.
//!
//! The job is that of the configuration that `--write-config` writes for the same words and flags: both come from one draft of `init`.

mod flags;
mod options;
mod output_name;

use crate::cloud_job::flags::{Flag, lines};
use crate::cloud_job::output_name::output_name;
use crate::init::{ConfigRequest, Draft, NeededLine, NewConfiguration, init, runnable, with_more};
use job::options::{JobOptions, RunOptions};
use job::plan::clip::CLIP;
use job::report::job_report::Report;
use job::{Error, Result};
use std::path::{Path, PathBuf};
use sys::threads::{available, on_threads};

pub(crate) use crate::cloud_job::flags::option_of_flag;
pub use crate::cloud_job::flags::{in_flags, refuse_beside_command, refuse_beside_configuration};
pub use crate::cloud_job::options::CloudOptions;

/// Point clouds, and what the command line says of their job.
pub struct CloudJob {
    request: ConfigRequest,
    /// The output directory as messages name it.
    directory: PathBuf,
}

impl CloudJob {
    /// Returns the job of the point clouds that `clouds` name.
    ///
    /// # Errors
    /// [`sys::Error::Config`] names the flag whose value is wrong.
    pub fn new(clouds: &[PathBuf], options: &CloudOptions) -> sys::Result<CloudJob> {
        let lines = lines(options)?;
        let directory = options.output.clone().unwrap_or_else(|| output_name(clouds).into());
        let request = ConfigRequest {
            clouds: clouds.to_vec(),
            lines,
            directory: Some(directory.clone()),
            clip: options.clip.clone(),
            stops_at_bad_files: true,
        };
        Ok(CloudJob { request, directory })
    }

    /// Writes the configuration of the job to `file`, and runs nothing.
    ///
    /// # Errors
    /// Those of [`init()`].
    pub fn write_configuration(&self, file: &Path, replace: bool) -> Result<NewConfiguration> {
        init(&self.request, file, replace).map_err(|error| self.with_flags(error))
    }

    /// Runs the job. `tell` gets sentences for the user on the way. Returns the report and the options that the job had.
    ///
    /// # Errors
    /// Those of [`job::run()`], and [`sys::Error::Config`] if the words name no point clouds.
    pub fn run(&self, run: RunOptions, tell: impl Fn(&str)) -> Result<(Report, JobOptions)> {
        let (draft, notes) = self.request.draft(None)?;
        tell(&format!("the terrain goes to {}", self.directory.display()));
        notes.iter().for_each(|note| tell(&format!("note: {note}")));
        // First as it is: the job also knows what an interrupted run has left.
        let options = draft.options()?;
        let refusal = match job::run(&options, run) {
            Err(error) if may_be_cured(&error) => error,
            outcome => return outcome.map(|report| (report, options)).map_err(|error| self.with_flags(error)),
        };
        let Some(cured) = cured(draft) else { return Err(self.with_flags(refusal)) };
        cured.needed.iter().for_each(|line| tell(&sentence(line)));
        let options = cured.options()?;
        let report = job::run(&options, run).map_err(|error| self.with_flags(error))?;
        Ok((report, options))
    }

    /// Returns the error with the flags for the options that its message names, and for leaving a bad file out of several.
    fn with_flags(&self, error: Error) -> Error {
        let message = error.to_string();
        let named = Flag::all().filter(|flag| message.contains(&flag.option()));
        let mut told: Vec<String> = named.map(|flag| format!("{} sets {}", flag.name(), flag.option())).collect();
        let is_bad_file = matches!(error, Error::System(sys::Error::Input { .. }));
        let is_one_file = matches!(&self.request.clouds[..], [one] if one.is_file());
        if told.is_empty() && is_bad_file && !is_one_file {
            told.push("--on-bad-file skip leaves bad files out".into());
        }
        match told.is_empty() {
            true => error,
            false => with_more(error, &format!(" ({})", told.join(", "))),
        }
    }
}

/// Tells whether lines of a configuration may let the job run that stopped with this error, and keep all points.
fn may_be_cured(error: &Error) -> bool {
    let is_full = |error: &std::io::Error| error.kind() == std::io::ErrorKind::StorageFull;
    match error {
        Error::System(sys::Error::Io { source, .. }) => is_full(source),
        // Whatever is wrong with the file of a clip, the points stay in their own CRS.
        Error::System(sys::Error::Config(what)) => !what.starts_with(CLIP),
        Error::System(sys::Error::Memory(_)) => true,
        _ => false,
    }
}

/// Returns the draft with the lines that `init` would add; `None` if it adds none that keeps all points.
fn cured(draft: Draft) -> Option<Draft> {
    let found = on_threads(available(), || runnable(draft)).ok()?;
    let cured = found.draft.undecided();
    (!cured.needed.is_empty()).then_some(cured)
}

fn sentence(line: &NeededLine) -> String {
    format!("[{}] {} = {}: {}", line.table, line.key, line.value, line.why)
}
