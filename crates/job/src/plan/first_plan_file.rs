//! The plan of the first run of a job with `--update`, which decides how its plane is cut.

use crate::durable::atomic_file::{publish, write_pending};
use crate::durable::directory::JobDirectory;
use crate::durable::listing::exists;
use crate::plan::job_plan::Plan;
use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;
use sys::{Error, Result};
use tiles::checksums::Checksum;

/// The plan of the first run in its file. No journal has its checksum.
#[derive(Serialize, Deserialize)]
struct FirstPlan {
    /// The checksum of the plan's text.
    checksum: Checksum,
    plan: Box<RawValue>,
}

/// Returns the plan of the first run, if it is there and whole.
pub(crate) fn first_plan(directory: &JobDirectory) -> Option<Plan> {
    let text = std::fs::read(directory.first_plan()).ok()?;
    let file: FirstPlan = serde_json::from_slice(&text).ok()?;
    let text = file.plan.get();
    if Checksum::of(text.as_bytes()) == file.checksum { Plan::parse(text).ok() } else { None }
}

/// Tells whether the plan of the first run is there.
///
/// # Errors
/// [`Error::Io`] if the disk does not tell.
pub(crate) fn has_first_plan(directory: &JobDirectory) -> Result<bool> {
    exists(&directory.first_plan())
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
    let broken = |e| Error::Broken(format!("{}: {e}", path.display()));
    let plan = serde_json::value::to_raw_value(plan).map_err(broken)?;
    let file = FirstPlan { checksum: Checksum::of(plan.get().as_bytes()), plan };
    write_pending(&path, &serde_json::to_vec(&file).map_err(broken)?)?;
    publish(std::slice::from_ref(&path))
}
