//! The files between steps: a few columns of plain values each, in the machine's byte order, written whole.

use super::directory::{Written, write_whole};
use crate::positioned::read_exact_at;
use crate::{Error, Result};
use bytemuck::Pod;
use std::fs::File;
use std::path::{Path, PathBuf};

/// Collects columns and writes them as one file.
#[derive(Default)]
pub struct ColumnWriter {
    bytes: Vec<u8>,
}

impl ColumnWriter {
    /// Adds a column.
    pub fn push<T: Pod>(mut self, column: &[T]) -> ColumnWriter {
        self.bytes.extend_from_slice(&(column.len() as u64).to_ne_bytes());
        self.bytes.extend_from_slice(bytemuck::cast_slice(column));
        self
    }

    /// Writes the file, whole or not at all.
    ///
    /// # Errors
    /// [`Error::Io`] if that fails.
    pub fn write(self, path: &Path) -> Result<Written> {
        write_whole(path, &self.bytes)
    }
}

/// Reads the columns of a file in the order in which they were written.
pub struct ColumnReader {
    path: PathBuf,
    file: File,
    size: u64,
    at: u64,
}

impl ColumnReader {
    /// Reads the file at `path`.
    ///
    /// # Errors
    /// [`Error::Io`] if that fails.
    pub fn open(path: &Path) -> Result<ColumnReader> {
        let file = File::open(path).map_err(Error::io("open", path))?;
        let size = file.metadata().map_err(Error::io("read", path))?.len();
        Ok(ColumnReader { path: path.to_path_buf(), file, size, at: 0 })
    }

    /// The next column.
    ///
    /// # Errors
    /// [`Error::Io`] if reading fails, [`Error::Broken`] if the file holds less than the column says.
    pub fn column<T: Pod>(&mut self) -> Result<Vec<T>> {
        let length = self.length::<T>()?;
        self.take(length)
    }

    /// `count` values of the next column from the one at `first` on, without reading the others. It must be the last
    /// column that is asked for.
    ///
    /// # Errors
    /// As [`ColumnReader::column`].
    pub fn column_part<T: Pod>(mut self, first: usize, count: usize) -> Result<Vec<T>> {
        let length = self.length::<T>()?;
        if first.checked_add(count).is_none_or(|end| end > length) {
            return Err(self.broken());
        }
        self.at += (first * size_of::<T>()) as u64;
        self.take(count)
    }

    /// The number of values in the next column, all of which are in the file.
    fn length<T: Pod>(&mut self) -> Result<usize> {
        let length = self.take::<u64>(1)?[0];
        let fits = length.checked_mul(size_of::<T>() as u64).is_some_and(|bytes| bytes <= self.size - self.at);
        if fits { Ok(length as usize) } else { Err(self.broken()) }
    }

    fn take<T: Pod>(&mut self, count: usize) -> Result<Vec<T>> {
        let bytes = (count * size_of::<T>()) as u64;
        if bytes > self.size - self.at {
            return Err(self.broken());
        }
        let mut values = vec![T::zeroed(); count];
        let buffer = bytemuck::cast_slice_mut(&mut values);
        read_exact_at(&self.file, buffer, self.at).map_err(Error::io("read", &self.path))?;
        self.at += bytes;
        Ok(values)
    }

    fn broken(&self) -> Error {
        Error::Broken(format!("{} ends too early", self.path.display()))
    }
}
