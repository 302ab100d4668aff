//! The store: what steps leave for later steps, one record for each result, in a few files that only grow, until the space of records
//! that no step needs any more is given back to the disk.
//!
//! Not one file for each result: creating and removing thousands of small files takes a large part of a job's time on common file
//! systems. Not one file for all: threads would wait for each other while they write, and one thread would free the whole file at
//! the end while the others idle.
//!
//! Each phase leaves in the journal what has changed ([`Store::take_changes`]): where each record is, and the hash of its bytes. So a store
//! can be opened again after a kill, whatever the kill left behind the last known record.

use crate::durable::directory::STORE_FILES;
use bytemuck::Pod;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::{HashMap, HashSet};
use std::fmt::Debug;
use std::fs::File;
use std::hash::Hash;
use std::io::{BufWriter, ErrorKind, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{PoisonError, RwLock, RwLockReadGuard};
use sys::disk::WriteFrom;
use sys::positional_io::read_exact_at;
use sys::{Error, Result, disk, fault};
use xxhash_rust::xxh3::Xxh3;

/// Bytes of a page: what file systems give to files and take back.
pub const PAGE: u64 = 4096;

/// What a record holds. The job says what there is.
pub trait RecordKey: Copy + Debug + Eq + Hash + Send + Sync + Serialize + DeserializeOwned {
    /// Returns a number for the kind of record and one for the tile or tree node that it belongs to.
    fn code(self) -> [u32; 2];
}

/// Returns the index of the file that holds the record of `key`.
fn file_index(key: impl RecordKey) -> usize {
    key.code()[1] as usize % STORE_FILES
}

/// Returns a hasher for the record of `key`: a record in the place of another does not have its hash.
fn hasher(key: impl RecordKey) -> Xxh3 {
    let [kind, index] = key.code();
    Xxh3::with_seed((kind as u64) << 32 | index as u64)
}

/// A record as the journal knows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RecordRef<K> {
    key: K,
    /// The first byte of the record in its file.
    at: u64,
    /// The number of bytes.
    length: u64,
    hash: u64,
}

impl<K: RecordKey> RecordRef<K> {
    /// Returns what the record holds.
    pub(crate) fn key(&self) -> K {
        self.key
    }

    /// Returns the number of its bytes.
    pub(crate) fn bytes(&self) -> u64 {
        self.length
    }

    fn place(&self) -> Range<u64> {
        self.at..self.at + self.length
    }
}

/// What has become of the records of a store since its journal was told.
#[derive(Debug, Serialize, Deserialize)]
pub struct RecordChanges<K> {
    /// The records that were written, and are still there.
    pub(crate) written: Vec<RecordRef<K>>,
    /// Those that the journal knows, and that are given up. The disk gets their space back once the journal knows this too.
    pub(crate) dropped: Vec<RecordRef<K>>,
}

/// The results of all steps of a job, on disk. Several threads may write and read at the same time.
#[derive(Debug)]
pub struct Store<K> {
    files: Vec<StoreFile>,
    records: RwLock<Records<K>>,
    /// The bytes of all records that did not go back to the disk, and the most that there were at any time.
    bytes: AtomicU64,
    peak: AtomicU64,
}

#[derive(Debug)]
struct Records<K> {
    /// All records.
    known: HashMap<K, RecordRef<K>>,
    /// Those that the journal does not know yet.
    written: HashSet<K>,
    /// Those that are given up, which the journal still knows.
    dropped: Vec<RecordRef<K>>,
}

#[derive(Debug)]
struct StoreFile {
    path: PathBuf,
    file: File,
    end: AtomicU64,
}

impl<K: RecordKey> Store<K> {
    /// Opens the store in the files at `paths` with the given records; new records overwrite everything else in it.
    ///
    /// # Errors
    /// [`Error::Io`] if a file cannot be opened.
    pub fn open(paths: [PathBuf; STORE_FILES], records: impl IntoIterator<Item = RecordRef<K>>) -> Result<Store<K>> {
        let known: HashMap<K, RecordRef<K>> = records.into_iter().map(|record| (record.key, record)).collect();
        let mut ends = [0; STORE_FILES];
        for record in known.values() {
            let end = &mut ends[file_index(record.key)];
            *end = (record.at + record.length).max(*end);
        }
        let open = |(path, end): (PathBuf, u64)| {
            // If a file is missing, only its own records are lost.
            let file = disk::open_or_create(&path).map_err(Error::io("open", &path))?;
            Ok(StoreFile { path, file, end: AtomicU64::new(end) })
        };
        let files = paths.into_iter().zip(ends).map(open).collect::<Result<_>>()?;
        let bytes = known.values().map(|record| record.length).sum();
        let records = RwLock::new(Records { known, written: HashSet::new(), dropped: Vec::new() });
        Ok(Store { files, records, bytes: AtomicU64::new(bytes), peak: AtomicU64::new(bytes) })
    }

