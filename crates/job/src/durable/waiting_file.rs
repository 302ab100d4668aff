//! A file of a step's own, in which pieces of a result wait until all are there. Threads may add some in any order.

use std::fs::File;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use sys::positional_io::read_exact_at;
use sys::{Error, Result, disk, fault};

/// A file of pieces.
#[derive(Debug)]
pub(crate) struct WaitingFile {
    path: PathBuf,
    file: File,
    end: AtomicU64,
}

impl WaitingFile {
    /// Makes the file at `path`.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn at(path: &Path) -> Result<WaitingFile> {
        let file = disk::create(path).map_err(Error::io("create", path))?;
        Ok(WaitingFile { path: path.into(), file, end: AtomicU64::new(0) })
    }

    /// Adds a piece, and returns its place.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn add(&self, bytes: &[u8]) -> Result<u64> {
        let at = self.reserve(bytes.len() as u64);
        self.write(bytes, at)?;
        Ok(at)
    }

    /// Returns the place of so many bytes that will be [written](WaitingFile::write).
    pub(crate) fn reserve(&self, bytes: u64) -> u64 {
        self.end.fetch_add(bytes, Ordering::Relaxed)
    }

    /// Returns the number of bytes that have a place.
    pub(crate) fn bytes(&self) -> u64 {
        self.end.load(Ordering::Relaxed)
    }

    /// Writes bytes to a place that they have [reserved](WaitingFile::reserve).
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn write(&self, bytes: &[u8], at: u64) -> Result<()> {
        disk::write_all_at(&self.file, bytes, at).map_err(Error::io("write", &self.path))
    }

    /// Fills `bytes` with those from a place on.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn read(&self, bytes: &mut [u8], at: u64) -> Result<()> {
        let read = fault::read("read-result").and_then(|()| read_exact_at(&self.file, bytes, at));
        read.map_err(Error::io("read", &self.path))
    }

    /// Gives the space of bytes back that are no longer needed.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn free(&self, bytes: Range<u64>) -> Result<()> {
        disk::free(&self.file, &[bytes]).map(drop).map_err(Error::io("write", &self.path))
    }

    /// Removes the file.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn discard(self) -> Result<()> {
        drop(self.file);
        disk::remove_file(&self.path).map_err(Error::io("remove", &self.path))
    }

    /// Removes a file that is in use, but will not be read any more.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn remove(&self) -> Result<()> {
        disk::remove_file(&self.path).map_err(Error::io("remove", &self.path))
    }
}
