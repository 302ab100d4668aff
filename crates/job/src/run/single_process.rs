//! A note in the job directory: tasks leave the job to one process, which does all of it when the others would publish. So one bad file
//! ends no job on many machines.

use crate::durable::atomic_file::remove_file;
use crate::durable::directory::JobDirectory;
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use sys::{Error, Result, disk};

/// How one process does the job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SingleProcess {
    /// As one part, because what was read contradicts the headers, or a bad file is left out.
    AsOnePart,
    /// As it would by itself: the job is one part anyway, or its mesh takes a coarser lattice.
    AsPlanned,
}

impl SingleProcess {
    /// What tasks say then.
    pub(crate) const SENTENCE: &str = "the phase publish does all of it in one process";

    const ALL: [SingleProcess; 2] = [SingleProcess::AsOnePart, SingleProcess::AsPlanned];

    fn name(self) -> &'static str {
        match self {
            SingleProcess::AsOnePart => "alone-in-one-part",
            SingleProcess::AsPlanned => "alone",
        }
    }

    /// Leaves the note for the job of `submission`. Any number of tasks may do so, because the file is empty.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be written.
    pub(crate) fn note(self, directory: &JobDirectory, submission: u64) -> Result<()> {
        let path = directory.job().join(format!("{}.{submission}", self.name()));
        disk::open_or_create(&path).map_err(Error::io("create", &path))?;
        disk::sync_folder(directory.job()).map_err(Error::io("write", directory.job()))
    }

    /// Returns the notes that are there, as the journal would name them.
    ///
    /// # Errors
    /// [`Error::Io`] if the job directory cannot be listed.
    pub(crate) fn notes(directory: &JobDirectory) -> Result<HashSet<PathBuf>> {
        let there = disk::list(directory.job()).map_err(Error::io("read", directory.job()))?;
        let is_note = |path: &&PathBuf| SingleProcess::ALL.into_iter().any(|alone| alone.is_said_by(path, 0));
        Ok(there.iter().filter(is_note).map(|path| directory.name(path)).collect())
    }

    /// Removes all notes, because tasks do the job.
    ///
    /// # Errors
    /// [`Error::Io`] if one cannot be removed.
    pub(crate) fn forget(directory: &JobDirectory) -> Result<()> {
        SingleProcess::notes(directory)?.iter().try_for_each(|name| remove_file(&directory.file(name)))
    }

    /// Returns the latest submission whose tasks have left a note; 0 without one.
    ///
    /// # Errors
    /// [`Error::Io`] if the job directory cannot be listed.
    pub(crate) fn submission(directory: &JobDirectory) -> Result<u64> {
        let there = disk::list(directory.job()).map_err(Error::io("read", directory.job()))?;
        let of_note = |path: &PathBuf| SingleProcess::ALL.into_iter().find_map(|alone| alone.submission_in(path));
        Ok(there.iter().filter_map(of_note).max().unwrap_or(0))
    }

    /// Returns the submission in the name of a note that says this; `None` if the file at `path` is none.
    fn submission_in(self, path: &Path) -> Option<u64> {
        let (name, submission) = path.file_name()?.to_str()?.split_once('.')?;
        submission.parse().ok().filter(|_| name == self.name())
    }

    fn is_said_by(self, path: &Path, submission: u64) -> bool {
        self.submission_in(path).is_some_and(|of| of >= submission)
    }

    /// Returns what a note of `submission`, or of a later one, says, if there is one.
    ///
    /// # Errors
    /// [`Error::Io`] if the job directory cannot be listed.
    pub(crate) fn find(directory: &JobDirectory, submission: u64) -> Result<Option<SingleProcess>> {
        // Some network file systems remember for a while that a file is not there, but not what is in a folder.
        let there = disk::list(directory.job()).map_err(Error::io("read", directory.job()))?;
        Ok(SingleProcess::ALL.into_iter().find(|alone| there.iter().any(|path| alone.is_said_by(path, submission))))
    }
}
