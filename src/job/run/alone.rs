//! A note in the job directory: tasks leave the job to one process, which does all of it when the others would publish. So one bad file
//! ends no job on many machines.

use crate::job::durable::directory::JobDirectory;
use crate::{Error, Result, disk};
use std::path::PathBuf;

/// How one process does the job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Alone {
    /// As one part, because what was read contradicts the headers, or a bad file is left out.
    InOnePart,
    /// As it would by itself: the job is one part anyway, or its mesh takes a coarser lattice.
    AsItIs,
}

impl Alone {
    /// What tasks say then.
    pub(crate) const SENTENCE: &str = "the phase publish does all of it in one process";

    const ALL: [Alone; 2] = [Alone::InOnePart, Alone::AsItIs];

    fn path(self, directory: &JobDirectory) -> PathBuf {
        directory.job().join(match self {
            Alone::InOnePart => "alone-in-one-part",
            Alone::AsItIs => "alone",
        })
    }

    /// Leaves the note. Any number of tasks may do so, because the file is empty.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be written.
    pub(crate) fn note(self, directory: &JobDirectory) -> Result<()> {
        let path = self.path(directory);
        disk::open_or_create(&path).map_err(Error::io("create", &path))?;
        disk::sync_folder(directory.job()).map_err(Error::io("write", directory.job()))
    }

    /// Returns what a note says, if there is one.
    ///
    /// # Errors
    /// [`Error::Io`] if the job directory cannot be listed.
    pub(crate) fn find(directory: &JobDirectory) -> Result<Option<Alone>> {
        // Some network file systems remember for a while that a file is not there, but not what is in a folder.
        let there = disk::list(directory.job()).map_err(Error::io("read", directory.job()))?;
        Ok(Alone::ALL.into_iter().find(|alone| there.contains(&alone.path(directory))))
    }
}
