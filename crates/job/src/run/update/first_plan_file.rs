//! The plan of the first run of a job with `--update`, which decides how its plane is cut.

use crate::durable::atomic_file::publish;
use crate::durable::directory::JobDirectory;
use crate::plan::job_plan::Plan;
use sys::disk::exists;
use sys::{Error, Result};

/// Returns the plan of the first run, if it is there.
pub(crate) fn first_plan(directory: &JobDirectory) -> Option<Plan> {
    Plan::read(&directory.first_plan()).ok()
}

/// Tells whether the plan of the first run is there.
///
/// # Errors
/// [`Error::Io`] if the disk does not tell.
pub(crate) fn has_first_plan(directory: &JobDirectory) -> Result<bool> {
    let path = directory.first_plan();
    exists(&path).map_err(Error::io("read", &path))
}

/// Keeps the plan of a job with `--update`, unless that of an earlier run is there.
///
/// # Errors
/// [`Error::Io`] if it cannot be written.
pub(crate) fn keep_first_plan(directory: &JobDirectory, plan: &Plan) -> Result<()> {
    let path = directory.first_plan();
    if !plan.options.updates || has_first_plan(directory)? {
        return Ok(());
    }
    plan.write(&path)?;
    publish(std::slice::from_ref(&path))
}
