//! A record of the store: a few columns of plain values each, in the machine's byte order.

use crate::job::durable::store::{Key, Store, Stored};
use crate::{Error, Result};
use bytemuck::Pod;

/// Collects columns and writes them as one record.
#[derive(Default)]
pub struct ColumnWriter<'a> {
    /// The number of values and the bytes of each.
    columns: Vec<([u8; 8], &'a [u8])>,
}

impl<'a> ColumnWriter<'a> {
    /// Adds a column.
    pub fn push<T: Pod>(mut self, column: &'a [T]) -> ColumnWriter<'a> {
        self.columns.push(((column.len() as u64).to_ne_bytes(), bytemuck::cast_slice(column)));
        self
    }

    /// Writes the record of `key`.
    ///
    /// # Errors
    /// [`Error::Io`] if that fails.
    pub fn write(self, store: &Store, key: Key) -> Result<Stored> {
        let pieces: Vec<&[u8]> = self.columns.iter().flat_map(|(length, bytes)| [&length[..], bytes]).collect();
        store.put(key, &pieces)
    }
}

/// Reads the columns of a record in the order in which they were written.
pub struct ColumnReader<'a> {
    store: &'a Store,
    key: Key,
    at: u64,
    end: u64,
}

impl ColumnReader<'_> {
    /// Reads the record of `key`.
    ///
    /// # Errors
    /// [`Error::Broken`] if there is none.
    pub fn open(store: &Store, key: Key) -> Result<ColumnReader<'_>> {
        let place = store.place(key)?;
        Ok(ColumnReader { store, key, at: place.at, end: place.at + place.length })
    }

    /// The next column.
    ///
    /// # Errors
    /// [`Error::Io`] if reading fails, [`Error::Broken`] if the record holds less than the column says.
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

    /// The number of values in the next column, all of which are in the record.
    fn length<T: Pod>(&mut self) -> Result<usize> {
        let length = self.take::<u64>(1)?[0];
        let fits = length.checked_mul(size_of::<T>() as u64).is_some_and(|bytes| bytes <= self.end - self.at);
        if fits { Ok(length as usize) } else { Err(self.broken()) }
    }

    fn take<T: Pod>(&mut self, count: usize) -> Result<Vec<T>> {
        let bytes = (count * size_of::<T>()) as u64;
        if bytes > self.end - self.at {
            return Err(self.broken());
        }
        let mut values = vec![T::zeroed(); count];
        self.store.read(self.key, self.at, bytemuck::cast_slice_mut(&mut values))?;
        self.at += bytes;
        Ok(values)
    }

    fn broken(&self) -> Error {
        Error::Broken(format!("{:?} in {} ends too early", self.key, self.store.path(self.key).display()))
    }
}
