//! The store: what steps leave for later steps, one record for each result, in a few files that only grow, until the space of records
//! that no step needs any more is given back to the disk.
//!
//! Not one file for each result: creating and removing thousands of small files takes a large part of a job's time on common file
//! systems. Not one file for all: threads would wait for each other while they write, and one thread would free the whole file at
//! the end while the others idle.
//!
//! The journal knows where each record is and the hash of its bytes. So a store can be opened again after a kill, whatever the kill
//! left behind the last known record.

use crate::durable::directory::STORE_FILES;
use crate::durable::mapped::MappedSlice;
use bytemuck::Pod;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::fmt::Debug;
use std::fs::File;
use std::hash::Hash;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{PoisonError, RwLock};
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

/// Where the bytes of a record are in its file.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RecordPlace {
    pub(crate) at: u64,
    pub(crate) length: u64,
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
}

/// The results of all steps of a job, on disk. Several threads may write and read at the same time.
#[derive(Debug)]
pub struct Store<K> {
    files: Vec<StoreFile>,
    places: RwLock<HashMap<K, RecordPlace>>,
}

#[derive(Debug)]
struct StoreFile {
    path: PathBuf,
    file: File,
    end: AtomicU64,
    /// The bytes that were given back to the disk.
    freed: AtomicU64,
}

impl<K: RecordKey> Store<K> {
    /// Creates an empty store in files at `paths`.
    ///
    /// # Errors
    /// [`Error::Io`] if a file cannot be made.
    pub fn create(paths: [PathBuf; STORE_FILES]) -> Result<Store<K>> {
        let create = |path: PathBuf| {
            let file = disk::create(&path).map_err(Error::io("create", &path))?;
            Ok(StoreFile { file, path, end: AtomicU64::new(0), freed: AtomicU64::new(0) })
        };
        let files = paths.into_iter().map(create).collect::<Result<_>>()?;
        Ok(Store { files, places: RwLock::default() })
    }

