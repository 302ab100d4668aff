//! A record of the store: a few columns of plain values, in the machine's byte order.
//!
//! A column is the number of its values as a `u128`, then the values, then zeros up to a multiple of 16 bytes: so values of any type
//! are aligned in the file, and slices of it can be used as they are.

use crate::durable::store::{RecordKey, Store};
use bytemuck::Pod;
use std::ops::Range;
use sys::{Error, Result};

/// Bytes to which columns are padded: the alignment of `u128`, the largest of plain values.
const ALIGNMENT: usize = size_of::<u128>();

/// Collects columns and writes them as one record.
#[derive(Default)]
pub struct ColumnWriter<'a> {
    /// The number of values of each column, and their bytes in parts.
    columns: Vec<([u8; ALIGNMENT], Vec<&'a [u8]>)>,
}

impl<'a> ColumnWriter<'a> {
    /// Adds a column.
    pub fn push<T: Pod>(self, column: &'a [T]) -> ColumnWriter<'a> {
        self.push_parts(&[column])
    }

    /// Adds a column whose values lie in several places of memory.
    pub fn push_parts<T: Pod>(mut self, parts: &[&'a [T]]) -> ColumnWriter<'a> {
        let count: u128 = parts.iter().map(|part| part.len() as u128).sum();
        self.columns.push((count.to_ne_bytes(), parts.iter().map(|part| bytemuck::cast_slice(part)).collect()));
        self
    }

    /// Writes the record of `key`.
    ///
    /// # Errors
    /// [`Error::Io`] if writing fails.
    pub fn write<K: RecordKey>(self, store: &Store<K>, key: K) -> Result<()> {
        let mut pieces: Vec<&[u8]> = Vec::new();
        for (length, parts) in &self.columns {
            let bytes: usize = parts.iter().map(|part| part.len()).sum();
            pieces.push(length);
            pieces.extend(parts);
            pieces.push(&[0; ALIGNMENT][..bytes.next_multiple_of(ALIGNMENT) - bytes]);
        }
        store.put(key, &pieces)
    }
}

/// Reads the columns of a record in the order in which they were written.
pub struct ColumnReader<'a, K> {
    store: &'a Store<K>,
    key: K,
    /// What is left of the record.
    rest: Range<u64>,
}

impl<'a, K: RecordKey> ColumnReader<'a, K> {
    /// Finds the record of `key`.
    ///
    /// # Errors
    /// [`Error::Broken`] if the store has none.
    pub fn open(store: &'a Store<K>, key: K) -> Result<ColumnReader<'a, K>> {
        Ok(ColumnReader { store, key, rest: store.place(key)? })
    }

    /// Returns the next column.
    ///
    /// # Errors
    /// [`Error::Io`] if reading fails, [`Error::Broken`] if the record is shorter than the column says.
    pub fn column<T: Pod>(&mut self) -> Result<Vec<T>> {
        let count = self.count::<T>()?;
        let column = self.store.read(self.key, self.rest.start, count)?;
        self.skip((count * size_of::<T>()).next_multiple_of(ALIGNMENT) as u64)?;
        Ok(column)
    }

    /// Returns whether the record has no more columns.
    pub fn is_at_end(&self) -> bool {
        self.rest.is_empty()
    }

    /// Goes on to the column after the next, and returns how many values that has.
    ///
    /// # Errors
    /// As [`ColumnReader::column`].
    pub fn skip_column<T: Pod>(&mut self) -> Result<usize> {
        let count = self.count::<T>()?;
        self.skip((count * size_of::<T>()).next_multiple_of(ALIGNMENT) as u64)?;
        Ok(count)
    }

    /// Returns `count` values of the last column from the one at `first` on, without reading the others.
    ///
    /// # Errors
    /// As [`ColumnReader::column`].
    pub fn column_part<T: Pod>(mut self, first: usize, count: usize) -> Result<Vec<T>> {
        let length = self.count::<T>()?;
        if first.checked_add(count).is_none_or(|end| end > length) {
            return Err(self.ends_too_early());
        }
        self.store.read(self.key, self.rest.start + (first * size_of::<T>()) as u64, count)
    }

    /// Reads the number of values in the next column, and checks that the record holds them all.
    fn count<T: Pod>(&mut self) -> Result<usize> {
        let at = self.rest.start;
        self.skip(ALIGNMENT as u64)?;
        let count = self.store.read::<u128>(self.key, at, 1)?[0];
        let left = u128::from(self.rest.end - self.rest.start);
        let fits = count.checked_mul(size_of::<T>() as u128).is_some_and(|bytes| bytes <= left);
        if fits { Ok(count as usize) } else { Err(self.ends_too_early()) }
    }

    fn skip(&mut self, bytes: u64) -> Result<()> {
        if self.rest.end - self.rest.start < bytes {
            return Err(self.ends_too_early());
        }
        self.rest.start += bytes;
        Ok(())
    }

    fn ends_too_early(&self) -> Error {
        Error::Broken(format!("{:?} in {} ends too early", self.key, self.store.path(self.key).display()))
    }
}
