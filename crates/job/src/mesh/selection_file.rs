//! What of a selection the memory does not hold.

use crate::durable::directory::JobDirectory;
use crate::durable::waiting_file::WaitingFile;
use selection::SelectionStore;
use std::sync::atomic::{AtomicBool, Ordering};
use sys::Result;

/// A file of selected points, and of blocks between rounds.
#[derive(Debug)]
pub(crate) struct SelectionFile {
    file: WaitingFile,
    is_removed: AtomicBool,
}

impl SelectionFile {
    /// Makes the file in the folder of the first part.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(crate) fn at(directory: &JobDirectory) -> Result<SelectionFile> {
        let file = WaitingFile::at(&directory.scratch("selection"))?;
        Ok(SelectionFile { file, is_removed: AtomicBool::new(false) })
    }

    /// Returns the number of bytes that have a position. Not all of them are on the disk.
    pub(crate) fn bytes(&self) -> u64 {
        self.file.bytes()
    }

    /// Removes the file, which nothing reads any more.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(crate) fn remove(&self) -> Result<()> {
        self.is_removed.store(true, Ordering::Relaxed);
        self.file.remove()
    }
}

impl Drop for SelectionFile {
    /// Where the selection has failed, the disk may be full.
    fn drop(&mut self) {
        if !self.is_removed.load(Ordering::Relaxed) {
            // The error that ends the selection tells more than one here.
            let _ = self.file.remove();
        }
    }
}

impl SelectionStore for SelectionFile {
    fn reserve(&self, bytes: u64) -> u64 {
        self.file.reserve(bytes)
    }

    fn write(&self, at: u64, bytes: &[u8]) -> Result<()> {
        self.file.write(bytes, at)
    }

    fn read(&self, at: u64, bytes: &mut [u8]) -> Result<()> {
        self.file.read(bytes, at)
    }

    fn free(&self, at: u64, bytes: u64) -> Result<()> {
        self.file.free(at..at + bytes)
    }
}