    /// Tells whether the record is there and holds what was written.
    ///
    /// # Errors
    /// [`Error::Io`] if the disk does not tell.
    pub fn is_whole(&self, record: &RecordRef<K>) -> Result<bool> {
        match self.hash(record.key, record.place()) {
            Err(Error::Io { source, .. }) if source.kind() == ErrorKind::UnexpectedEof => Ok(false),
            hash => Ok(hash? == record.hash),
        }
    }

    /// Tells whether there is a record of `key` that holds what was written.
    ///
    /// # Errors
    /// As [`Store::is_whole`].
    pub fn has_whole(&self, key: K) -> Result<bool> {
        let record = self.records().known.get(&key).copied();
        record.map_or(Ok(false), |record| self.is_whole(&record))
    }

    /// Returns what has become of the records since this was called last, for the journal.
    pub fn take_changes(&self) -> RecordChanges<K> {
        let mut records = self.records.write().unwrap_or_else(PoisonError::into_inner);
        let mut written: Vec<RecordRef<K>> =
            std::mem::take(&mut records.written).iter().filter_map(|key| records.known.get(key).copied()).collect();
        // The journal must not depend on the order of a hash set.
        written.sort_unstable_by_key(|record| (file_index(record.key), record.at));
        RecordChanges { written, dropped: std::mem::take(&mut records.dropped) }
    }

    /// Waits until all records are on the disk.
    ///
    /// # Errors
    /// [`Error::Io`] if a file cannot be synced.
    pub fn sync(&self) -> Result<()> {
        self.files.iter().try_for_each(|store| disk::sync_data(&store.file).map_err(Error::io("write", &store.path)))
    }

    fn file(&self, key: K) -> &StoreFile {
        &self.files[file_index(key)]
    }

    fn hash(&self, key: K, place: Range<u64>) -> Result<u64> {
        const BLOCK: usize = 1 << 20;
        let mut hasher = hasher(key);
        for at in place.clone().step_by(BLOCK) {
            hasher.update(&self.read::<u8>(key, at, BLOCK.min((place.end - at) as usize))?);
        }
        Ok(hasher.digest())
    }

    /// Writes a record, given in pieces. It replaces an earlier record of the same key.
    pub(crate) fn put(&self, key: K, pieces: &[&[u8]]) -> Result<()> {
        let length = pieces.iter().map(|piece| piece.len() as u64).sum();
        let store = self.file(key);
        let at = store.end.fetch_add(length, Ordering::Relaxed);
        let mut hasher = hasher(key);
        // Small pieces are joined; large ones are written as they are.
        let mut writer = BufWriter::new(WriteFrom { file: &store.file, at });
        let mut write = |piece: &&[u8]| {
            hasher.update(piece);
            writer.write_all(piece)
        };
        let written = pieces.iter().try_for_each(&mut write).and_then(|()| writer.flush());
        written.map_err(Error::io("write", &store.path))?;
        let record = RecordRef { key, at, length, hash: hasher.digest() };
        let mut records = self.records.write().unwrap_or_else(PoisonError::into_inner);
        records.known.insert(key, record);
        records.written.insert(key);
        drop(records);
        let bytes = self.bytes.fetch_add(length, Ordering::Relaxed) + length;
        self.peak.fetch_max(bytes, Ordering::Relaxed);
        Ok(())
    }

    fn records(&self) -> RwLockReadGuard<'_, Records<K>> {
        self.records.read().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns where the record of `key` is.
    pub(crate) fn place(&self, key: K) -> Result<Range<u64>> {
        let record = self.records().known.get(&key).map(RecordRef::place);
        record.ok_or_else(|| Error::Broken(format!("{} has no {key:?}", self.path(key).display())))
    }

    /// Tells whether there is a record of `key`.
    pub fn has(&self, key: K) -> bool {
        self.place(key).is_ok()
    }

    /// Reads `count` values from byte `at` of the file of `key` on.
    pub(crate) fn read<T: Pod>(&self, key: K, at: u64, count: usize) -> Result<Vec<T>> {
        let store = self.file(key);
        let mut values = vec![T::zeroed(); count];
        let bytes = bytemuck::cast_slice_mut(&mut values);
        let outcome = fault::read("read-store").and_then(|()| read_exact_at(&store.file, bytes, at));
        outcome.map_err(Error::io("read", &store.path))?;
        Ok(values)
    }

