//! What is in the way of a job in its output directory.

use crate::durable::atomic_file::partial_path;
use crate::durable::directory::JobDirectory;
use crate::durable::journal::names_of_files;
use crate::durable::known_results::KnownResults;
use crate::durable::listing::{Leftovers, check_page_is_ours, exists, is_folder, is_partial, read_if_there};
use crate::durable::lock::lock_file;
use serde_json::Value;
use std::path::{Path, PathBuf};
use sys::{Error, Result, disk};

/// Checks that no file, and no dangling link, is where a job needs a folder, that no folder, pipe or device is where it reads or
/// writes a file (opening a pipe would wait for another process), and that all folders are on one disk.
///
/// # Errors
/// [`Error::Config`] names what is in the way.
pub fn check_nothing_in_the_way(directory: &JobDirectory) -> Result<()> {
    let (job, results, waiting) = (directory.job(), directory.results(), directory.output());
    let output = results.directory();
    let parts = if is_folder(&directory.parts())? { directory.folders_of_parts()? } else { Vec::new() };
    let mut own = vec![job.to_path_buf(), directory.parts(), directory.points_by_part()];
    own.extend(results.numbered_folders().into_iter().map(|(folder, _)| folder));
    let [results, waiting] = [Leftovers::of(results)?, Leftovers::of(waiting)?];
    own.extend([results.no_folders, waiting.no_folders, results.folders].concat());
    let of_parts = parts.iter().flat_map(own_files);
    let files = own_files(directory).into_iter().chain(of_parts).chain(results.files).chain(waiting.files);
    let folders = output.ancestors().chain(own.iter().map(PathBuf::as_path));
    let is_in_the_way = |path: &Path| Ok(is_there(path)? && !is_folder(path)?);
    let (found, what, wanted) = if let Some(found) = find(folders, is_in_the_way)? {
        let what = if exists(found)? { "is not a directory" } else { "is a broken link" };
        (found.to_path_buf(), what, "a directory")
    } else if let Some(found) = find(files, is_no_file)? {
        let what = if is_folder(&found)? { "is a directory" } else { "is a pipe or a device" };
        (found, what, "a file")
    } else if let Some(found) = own.into_iter().find(|path| is_elsewhere(path, output)) {
        // Results could not take their places at once.
        (found, "is on another disk than the output directory", "a directory of the same disk")
    } else {
        return Ok(());
    };
    Err(Error::Config(format!(
        "{} {what}, and the job needs {wanted} there: move it away, or choose another [output] directory",
        found.display()
    )))
}

/// Checks that jobs wrote the files that this job would remove or overwrite. `page` tells whether it writes a page.
///
/// # Errors
/// [`Error::Config`] if such a file exists and nothing says that a job wrote it.
pub fn check_results_are_ours(directory: &JobDirectory, page: bool) -> Result<()> {
    let results = directory.results();
    if page {
        check_page_is_ours(results)?;
    }
    let is_finished = has_own_report(&results.report())?;
    // Only a job that had passed this check took the lock and left it.
    let known = match is_finished || exists(&lock_file(directory.job()))? {
        true => KnownResults::of(&[results, directory.output()])?,
        false => KnownResults::default(),
    };
    let Some(found) = first_unknown(directory, &known)? else { return Ok(()) };
    let (why, what) = match is_finished && !known.has_list {
        true => (
            format!(" ({} is missing or damaged, which would list it)", results.checksums().display()),
            format!("everything in {}", results.directory().display()),
        ),
        false => (String::new(), "it".to_string()),
    };
    Err(Error::Config(format!(
        "{} would be overwritten or removed, but is not known to be a result of an earlier job{why}: choose another [output] \
         directory, or move {what} away",
        found.display()
    )))
}

/// Tells whether the report at `path` is that of a job.
fn has_own_report(path: &Path) -> Result<bool> {
    let report = read_if_there(path)?.and_then(|text| serde_json::from_slice::<Value>(&text).ok());
    Ok(report.is_some_and(|report| report["generator"].as_str().is_some_and(|by| by.starts_with("gdt-batch"))))
}

/// Returns the first file with the name of a result that is none of those `known`, nor of a job under way.
fn first_unknown(directory: &JobDirectory, known: &KnownResults) -> Result<Option<PathBuf>> {
    // What has the name of an input may be anyone's. It stays, unless a job wrote it.
    let (named, _) = directory.results().classified();
    let is_unknown =
        |path: &PathBuf| !is_partial(path) && !path.starts_with(&named) && !known.contains(&directory.name(path));
    let mut unknown = Vec::new();
    for path in Leftovers::of(directory.results())?.files.into_iter().filter(is_unknown) {
        if is_there(&path)? {
            unknown.push(path);
        }
    }
    if !unknown.is_empty() {
        let placed = names_of_files(directory)?;
        unknown.retain(|path| !placed.contains(&directory.name(path)));
    }
    Ok(unknown.into_iter().next())
}

/// Returns the paths of the files that the job keeps for itself, under their names or their partial names.
fn own_files(directory: &JobDirectory) -> Vec<PathBuf> {
    let mut files = vec![directory.journal(), directory.plan(), lock_file(directory.job())];
    files.extend(directory.store());
    let partials: Vec<PathBuf> = files.iter().map(|path| partial_path(path)).collect();
    files.extend(partials);
    files
}

/// Tells whether something other than a regular file, or a link to one, is at `path`.
fn is_no_file(path: &Path) -> Result<bool> {
    let data = disk::metadata(path).map_err(Error::io("read", path))?;
    Ok(data.is_some_and(|data| !data.is_file()))
}

/// Tells whether something is at `path`, if only a link that leads nowhere.
fn is_there(path: &Path) -> Result<bool> {
    disk::link_metadata(path).map(|data| data.is_some()).map_err(Error::io("read", path))
}

/// Returns the first of `paths` for which `holds`, if that can be told of all before it.
fn find<P: AsRef<Path>>(
    paths: impl IntoIterator<Item = P>,
    holds: impl Fn(&Path) -> Result<bool>,
) -> Result<Option<P>> {
    paths.into_iter().map(|path| Ok(holds(path.as_ref())?.then_some(path))).find_map(Result::transpose).transpose()
}

/// Tells whether both folders exist, and on different disks.
#[cfg(unix)]
fn is_elsewhere(folder: &Path, other: &Path) -> bool {
    let disk = |path: &Path| path.metadata().ok().map(|data| std::os::unix::fs::MetadataExt::dev(&data));
    disk(folder).zip(disk(other)).is_some_and(|(a, b)| a != b)
}

#[cfg(not(unix))]
fn is_elsewhere(_: &Path, _: &Path) -> bool {
    false
}
