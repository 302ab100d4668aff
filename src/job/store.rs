//! What the steps leave for each other: one file that only grows, a record a result. A file a result would cost more than
//! the results: making and removing thousands of small files takes a good part of a job's time on common file systems.
//!
//! A record says what it is, how long it is, and the hash of its bytes, so that a store whose writer was killed can be
//! opened again: it ends with the last record that is whole.

use crate::positioned::{read_exact_at, write_all_at};
use crate::{Error, Result};
use bytemuck::{Pod, Zeroable};
use std::collections::HashMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{PoisonError, RwLock};
use xxhash_rust::xxh3::{Xxh3, xxh3_64_with_seed};

/// What a record holds; it is a tile's or a node's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Key {
    /// The sites and closed triangles of a tile.
    Leaf(usize),
    /// What a tree node hands to its parent.
    Frontier(usize),
    /// The frontier of a tile as far as its leaf knows it.
    RimDraft(usize),
    /// The triangles that an inner node contributes.
    Seam(usize),
    /// The finished rim vertices of a tile.
    Rim(usize),
    /// The pixels of the preview that a tile covers.
    Pixels(usize),
    /// What `tileset.json` will say of the coarser tile at a tree node.
    Level(usize),
}

impl Key {
    fn code(self) -> [u32; 2] {
        match self {
            Key::Leaf(i) => [1, i as u32],
            Key::Frontier(i) => [2, i as u32],
            Key::RimDraft(i) => [3, i as u32],
            Key::Seam(i) => [4, i as u32],
            Key::Rim(i) => [5, i as u32],
            Key::Pixels(i) => [6, i as u32],
            Key::Level(i) => [7, i as u32],
        }
    }

    fn of_code([kind, index]: [u32; 2]) -> Option<Key> {
        let kinds = [Key::Leaf, Key::Frontier, Key::RimDraft, Key::Seam, Key::Rim, Key::Pixels, Key::Level];
        kinds.get((kind as usize).checked_sub(1)?).map(|key| key(index as usize))
    }
}

/// The head of a record in the file.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Head {
    code: [u32; 2],
    /// Bytes after the head.
    length: u64,
    /// Of these bytes, seeded with the code.
    hash: u64,
}

/// Room for the head at the front of a record.
pub(super) const HEAD: usize = size_of::<Head>();

fn seed(code: [u32; 2]) -> u64 {
    (code[0] as u64) << 32 | code[1] as u64
}

/// Where a record's bytes are.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub(super) at: u64,
    pub(super) length: u64,
}

/// The results of all steps of a job, on disk; threads may write and read at once.
#[derive(Debug)]
pub struct Store {
    path: PathBuf,
    pub(super) file: File,
    end: AtomicU64,
    places: RwLock<HashMap<Key, Place>>,
}

impl Store {
    /// An empty store at `path`.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be made.
    pub fn create(path: &Path) -> Result<Store> {
        let file = File::options().read(true).write(true).create(true).truncate(true).open(path);
        let file = file.map_err(Error::io("create", path))?;
        Ok(Store { path: path.to_path_buf(), file, end: AtomicU64::new(0), places: RwLock::default() })
    }

    /// The store at `path` as far as it is whole; what comes after is written over.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be read.
    pub fn open(path: &Path) -> Result<Store> {
        let file = File::options().read(true).write(true).open(path).map_err(Error::io("open", path))?;
        let size = file.metadata().map_err(Error::io("read", path))?.len();
        let mut store = Store { path: path.to_path_buf(), file, end: AtomicU64::new(0), places: RwLock::default() };
        let (mut end, mut places) = (0, HashMap::new());
        while let Some((key, place)) = store.whole_record(end, size)? {
            places.insert(key, place);
            end = place.at + place.length;
        }
        (store.end, store.places) = (AtomicU64::new(end), RwLock::new(places));
        Ok(store)
    }

    /// The record whose head is at `at`, if it is whole and in a file of `size` bytes.
    fn whole_record(&self, at: u64, size: u64) -> Result<Option<(Key, Place)>> {
        let place = Place { at: at + HEAD as u64, length: 0 };
        if place.at > size {
            return Ok(None);
        }
        let mut head = Head::zeroed();
        self.read(at, bytemuck::bytes_of_mut(&mut head))?;
        match Key::of_code(head.code) {
            Some(key) if head.length <= size - place.at => {
                let place = Place { length: head.length, ..place };
                Ok((self.hash(place, seed(head.code))? == head.hash).then_some((key, place)))
            }
            _ => Ok(None),
        }
    }