    /// Gives the record of `key` up, if there is one. Its space goes back to the disk at once, unless the journal knows the record: then
    /// [`Store::give_back`] does it.
    ///
    /// # Errors
    /// [`Error::Io`] if that fails.
    pub fn free(&self, key: K) -> Result<()> {
        let mut records = self.records.write().unwrap_or_else(PoisonError::into_inner);
        let Some(record) = records.known.remove(&key) else { return Ok(()) };
        if records.written.remove(&key) {
            drop(records);
            return self.give_back(&[record]);
        }
        records.dropped.push(record);
        Ok(())
    }

    /// Gives the space of records that were given up back to the disk.
    ///
    /// # Errors
    /// [`Error::Io`] if that fails.
    pub fn give_back(&self, dropped: &[RecordRef<K>]) -> Result<()> {
        for &RecordRef { key, at, length, .. } in dropped {
            let store = self.file(key);
            // Only whole pages can be freed.
            let pages = at.next_multiple_of(PAGE)..(at + length) / PAGE * PAGE;
            let freed = if pages.is_empty() { Ok(0) } else { disk::free(&store.file, &[pages]) };
            self.bytes.fetch_sub(freed.map_err(Error::io("write", &store.path))?, Ordering::Relaxed);
        }
        Ok(())
    }

    /// Returns the most bytes that all records took at any time since the store was opened.
    pub fn peak(&self) -> u64 {
        self.peak.load(Ordering::Relaxed)
    }

    /// Returns the number of bytes of all records that did not go back to the disk.
    pub fn bytes(&self) -> u64 {
        self.bytes.load(Ordering::Relaxed)
    }

