//! What the steps leave for each other: a few files that only grow, a record a result. A file a result would cost more than
//! the results: making and removing thousands of small files takes a good part of a job's time on common file systems. With one
//! file for all, threads would wait for each other where they write, and one would remove it at the end while the others idle.
//!
//! The journal knows where in its file each record is and the hash of its bytes, so that a store whose writer was killed can be
//! opened again, whatever the kill left after them.

use crate::positional_io::{read_exact_at, write_all_at};
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{PoisonError, RwLock};
use xxhash_rust::xxh3::Xxh3;

/// What a record holds; it is a tile's or a node's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
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
    /// What `tileset.json` will say of an exact tile.
    Tile(usize),
    /// What the steps after the partition know of it.
    Partition,
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
            Key::Partition => [7, 0],
            Key::Level(i) => [8, i as u32],
            Key::Tile(i) => [9, i as u32],
        }
    }

    /// The number of the file that has its record.
    fn part(self) -> usize {
        self.code()[1] as usize % Store::PARTS
    }
}

fn seed(code: [u32; 2]) -> u64 {
    (code[0] as u64) << 32 | code[1] as u64
}

/// Where in the key's file a record's bytes are.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    pub(crate) at: u64,
    pub(crate) length: u64,
}

/// A record as the journal knows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stored {
    /// What it holds.
    key: Key,
    /// Where its bytes begin in the key's file, and how many they are.
    at: u64,
    length: u64,
    hash: u64,
}

/// Writes to a file from a place on, whatever others do with the file.
struct WriteFrom<'a> {
    file: &'a File,
    at: u64,
}

impl Write for WriteFrom<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        write_all_at(self.file, bytes, self.at)?;
        self.at += bytes.len() as u64;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// The results of all steps of a job, on disk; threads may write and read at once.
#[derive(Debug)]
pub struct Store {
    parts: Vec<Part>,
    places: RwLock<HashMap<Key, Place>>,
}

/// One of the files.
#[derive(Debug)]
struct Part {
    path: PathBuf,
    file: File,
    end: AtomicU64,
}

impl Store {
    /// Into how many files records are dealt out.
    pub const PARTS: usize = 8;

    /// An empty store in files at `paths`.
    ///
    /// # Errors
    /// [`Error::Io`] if they cannot be made.
    pub fn create(paths: [PathBuf; Store::PARTS]) -> Result<Store> {
        let part = |path: PathBuf| {
            let file = File::options().read(true).write(true).create(true).truncate(true).open(&path);
            Ok(Part { file: file.map_err(Error::io("create", &path))?, path, end: AtomicU64::new(0) })
        };
        let parts = paths.into_iter().map(part).collect::<Result<_>>()?;
        Ok(Store { parts, places: RwLock::default() })
    }

    /// The store in the files at `paths` with the records of `stored`; all else in it is written over.
    ///
    /// # Errors
    /// [`Error::Io`] if one cannot be opened.
    pub fn open<'a>(paths: [PathBuf; Store::PARTS], stored: impl Iterator<Item = &'a Stored>) -> Result<Store> {
        let (mut ends, mut places) = ([0; Store::PARTS], HashMap::new());
        for &Stored { key, at, length, .. } in stored {
            places.insert(key, Place { at, length });
            let end = &mut ends[key.part()];
            *end = (at + length).max(*end);
        }
        let part = |(path, end): (PathBuf, u64)| {
            // One that is gone has lost its records, and no others.
            let file = File::options().read(true).write(true).create(true).truncate(false).open(&path);
            let file = file.map_err(Error::io("open", &path))?;
            Ok(Part { path, file, end: AtomicU64::new(end) })
        };
        let parts = paths.into_iter().zip(ends).map(part).collect::<Result<_>>()?;
        Ok(Store { parts, places: RwLock::new(places) })
    }

    /// Whether the record of `stored` is there and holds what was written to it.
    pub fn is_whole(&self, stored: &Stored) -> bool {
        let place = Place { at: stored.at, length: stored.length };
        self.hash(stored.key, place).is_ok_and(|hash| hash == stored.hash)
    }

    /// Waits until all records are on the disk.
    ///
    /// # Errors
    /// [`Error::Io`] if they do not get there.
    pub fn sync(&self) -> Result<()> {
        self.parts.iter().try_for_each(|part| part.file.sync_data().map_err(Error::io("write", &part.path)))
    }

    fn part(&self, key: Key) -> &Part {
        &self.parts[key.part()]
    }

    fn hash(&self, key: Key, place: Place) -> Result<u64> {
        let mut hasher = Xxh3::with_seed(seed(key.code()));
        let mut buffer = vec![0; place.length.min(1 << 20) as usize];
        let mut done = 0;
        while done < place.length {
            let part = &mut buffer[..(place.length - done).min(1 << 20) as usize];
            self.read(key, place.at + done, part)?;
            hasher.update(part);
            done += part.len() as u64;
        }
        Ok(hasher.digest())
    }

    /// Writes a record, given in pieces. It takes the place of an earlier one of the same key.
    pub(crate) fn put(&self, key: Key, pieces: &[&[u8]]) -> Result<Stored> {
        let length = pieces.iter().map(|piece| piece.len() as u64).sum();
        let part = self.part(key);
        let at = part.end.fetch_add(length, Ordering::Relaxed);
        let mut hasher = Xxh3::with_seed(seed(key.code()));
        // Small pieces are joined, large ones written as they are.
        let mut writer = BufWriter::new(WriteFrom { file: &part.file, at });
        let mut write = |piece: &&[u8]| {
            hasher.update(piece);
            writer.write_all(piece)
        };
        let written = pieces.iter().try_for_each(&mut write).and_then(|()| writer.flush());
        written.map_err(Error::io("write", &part.path))?;
        let mut places = self.places.write().unwrap_or_else(PoisonError::into_inner);
        places.insert(key, Place { at, length });
        Ok(Stored { key, at, length, hash: hasher.digest() })
    }

    /// Whether there is a record of `key`.
    pub fn has(&self, key: Key) -> bool {
        self.places.read().unwrap_or_else(PoisonError::into_inner).contains_key(&key)
    }

    /// Where the record of `key` is.
    pub(crate) fn place(&self, key: Key) -> Result<Place> {
        let places = self.places.read().unwrap_or_else(PoisonError::into_inner);
        places.get(&key).copied().ok_or_else(|| Error::Broken(format!("{} has no {key:?}", self.path(key).display())))
    }

    /// Fills `buffer` from byte `at` of the file of `key` on.
    pub(crate) fn read(&self, key: Key, at: u64, buffer: &mut [u8]) -> Result<()> {
        let part = self.part(key);
        read_exact_at(&part.file, buffer, at).map_err(Error::io("read", &part.path))
    }

    /// The bytes of all records.
    pub fn bytes(&self) -> u64 {
        self.parts.iter().map(|part| part.end.load(Ordering::Relaxed)).sum()
    }

    /// The file where the record of `key` is, or would be.
    pub fn path(&self, key: Key) -> &Path {
        &self.part(key).path
    }
}

