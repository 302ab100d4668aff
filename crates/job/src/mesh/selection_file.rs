//! What of a selection the memory does not hold.

use crate::durable::directory::JobDirectory;
use crate::durable::waiting_file::WaitingFile;
use selection::SelectionStore;
use std::sync::atomic::{AtomicU64, Ordering};
use sys::Result;

/// A file of selected points, and of blocks between rounds.
#[derive(Debug)]
pub(crate) struct SelectionFile {
    file: WaitingFile,
    /// The bytes that are in use, and the most that were.
    in_use: AtomicU64,
    most_in_use: AtomicU64,
}

impl SelectionFile {
    /// Makes the file in the folder of the first part.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(crate) fn at(directory: &JobDirectory) -> Result<SelectionFile> {
        let file = WaitingFile::at(&directory.scratch("selection"))?;
        Ok(SelectionFile { file, in_use: AtomicU64::new(0), most_in_use: AtomicU64::new(0) })
    }

    /// Returns the most bytes that were in use at a time.
    pub(crate) fn most_in_use(&self) -> u64 {
        self.most_in_use.load(Ordering::Relaxed)
    }

    /// Removes the file, which nothing reads any more.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(crate) fn remove(&self) -> Result<()> {
        self.file.remove()
    }
}

impl SelectionStore for SelectionFile {
    fn reserve(&self, bytes: u64) -> u64 {
        let in_use = self.in_use.fetch_add(bytes, Ordering::Relaxed) + bytes;
        self.most_in_use.fetch_max(in_use, Ordering::Relaxed);
        self.file.reserve(bytes)
    }

    fn write(&self, at: u64, bytes: &[u8]) -> Result<()> {
        self.file.write(bytes, at)
    }

    fn read(&self, at: u64, bytes: &mut [u8]) -> Result<()> {
        self.file.read(bytes, at)
    }

    fn free(&self, at: u64, bytes: u64) -> Result<()> {
        self.in_use.fetch_sub(bytes, Ordering::Relaxed);
        self.file.free(at..at + bytes)
    }
}
