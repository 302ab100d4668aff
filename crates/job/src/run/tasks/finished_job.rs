//! What tasks find of a job that is finished.

use crate::durable::directory::JobDirectory;
use crate::options::JobOptions;
use crate::run::finished::{InPlace, results_in_place};
use crate::run::tasks::planned_job::planned;
use sys::Result;

/// As [`results_in_place`], where tasks may be doing the job again.
///
/// # Errors
/// As [`results_in_place`].
pub(crate) fn in_place(directory: &JobDirectory, options: &JobOptions, submission: u64) -> Result<InPlace> {
    results_in_place(directory, options, submission, || match planned(directory, 0)? {
        Some((header, false)) => Ok(header.fingerprint.changed_options(options)?.is_none()),
        _ => Ok(false),
    })
}