#[cfg(test)]
mod tests {
    use super::super::columns::{ColumnReader, ColumnWriter};
    use super::*;

    fn put(store: &Store, key: Key, values: &[u32]) -> Stored {
        ColumnWriter::default().push(values).write(store, key).unwrap()
    }

    fn get(store: &Store, key: Key) -> Result<Vec<u32>> {
        ColumnReader::open(store, key)?.column()
    }

    fn paths(folder: &Path) -> [PathBuf; Store::PARTS] {
        std::array::from_fn(|part| folder.join(part.to_string()))
    }

    #[test]
    fn records_are_dealt_out_to_all_files() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::create(paths(folder.path())).unwrap();
        (0..Store::PARTS).for_each(|tile| _ = put(&store, Key::Leaf(tile), &[1]));
        let lengths = paths(folder.path()).map(|path| path.metadata().unwrap().len());
        assert_eq!(lengths, [12; Store::PARTS]);
        assert_eq!(store.bytes(), 12 * Store::PARTS as u64);
    }

    #[test]
    fn a_record_that_is_cut_or_changed_is_not_whole() {
        let folder = tempfile::tempdir().unwrap();
        let paths = paths(folder.path());
        let store = Store::create(paths.clone()).unwrap();
        // One after the other in one file.
        let key = |i: usize| Key::Leaf(3 + i * Store::PARTS);
        let stored: Vec<Stored> = (0..4).map(|i| put(&store, key(i), &vec![7; 5 * i])).collect();
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
    fn an_opened_store_has_what_it_is_told_and_goes_on_after_it() {
        let folder = tempfile::tempdir().unwrap();
        let paths = paths(folder.path());
        let store = Store::create(paths.clone()).unwrap();
        let kept = put(&store, Key::Rim(0), &[1, 2, 3]);
        put(&store, Key::Rim(1), &[4, 5, 6]);
        let store = Store::open(paths.clone(), [kept].iter()).unwrap();
        assert!(store.has(Key::Rim(0)) && !store.has(Key::Rim(1)));
        let added = put(&store, Key::Seam(7), &[8]);
        let store = Store::open(paths.clone(), [kept, added].iter()).unwrap();
        assert_eq!((get(&store, Key::Rim(0)).unwrap(), get(&store, Key::Seam(7)).unwrap()), (vec![1, 2, 3], vec![8]));
        let other = Stored { key: Key::Rim(1), ..kept };
        assert!(store.is_whole(&kept) && !store.is_whole(&other), "the hash is that of the key as well");
    }

    #[test]
    fn a_later_record_takes_the_place_of_an_earlier_one() {
        let folder = tempfile::tempdir().unwrap();
        let paths = paths(folder.path());
        let store = Store::create(paths.clone()).unwrap();
        let stored = [put(&store, Key::Frontier(3), &[1]), put(&store, Key::Frontier(3), &[2, 3])];
        assert_eq!(get(&store, Key::Frontier(3)).unwrap(), [2, 3]);
        assert_eq!(get(&Store::open(paths.clone(), stored.iter()).unwrap(), Key::Frontier(3)).unwrap(), [2, 3]);
        assert!(get(&store, Key::Frontier(4)).unwrap_err().to_string().contains("Frontier(4)"));
    }
}