    /// Opens the store in the files at `paths` with the given records; new records overwrite everything else in it.
    ///
    /// # Errors
    /// [`Error::Io`] if a file cannot be opened.
    pub fn open<'a>(paths: [PathBuf; STORE_FILES], records: impl Iterator<Item = &'a RecordRef<K>>) -> Result<Store<K>>
    where
        K: 'a,
    {
        let (mut ends, mut places) = ([0; STORE_FILES], HashMap::new());
        for &RecordRef { key, at, length, .. } in records {
            places.insert(key, RecordPlace { at, length });
            let end = &mut ends[file_index(key)];
            *end = (at + length).max(*end);
        }
        let open = |(path, end): (PathBuf, u64)| {
            // If a file is missing, only its own records are lost.
            let file = disk::open_or_create(&path).map_err(Error::io("open", &path))?;
            Ok(StoreFile { path, file, end: AtomicU64::new(end), freed: AtomicU64::new(0) })
        };
        let files = paths.into_iter().zip(ends).map(open).collect::<Result<_>>()?;
        Ok(Store { files, places: RwLock::new(places) })
    }

    /// Tells whether the record is there and holds what was written.
    pub fn is_whole(&self, record: &RecordRef<K>) -> bool {
        let place = RecordPlace { at: record.at, length: record.length };
        self.hash(record.key, place).is_ok_and(|hash| hash == record.hash)
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

    fn hash(&self, key: K, place: RecordPlace) -> Result<u64> {
        const BLOCK: u64 = 1 << 20;
        let mut hasher = hasher(key);
        let mut done = 0;
        while done < place.length {
            let block = self.read::<u8>(key, place.at + done, (place.length - done).min(BLOCK) as usize)?;
            hasher.update(&block);
            done += block.len() as u64;
        }
        Ok(hasher.digest())
    }

    /// Writes a record, given in pieces. It replaces an earlier record of the same key.
    pub(crate) fn put(&self, key: K, pieces: &[&[u8]]) -> Result<RecordRef<K>> {
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
        let mut places = self.places.write().unwrap_or_else(PoisonError::into_inner);
        places.insert(key, RecordPlace { at, length });
        Ok(RecordRef { key, at, length, hash: hasher.digest() })
    }

    /// Returns where the record of `key` is.
    pub(crate) fn place(&self, key: K) -> Result<RecordPlace> {
        let places = self.places.read().unwrap_or_else(PoisonError::into_inner);
        places.get(&key).copied().ok_or_else(|| Error::Broken(format!("{} has no {key:?}", self.path(key).display())))
    }

    /// Tells whether there is a record of `key`.
    pub fn has(&self, key: K) -> bool {
        self.place(key).is_ok()
    }

    /// Returns the bytes of the record of `key`; 0 if there is none.
    pub fn length(&self, key: K) -> u64 {
        self.place(key).map_or(0, |place| place.length)
    }

    /// Reads `count` values from byte `at` of the file of `key` on.
    pub(crate) fn read<T: Pod>(&self, key: K, at: u64, count: usize) -> Result<MappedSlice<'static, T>> {
        let store = self.file(key);
        let outcome = fault::read("read-store").and_then(|()| MappedSlice::read(&store.file, at, count));
        outcome.map_err(Error::io("read", &store.path))
    }

    /// Reads `count` values from byte `at` of the file of `key` on into memory of the caller's own.
    pub(crate) fn read_vec<T: Pod>(&self, key: K, at: u64, count: usize) -> Result<Vec<T>> {
        let store = self.file(key);
        let mut values = vec![T::zeroed(); count];
        let bytes = bytemuck::cast_slice_mut(&mut values);
        let outcome = fault::read("read-store").and_then(|()| read_exact_at(&store.file, bytes, at));
        outcome.map_err(Error::io("read", &store.path))?;
        Ok(values)
    }

    /// Gives the space of the record of `key` back to the disk. From then on there is no such record.
    ///
    /// # Errors
    /// [`Error::Io`] if that fails.
    pub fn free(&self, key: K) -> Result<()> {
        let place = self.places.write().unwrap_or_else(PoisonError::into_inner).remove(&key);
        let Some(RecordPlace { at, length }) = place else { return Ok(()) };
        let store = self.file(key);
        // Only whole pages can be freed.
        let pages = at.next_multiple_of(PAGE)..(at + length) / PAGE * PAGE;
        let freed = if pages.is_empty() { Ok(0) } else { disk::free(&store.file, &[pages]) };
        store.freed.fetch_add(freed.map_err(Error::io("write", &store.path))?, Ordering::Relaxed);
        Ok(())
    }

    /// Returns the number of bytes of all records that were not freed.
    pub fn bytes(&self) -> u64 {
        let bytes = |store: &StoreFile| store.end.load(Ordering::Relaxed) - store.freed.load(Ordering::Relaxed);
        self.files.iter().map(bytes).sum()
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

    fn put(store: &Store<Key>, key: Key, values: &[u32]) -> RecordRef<Key> {
        ColumnWriter::default().push(values).write(store, key).unwrap()
    }

    fn get(store: &Store<Key>, key: Key) -> Result<Vec<u32>> {
        Ok(ColumnReader::open(store, key)?.column()?.to_vec())
    }

    fn paths(folder: &Path) -> [PathBuf; STORE_FILES] {
        std::array::from_fn(|file| folder.join(file.to_string()))
    }

    #[test]
    fn records_are_dealt_out_to_all_files() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::create(paths(folder.path())).unwrap();
        (0..STORE_FILES).for_each(|tile| _ = put(&store, Key::Leaf(tile), &[1]));
        let lengths = paths(folder.path()).map(|path| path.metadata().unwrap().len());
        // The number of values, one value, and twelve bytes of padding.
        assert_eq!(lengths, [32; STORE_FILES]);
        assert_eq!(store.bytes(), 32 * STORE_FILES as u64);
    }

    #[test]
    fn columns_of_any_length_and_type_come_back() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::<Key>::create(paths(folder.path())).unwrap();
        for length in [0, 1, 2, 3, 5, 10_000, 30_001] {
            let (bytes, words): (Vec<u8>, Vec<u128>) = (0..length).map(|i| (i as u8, i as u128 * 3)).unzip();
            let triples: Vec<[u16; 3]> = (0..length).map(|i| [i as u16; 3]).collect();
            let writer = ColumnWriter::default().push(&bytes).push(&words).push(&triples);
            writer.write(&store, Key::Leaf(0)).unwrap();
            let mut columns = ColumnReader::open(&store, Key::Leaf(0)).unwrap();
            assert_eq!(columns.column_vec::<u8>().unwrap(), bytes);
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
        let store = Store::create(paths.clone()).unwrap();
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
                let store = Store::open(paths.clone(), stored.iter()).unwrap();
                for record in &stored {
                    let end = record.at + record.length;
                    let is_hit = if cut { end > at as u64 } else { (record.at..end).contains(&(at as u64)) };
                    assert_eq!(store.is_whole(record), !is_hit, "{record:?}, byte {at}, cut: {cut}");
                }
            }
        }
    }

    #[test]
    fn an_opened_store_has_the_records_it_is_told_of_and_appends_after_them() {
        let folder = tempfile::tempdir().unwrap();
        let paths = paths(folder.path());
        let store = Store::create(paths.clone()).unwrap();
        let kept = put(&store, Key::Border(0), &[1, 2, 3]);
        put(&store, Key::Border(1), &[4, 5, 6]);
        let store = Store::open(paths.clone(), [kept].iter()).unwrap();
        assert!(store.place(Key::Border(0)).is_ok() && store.place(Key::Border(1)).is_err());
        let added = put(&store, Key::Seam(7), &[8]);
        let store = Store::open(paths.clone(), [kept, added].iter()).unwrap();
        assert_eq!(
            (get(&store, Key::Border(0)).unwrap(), get(&store, Key::Seam(7)).unwrap()),
            (vec![1, 2, 3], vec![8])
        );
        let other = RecordRef { key: Key::Border(1), ..kept };
        assert!(store.is_whole(&kept) && !store.is_whole(&other), "the hash depends on the key");
    }

    #[test]
    fn a_later_record_replaces_an_earlier_one() {
        let folder = tempfile::tempdir().unwrap();
        let paths = paths(folder.path());
        let store = Store::create(paths.clone()).unwrap();
        let stored = [put(&store, Key::Border(3), &[1]), put(&store, Key::Border(3), &[2, 3])];
        assert_eq!(get(&store, Key::Border(3)).unwrap(), [2, 3]);
        assert_eq!(get(&Store::open(paths.clone(), stored.iter()).unwrap(), Key::Border(3)).unwrap(), [2, 3]);
        assert!(get(&store, Key::Border(4)).unwrap_err().to_string().contains("Border(4)"));
    }
}
