//! Collects records and groups them by key: in memory, or in temporary files once there are too many.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::PathBuf;

use bytemuck::{Pod, cast_slice, cast_slice_mut};

use sys::{Error, Result};

/// Records are divided by key into this many buckets. Grouping holds one bucket at a time in memory.
const BUCKETS: usize = 64;

/// Records are read back from a file in blocks of this many.
const BLOCK: usize = 1 << 13;

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

    /// Calls `body` for groups of records until it has seen all. Records with the same key are in the same group. A group is a bucket, or
    /// a part of one that has too many records for the memory.
    pub(super) fn for_each_bucket(mut self, mut body: impl FnMut(&mut Vec<R>)) -> Result<()> {
        for number in 0..BUCKETS {
            let held = std::mem::take(&mut self.buckets[number]);
            let failed = Error::io("read a temporary file in", &self.directory);
            let file = self.files.get(number);
            for_each_part(held, file, self.limit, &mut body).map_err(failed)?;
        }
        Ok(())
    }
}

/// Calls `body` for each part of a bucket, of which some records are `held` and the others in a file.
fn for_each_part<R: KeyedRecord>(
    held: Vec<R>,
    file: Option<&File>,
    limit: usize,
    body: &mut impl FnMut(&mut Vec<R>),
) -> std::io::Result<()> {
    let Some(mut file) = file else {
        let mut held = held;
        body(&mut held);
        return Ok(());
    };
    let stored = file.seek(SeekFrom::End(0))? as usize / size_of::<R>();
    let parts = (held.len() + stored).div_ceil(limit).max(1) as u64;
    let mut block = vec![R::zeroed(); BLOCK.min(stored)];
    for part in 0..parts {
        let is_in_part = |record: &&R| record.key_hash() % parts == part;
        let mut records: Vec<R> = held.iter().filter(is_in_part).copied().collect();
        file.seek(SeekFrom::Start(0))?;
        let mut left = stored;
        while left > 0 {
            let block = &mut block[..left.min(BLOCK)];
            file.read_exact(cast_slice_mut(block))?;
            records.extend(block.iter().filter(is_in_part));
            left -= block.len();
        }
        body(&mut records);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;
    use std::collections::HashSet;

    #[repr(C)]
    #[derive(Clone, Copy, Pod, Zeroable)]
    struct Pair {
        key: u64,
        value: u64,
    }

    impl KeyedRecord for Pair {
        fn key_hash(&self) -> u64 {
            xxhash_rust::xxh3::xxh3_64(&self.key.to_le_bytes())
        }
    }

    #[test]
    fn equal_keys_meet_and_no_group_is_much_larger_than_the_memory() {
        let folder = tempfile::tempdir().unwrap();
        for (memory, largest_expected) in [(1 << 30, 400_000), (0, 1_300)] {
            let mut records = KeyedRecords::new(folder.path().to_path_buf(), memory);
            for value in 0..3 {
                let pairs: Vec<Pair> = (0..100_000).map(|key| Pair { key, value }).collect();
                pairs.chunks(900).for_each(|chunk| records.extend(chunk).unwrap());
            }
            let (mut seen, mut count, mut largest) = (HashSet::new(), 0, 0);
            records
                .for_each_bucket(|group| {
                    largest = largest.max(group.len());
                    count += group.len();
                    let keys: HashSet<u64> = group.iter().map(|pair| pair.key).collect();
                    assert_eq!(group.len(), 3 * keys.len(), "all values of a key are together");
                    keys.into_iter().for_each(|key| assert!(seen.insert(key)));
                })
                .unwrap();
            assert_eq!((count, seen.len()), (300_000, 100_000));
            assert!(largest < largest_expected, "{largest} records with {memory} bytes");
        }
    }
}
