//! Records that are grouped by key at the end: in memory, or in temporary files once they are too many.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::PathBuf;

use bytemuck::{Pod, cast_slice, cast_slice_mut};

use crate::{Error, Result};

/// Records are parted by key into so many buckets; at the end one bucket at a time is in memory.
const BUCKETS: usize = 64;

/// A record with a key.
pub(super) trait Record: Pod {
    /// A hash of the key: records of one key have the same.
    fn hash(&self) -> u64;
}

/// Many records in little memory.
pub(super) struct Spill<R> {
    buckets: Vec<Vec<R>>,
    held: usize,
    /// Records held in memory at most.
    limit: usize,
    directory: PathBuf,
    /// One for every bucket, without a name, once there was need.
    files: Vec<File>,
}

impl<R: Record> Spill<R> {
    /// Holds up to `memory` bytes; what is more goes to temporary files in `directory`.
    pub(super) fn new(directory: PathBuf, memory: u64) -> Spill<R> {
        // Vectors that grow have up to twice the room they need.
        let limit = (memory as usize / (2 * size_of::<R>())).max(1024);
        Spill { buckets: (0..BUCKETS).map(|_| Vec::new()).collect(), held: 0, limit, directory, files: Vec::new() }
    }

    pub(super) fn extend(&mut self, records: &[R]) -> Result<()> {
        for record in records {
            self.buckets[(record.hash() >> 32) as usize % BUCKETS].push(*record);
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

    /// Calls `body` with all records of one bucket after the other.
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

fn load<R: Record>(file: &mut File, bucket: &mut Vec<R>) -> std::io::Result<()> {
    let bytes = file.seek(SeekFrom::End(0))? as usize;
    file.seek(SeekFrom::Start(0))?;
    let held = bucket.len();
    bucket.resize(held + bytes / size_of::<R>(), R::zeroed());
    file.read_exact(cast_slice_mut(&mut bucket[held..]))
}