    /// Returns the path of the file that the record of `key` is in, or would be in.
    pub fn path(&self, key: K) -> &Path {
        &self.file(key).path
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::durable::columns::{ColumnReader, ColumnWriter};

    #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
    enum Key {
        Leaf(usize),
        Border(usize),
        Seam(usize),
    }

    impl RecordKey for Key {
        fn code(self) -> [u32; 2] {
            match self {
                Key::Leaf(i) => [1, i as u32],
                Key::Border(i) => [2, i as u32],
                Key::Seam(i) => [3, i as u32],
            }
        }
    }

    /// Writes a record and returns it as the journal learns of it.
    fn put(store: &Store<Key>, key: Key, values: &[u32]) -> RecordRef<Key> {
        ColumnWriter::default().push(values).write(store, key).unwrap();
        store.take_changes().written[0]
    }

    fn create(folder: &Path) -> Store<Key> {
        Store::open(paths(folder), []).unwrap()
    }

    fn get(store: &Store<Key>, key: Key) -> Result<Vec<u32>> {
        ColumnReader::open(store, key)?.column()
    }

    fn paths(folder: &Path) -> [PathBuf; STORE_FILES] {
        std::array::from_fn(|file| folder.join(file.to_string()))
    }

    #[test]
    fn records_are_dealt_out_to_all_files() {
        let folder = tempfile::tempdir().unwrap();
        let store = create(folder.path());
        (0..STORE_FILES).for_each(|tile| _ = put(&store, Key::Leaf(tile), &[1]));
        let lengths = paths(folder.path()).map(|path| path.metadata().unwrap().len());
        // The number of values, one value, and twelve bytes of padding.
        assert_eq!(lengths, [32; STORE_FILES]);
        assert_eq!(store.bytes(), 32 * STORE_FILES as u64);
    }

    #[test]
    fn columns_of_any_length_and_type_come_back() {
        let folder = tempfile::tempdir().unwrap();
        let store = create(folder.path());
        for length in [0, 1, 2, 3, 5, 10_000, 30_001] {
            let (bytes, words): (Vec<u8>, Vec<u128>) = (0..length).map(|i| (i as u8, i as u128 * 3)).unzip();
            let triples: Vec<[u16; 3]> = (0..length).map(|i| [i as u16; 3]).collect();
            let writer = ColumnWriter::default().push(&bytes).push(&words).push(&triples);
            writer.write(&store, Key::Leaf(0)).unwrap();
            let mut columns = ColumnReader::open(&store, Key::Leaf(0)).unwrap();
            assert_eq!(columns.column::<u8>().unwrap(), bytes);
            assert_eq!(*columns.column::<u128>().unwrap(), words);
            if length > 2 {
                assert_eq!(*columns.column_part::<[u16; 3]>(2, length as usize - 2).unwrap(), triples[2..]);
            } else {
                assert!(columns.column_part::<[u16; 3]>(2, 1).is_err());
            }
        }
    }

    #[test]
    fn a_record_that_is_cut_or_changed_is_not_whole() {
        let folder = tempfile::tempdir().unwrap();
        let paths = paths(folder.path());
        let store = create(folder.path());
        // One after the other in one file.
        let key = |i: usize| Key::Leaf(3 + i * STORE_FILES);
        let stored: Vec<RecordRef<Key>> = (0..4).map(|i| put(&store, key(i), &vec![7; 5 * i])).collect();
        let path = &paths[3];
        let whole = std::fs::read(path).unwrap();
        for (at, _) in whole.iter().enumerate() {
            let mut changed = whole.clone();
            changed[at] ^= 0x40;
            for (content, cut) in [(&whole[..at], true), (&changed, false)] {
                std::fs::write(path, content).unwrap();
                let store = Store::open(paths.clone(), stored.clone()).unwrap();
                for record in &stored {
                    let end = record.at + record.length;
                    let is_hit = if cut { end > at as u64 } else { (record.at..end).contains(&(at as u64)) };
                    assert_eq!(store.is_whole(record).unwrap(), !is_hit, "{record:?}, byte {at}, cut: {cut}");
                }
            }
        }
    }

    #[test]
    fn an_opened_store_has_the_records_it_is_told_of_and_appends_after_them() {
        let folder = tempfile::tempdir().unwrap();
        let paths = paths(folder.path());
        let store = create(folder.path());
        let kept = put(&store, Key::Border(0), &[1, 2, 3]);
        put(&store, Key::Border(1), &[4, 5, 6]);
        let store = Store::open(paths.clone(), [kept]).unwrap();
        assert!(store.place(Key::Border(0)).is_ok() && store.place(Key::Border(1)).is_err());
        let added = put(&store, Key::Seam(7), &[8]);
        let store = Store::open(paths.clone(), [kept, added]).unwrap();
        assert_eq!(
            (get(&store, Key::Border(0)).unwrap(), get(&store, Key::Seam(7)).unwrap()),
            (vec![1, 2, 3], vec![8])
        );
        let other = RecordRef { key: Key::Border(1), ..kept };
        assert!(store.is_whole(&kept).unwrap() && !store.is_whole(&other).unwrap(), "the hash depends on the key");
    }

    #[test]
    fn the_journal_is_told_of_each_change_once() {
        let folder = tempfile::tempdir().unwrap();
        let store = create(folder.path());
        let write = |key, value| ColumnWriter::default().push(&vec![value; 5_000]).write(&store, key).unwrap();
        [Key::Leaf(0), Key::Leaf(1), Key::Leaf(2)].into_iter().zip(1u32..).for_each(|(key, value)| write(key, value));
        // What the journal never knew goes at once.
        store.free(Key::Leaf(1)).unwrap();
        let keys = |records: &[RecordRef<Key>]| records.iter().map(RecordRef::key).collect::<Vec<_>>();
        let RecordChanges { written, dropped } = store.take_changes();
        assert_eq!((keys(&written), keys(&dropped)), (vec![Key::Leaf(0), Key::Leaf(2)], vec![]));
        store.free(Key::Leaf(0)).unwrap();
        assert!(!store.has(Key::Leaf(0)));
        assert!(store.is_whole(&written[0]).unwrap(), "its bytes are there until the journal knows");
        write(Key::Seam(0), 9);
        let RecordChanges { written: added, dropped } = store.take_changes();
        assert_eq!((keys(&added), keys(&dropped)), (vec![Key::Seam(0)], vec![Key::Leaf(0)]));
        store.give_back(&dropped).unwrap();
        assert_eq!(store.is_whole(&written[0]).unwrap(), cfg!(not(target_os = "linux")));
        let RecordChanges { written, dropped } = store.take_changes();
        assert!(written.is_empty() && dropped.is_empty());
    }

    #[test]
    fn a_later_record_replaces_an_earlier_one() {
        let folder = tempfile::tempdir().unwrap();
        let paths = paths(folder.path());
        let store = create(folder.path());
        let stored = [put(&store, Key::Border(3), &[1]), put(&store, Key::Border(3), &[2, 3])];
        assert_eq!(get(&store, Key::Border(3)).unwrap(), [2, 3]);
        assert_eq!(get(&Store::open(paths.clone(), stored).unwrap(), Key::Border(3)).unwrap(), [2, 3]);
        assert!(get(&store, Key::Border(4)).unwrap_err().to_string().contains("Border(4)"));
    }
}
