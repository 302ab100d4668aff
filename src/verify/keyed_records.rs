//! Collects records and groups them by key: in memory, or in temporary files once there are too many.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::PathBuf;

use bytemuck::{Pod, cast_slice, cast_slice_mut};

use crate::{Error, Result};

/// Records are divided by key into this many buckets. Grouping holds one bucket at a time in memory.
const BUCKETS: usize = 64;

/// A record with a key.
pub(super) trait KeyedRecord: Pod {
    /// Returns a hash of the key, the same for all records with that key.
    fn key_hash(&self) -> u64;
}

/// Many records in little memory.
pub(super) struct KeyedRecords<R> {
    buckets: Vec<Vec<R>>,
    /// The number of records in memory.
    held: usize,
    /// The greatest number of records in memory.
    limit: usize,
    directory: PathBuf,
    /// A file without a name for every bucket, or none as long as all records fit the memory.
    files: Vec<File>,
}

impl<R: KeyedRecord> KeyedRecords<R> {
    /// Returns an empty collection that takes up to `memory` bytes and then writes to temporary files in `directory`.
    pub(super) fn new(directory: PathBuf, memory: u64) -> KeyedRecords<R> {
        // A growing vector takes up to twice the room that it needs.
        let limit = (memory as usize / (2 * size_of::<R>())).max(1024);
        KeyedRecords {
            buckets: (0..BUCKETS).map(|_| Vec::new()).collect(),
            held: 0,
            limit,
            directory,
            files: Vec::new(),
        }
    }

    pub(super) fn extend(&mut self, records: &[R]) -> Result<()> {
        for record in records {
            self.buckets[(record.key_hash() >> 32) as usize % BUCKETS].push(*record);
        }
        self.held += records.len();
        if self.held > self.limit { self.write_out() } else { Ok(()) }
    }

    fn write_out(&mut self) -> Result<()> {
        let directory = &self.directory;
        while self.files.len() < BUCKETS {
            let file = tempfile::tempfile_in(directory).map_err(Error::io("create a temporary file in", directory))?;
            self.files.push(file);
        }
        for (bucket, file) in self.buckets.iter_mut().zip(&mut self.files) {
            file.write_all(cast_slice(bucket)).map_err(Error::io("write a temporary file in", directory))?;
            bucket.clear();
        }
        self.held = 0;
        Ok(())
    }

    /// Calls `body` once for each bucket with all its records. Records with the same key are in the same bucket.
    pub(super) fn for_each_bucket(mut self, mut body: impl FnMut(&mut Vec<R>)) -> Result<()> {
        for number in 0..BUCKETS {
            let mut bucket = std::mem::take(&mut self.buckets[number]);
            if let Some(file) = self.files.get_mut(number) {
                load(file, &mut bucket).map_err(Error::io("read a temporary file in", &self.directory))?;
            }
            body(&mut bucket);
        }
        Ok(())
    }
}

/// Appends the records of a file to a bucket.
fn load<R: KeyedRecord>(file: &mut File, bucket: &mut Vec<R>) -> std::io::Result<()> {
    let bytes = file.seek(SeekFrom::End(0))? as usize;
    file.seek(SeekFrom::Start(0))?;
    let held = bucket.len();
    bucket.resize(held + bytes / size_of::<R>(), R::zeroed());
    file.read_exact(cast_slice_mut(&mut bucket[held..]))
}
