//! Map tiles, in a file of their own until the archive is put together.

use crate::durable::atomic_file::{PendingFile, PendingWriter};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use sys::positional_io::read_exact_at;
use sys::{Error, Result, disk, fault, interrupt};
use tiles::checksums::Checksum;
use tiles::map_tiles::archive::{ArchiveAbout, WaitingTile, head};
use tiles::map_tiles::tile_id::MapTile;

/// The tiles that are finished. Threads may add tiles in any order.
pub(crate) struct WaitingTiles {
    path: PathBuf,
    file: File,
    places: Mutex<Places>,
}

#[derive(Default)]
struct Places {
    /// The bytes in the file.
    end: u64,
    /// The tiles, and where each is in the file.
    tiles: Vec<(WaitingTile, u64)>,
}

impl WaitingTiles {
    /// Makes the file at `path`.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn create(path: &Path) -> Result<WaitingTiles> {
        let file = disk::create(path).map_err(Error::io("create", path))?;
        Ok(WaitingTiles { path: path.into(), file, places: Mutex::default() })
    }

    /// Adds a tile.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn add(&self, tile: MapTile, bytes: &[u8]) -> Result<()> {
        let waiting = WaitingTile { id: tile.id(), length: bytes.len() as u32, checksum: Checksum::of(bytes).number() };
        let mut places = self.places.lock().unwrap_or_else(PoisonError::into_inner);
        let at = places.end;
        places.end += bytes.len() as u64;
        places.tiles.push((waiting, at));
        drop(places);
        disk::write_all_at(&self.file, bytes, at).map_err(Error::io("write", &self.path))
    }

    /// Writes the archive as the pending file of `path`, and removes the waiting tiles. Returns the number of tiles too.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Interrupted`].
    pub(crate) fn write(self, about: &ArchiveAbout, path: &Path) -> Result<(u64, PendingFile)> {
        let mut tiles = self.places.into_inner().unwrap_or_else(PoisonError::into_inner).tiles;
        tiles.sort_unstable_by_key(|(tile, _)| tile.id);
        let waiting: Vec<WaitingTile> = tiles.iter().map(|(tile, _)| *tile).collect();
        let head = head(&waiting, about);
        let mut out = PendingWriter::create(path)?;
        out.write(&head.bytes)?;
        let mut bytes = Vec::new();
        for (tile, at) in head.stored.iter().map(|n| tiles[*n]) {
            interrupt::check()?;
            bytes.resize(tile.length as usize, 0);
            let read = fault::read("read-result").and_then(|()| read_exact_at(&self.file, &mut bytes, at));
            read.map_err(Error::io("read", &self.path))?;
            out.write(&bytes)?;
        }
        let archive = out.finish()?;
        drop(self.file);
        disk::remove_file(&self.path).map_err(Error::io("remove", &self.path))?;
        Ok((tiles.len() as u64, archive))
    }
}
