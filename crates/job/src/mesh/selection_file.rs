//! What of a selection the memory does not hold.

use crate::durable::directory::JobDirectory;
use crate::durable::waiting_file::WaitingFile;
use selection::SelectionStore;
use sys::Result;

/// A file of selected points, and of blocks between rounds.
#[derive(Debug)]
pub(crate) struct SelectionFile(WaitingFile);

impl SelectionFile {
    /// Makes their file in the folder of the first part.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(crate) fn at(directory: &JobDirectory) -> Result<SelectionFile> {
        WaitingFile::at(&directory.scratch("selection")).map(SelectionFile)
    }

    /// Removes the file.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(crate) fn discard(self) -> Result<()> {
        self.0.discard()
    }
}

impl SelectionStore for SelectionFile {
    fn reserve(&self, bytes: u64) -> u64 {
        self.0.reserve(bytes)
    }

    fn write(&self, at: u64, bytes: &[u8]) -> Result<()> {
        self.0.write(bytes, at)
    }

    fn read(&self, at: u64, bytes: &mut [u8]) -> Result<()> {
        self.0.read(bytes, at)
    }

    fn free(&self, at: u64, bytes: u64) -> Result<()> {
        self.0.free(at..at + bytes)
    }
}