    fn hash(&self, place: Place, seed: u64) -> Result<u64> {
        let mut hasher = Xxh3::with_seed(seed);
        let mut buffer = vec![0; place.length.min(1 << 20) as usize];
        let mut done = 0;
        while done < place.length {
            let part = &mut buffer[..(place.length - done).min(1 << 20) as usize];
            self.read(place.at + done, part)?;
            hasher.update(part);
            done += part.len() as u64;
        }
        Ok(hasher.digest())
    }

    /// Writes a record: `bytes` begin with [`HEAD`] bytes of room for its head. It takes the place of an earlier one of
    /// the same key.
    pub(super) fn put(&self, key: Key, bytes: &mut [u8]) -> Result<()> {
        let (head, content) = bytes.split_at_mut(HEAD);
        let (code, length) = (key.code(), content.len() as u64);
        let hash = xxh3_64_with_seed(content, seed(code));
        head.copy_from_slice(bytemuck::bytes_of(&Head { code, length, hash }));
        let at = self.end.fetch_add(bytes.len() as u64, Ordering::Relaxed);
        write_all_at(&self.file, bytes, at).map_err(Error::io("write", &self.path))?;
        let mut places = self.places.write().unwrap_or_else(PoisonError::into_inner);
        places.insert(key, Place { at: at + HEAD as u64, length });
        Ok(())
    }

    /// Whether there is a record of `key`.
    pub fn has(&self, key: Key) -> bool {
        self.places.read().unwrap_or_else(PoisonError::into_inner).contains_key(&key)
    }

    /// Where the record of `key` is.
    pub(super) fn place(&self, key: Key) -> Result<Place> {
        let places = self.places.read().unwrap_or_else(PoisonError::into_inner);
        places.get(&key).copied().ok_or_else(|| Error::Broken(format!("{} has no {key:?}", self.path.display())))
    }

    /// Fills `buffer` from byte `at` of the file on.
    pub(super) fn read(&self, at: u64, buffer: &mut [u8]) -> Result<()> {
        read_exact_at(&self.file, buffer, at).map_err(Error::io("read", &self.path))
    }

    /// The bytes of all records.
    pub fn bytes(&self) -> u64 {
        self.end.load(Ordering::Relaxed)
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

#[cfg(test)]
mod tests {
    use super::super::columns::{ColumnReader, ColumnWriter};
    use super::*;

    fn put(store: &Store, key: Key, values: &[u32]) {
        ColumnWriter::default().push(values).write(store, key).unwrap();
    }

    fn get(store: &Store, key: Key) -> Result<Vec<u32>> {
        ColumnReader::open(store, key)?.column()
    }

    #[test]
    fn a_store_cut_anywhere_opens_with_the_records_before_the_cut() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("steps");
        let store = Store::create(&path).unwrap();
        let ends: Vec<u64> = (0..4)
            .map(|tile| {
                put(&store, Key::Leaf(tile), &vec![tile as u32; 5 * tile]);
                store.bytes()
            })
            .collect();
        let whole = std::fs::read(&path).unwrap();
        for cut in 0..=whole.len() {
            std::fs::write(&path, &whole[..cut]).unwrap();
            let store = Store::open(&path).unwrap();
            let left = ends.iter().filter(|&&end| end <= cut as u64).count();
            assert_eq!((0..4).filter(|&tile| store.has(Key::Leaf(tile))).count(), left, "cut at {cut}");
            put(&store, Key::Seam(7), &[7]);
            let store = Store::open(&path).unwrap();
            assert_eq!(get(&store, Key::Seam(7)).unwrap(), [7]);
            assert_eq!(store.has(Key::Leaf(0)), left > 0);
        }
    }

    #[test]
    fn a_changed_byte_ends_the_store_before_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("steps");
        let store = Store::create(&path).unwrap();
        put(&store, Key::Rim(0), &[1, 2, 3]);
        let first = store.bytes();
        put(&store, Key::Rim(1), &[4, 5, 6]);
        let whole = std::fs::read(&path).unwrap();
        for at in first as usize..whole.len() {
            let mut changed = whole.clone();
            changed[at] ^= 0x40;
            std::fs::write(&path, changed).unwrap();
            let store = Store::open(&path).unwrap();
            assert_eq!(get(&store, Key::Rim(0)).unwrap(), [1, 2, 3]);
            assert!(!store.has(Key::Rim(1)), "byte {at}");
        }
    }

    #[test]
    fn a_later_record_takes_the_place_of_an_earlier_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("steps");
        let store = Store::create(&path).unwrap();
        put(&store, Key::Frontier(3), &[1]);
        put(&store, Key::Frontier(3), &[2, 3]);
        assert_eq!(get(&store, Key::Frontier(3)).unwrap(), [2, 3]);
        assert_eq!(get(&Store::open(&path).unwrap(), Key::Frontier(3)).unwrap(), [2, 3]);
        assert!(get(&store, Key::Frontier(4)).unwrap_err().to_string().contains("Frontier(4)"));
    }
}
