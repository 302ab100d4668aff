//! Whether the inputs of a job lie where its results will be. A job that wrote over its inputs could not be run again.

use crate::durable::directory::JobDirectory;
use crate::plan::input_identity::place;
use crate::plan::job_plan::Plan;
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use sys::{Error, Result};

/// Checks that no file that the job reads is one that it, or an earlier job, writes to the output directory. Inputs may lie there under
/// other names.
///
/// # Errors
/// [`Error::Config`] names the file.
pub(crate) fn check_inputs_are_no_results(plan: &Plan) -> Result<()> {
    let directory = JobDirectory::new(&plan.options.output.directory);
    let results: HashSet<PathBuf> = directory.earlier_results().iter().map(|path| place(path)).collect();
    let job = place(directory.job());
    let is_result = |path: &Path| {
        let place = place(path);
        results.contains(&place) || place.starts_with(&job)
    };
    match inputs(plan).find(|(_, path)| is_result(path)) {
        None => Ok(()),
        Some((option, path)) => Err(Error::Config(format!(
            "{option}: {} has the name of a result, which would overwrite it: rename it, or choose another [output] directory",
            path.display()
        ))),
    }
}

/// Returns the files that the job reads, with the options that name them.
fn inputs(plan: &Plan) -> impl Iterator<Item = (&'static str, &Path)> {
    let clouds = plan.inputs.iter().map(|input| ("[input] files", input.source.path.as_path()));
    let lines = plan.breaklines.iter().flat_map(|lines| &lines.files);
    let geoid = plan.options.output.height_offset.as_ref().and_then(|offset| offset.grid());
    clouds
        .chain(lines.map(|path| ("[[breaklines]] files", path.as_path())))
        .chain(geoid.map(|path| ("[output] height_offset", path)))
        .chain(plan.options.output.color.photo().map(|path| ("[output] color", path)))
}
