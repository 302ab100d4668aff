//! A note in the job directory: tasks leave the job to one process, which does all of it when the others would publish. So one bad file
//! ends no job on many machines, and a small job needs no tasks.

use crate::durable::atomic_file::remove_file;
use crate::durable::directory::JobDirectory;
use crate::durable::listing::entries;
use std::collections::HashSet;
use std::path::PathBuf;
use sys::{Error, Result, disk};

/// What tasks say then.
pub(crate) const SENTENCE: &str = "the phase publish does all of it in one process";

/// The name of the note; a number says of which submission it is.
const NAME: &str = "alone";

/// Leaves the note for the job of `submission`. Any number of tasks may do so, because the file is empty.
///
/// # Errors
/// [`Error::Io`] if it cannot be written.
pub(crate) fn leave_note(directory: &JobDirectory, submission: u64) -> Result<()> {
    let path = directory.job().join(format!("{NAME}.{submission}"));
    disk::open_or_create(&path).map_err(Error::io("create", &path))?;
    disk::sync_folder(directory.job()).map_err(Error::io("write", directory.job()))
}

/// Returns the notes that are there, each with its submission.
fn found(directory: &JobDirectory) -> Result<Vec<(PathBuf, u64)>> {
    // Some network file systems remember for a while that a file is not there, but not what is in a folder.
    let there = entries(directory.job())?;
    let note = |path: PathBuf| {
        let (name, submission) = path.file_name()?.to_str()?.split_once('.')?;
        let submission = submission.parse().ok().filter(|_| name == NAME)?;
        Some((path, submission))
    };
    Ok(there.into_iter().filter_map(note).collect())
}

/// Returns the notes that are there, as the journal would name them.
///
/// # Errors
/// [`Error::Io`] if the job directory cannot be listed.
pub(crate) fn notes(directory: &JobDirectory) -> Result<HashSet<PathBuf>> {
    Ok(found(directory)?.iter().map(|(path, _)| directory.name(path)).collect())
}

/// Removes all notes, because tasks do the job.
///
/// # Errors
/// [`Error::Io`] if one cannot be removed.
pub(crate) fn remove_notes(directory: &JobDirectory) -> Result<()> {
    found(directory)?.iter().try_for_each(|(path, _)| remove_file(path))
}

/// Returns the latest submission whose tasks have left a note; 0 without one.
///
/// # Errors
/// [`Error::Io`] if the job directory cannot be listed.
pub(crate) fn submission(directory: &JobDirectory) -> Result<u64> {
    Ok(found(directory)?.into_iter().map(|(_, submission)| submission).max().unwrap_or(0))
}

/// Tells whether there is a note of `submission`, or of a later one.
///
/// # Errors
/// [`Error::Io`] if the job directory cannot be listed.
pub(crate) fn is_noted(directory: &JobDirectory, submission: u64) -> Result<bool> {
    Ok(found(directory)?.iter().any(|(_, of)| *of >= submission))
}
