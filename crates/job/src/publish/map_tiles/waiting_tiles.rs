//! Map tiles, in a file of their own until the archive is put together.

use crate::durable::atomic_file::{PendingFile, PendingWriter};
use crate::durable::waiting_file::WaitingFile;
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use sys::{Result, interrupt};
use tiles::checksums::Checksum;
use tiles::map_tiles::archive::{ArchiveAbout, WaitingTile, head};
use tiles::map_tiles::tile_id::MapTile;

/// The tiles that are finished. Threads may add tiles in any order.
pub(crate) struct WaitingTiles {
    file: WaitingFile,
    /// The tiles, and where each is in the file.
    tiles: Mutex<Vec<(WaitingTile, u64)>>,
}

impl WaitingTiles {
    /// Makes the file at `path`.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(crate) fn create(path: &Path) -> Result<WaitingTiles> {
        Ok(WaitingTiles { file: WaitingFile::at(path)?, tiles: Mutex::default() })
    }

    /// Adds a tile.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(crate) fn add(&self, tile: MapTile, bytes: &[u8]) -> Result<()> {
        let waiting = WaitingTile { id: tile.id(), length: bytes.len() as u32, checksum: Checksum::of(bytes).number() };
        let at = self.file.add(bytes)?;
        self.tiles.lock().unwrap_or_else(PoisonError::into_inner).push((waiting, at));
        Ok(())
    }

    /// Writes the archive as the pending file of `path`, and removes the waiting tiles. Returns the number of tiles too.
    ///
    /// # Errors
    /// [`sys::Error::Io`], [`sys::Error::Interrupted`].
    pub(crate) fn write(self, about: &ArchiveAbout, path: &Path) -> Result<(u64, PendingFile)> {
        let mut tiles = self.tiles.into_inner().unwrap_or_else(PoisonError::into_inner);
        tiles.sort_unstable_by_key(|(tile, _)| tile.id);
        let waiting: Vec<WaitingTile> = tiles.iter().map(|(tile, _)| *tile).collect();
        let head = head(&waiting, about);
        let mut out = PendingWriter::create(path)?;
        out.write(&head.bytes)?;
        let mut bytes = Vec::new();
        for (tile, at) in head.stored.iter().map(|n| tiles[*n]) {
            interrupt::check()?;
            bytes.resize(tile.length as usize, 0);
            self.file.read(&mut bytes, at)?;
            out.write(&bytes)?;
        }
        let archive = out.finish()?;
        self.file.discard()?;
        Ok((tiles.len() as u64, archive))
    }
}
