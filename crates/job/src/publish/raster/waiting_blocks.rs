//! Packed blocks, in a file of their own until the raster is put together.

use crate::durable::atomic_file::{PendingFile, PendingWriter};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use sys::positional_io::read_exact_at;
use sys::{Error, Result, disk, fault, interrupt};
use tiles::raster::geotiff::{RasterImage, TRAILER};
use tiles::raster::grid::blocks;

/// The blocks of a raster and its overviews. Threads may add blocks in any order.
pub(crate) struct WaitingBlocks {
    path: PathBuf,
    file: File,
    places: Mutex<Places>,
}

struct Places {
    /// The bytes in the file.
    end: u64,
    /// For each image and block: where it is, and its length. The length of a block without a height is 0: it is not in the file.
    of_images: Vec<Vec<(u64, u32)>>,
}

impl WaitingBlocks {
    /// Makes the file at `path` for images of these sizes.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn create(path: &Path, sizes: &[[u32; 2]]) -> Result<WaitingBlocks> {
        let file = disk::create(path).map_err(Error::io("create", path))?;
        let places = |size: &[u32; 2]| {
            let [columns, rows] = blocks(*size);
            vec![(0, 0); columns * rows]
        };
        let places = Mutex::new(Places { end: 0, of_images: sizes.iter().map(places).collect() });
        Ok(WaitingBlocks { path: path.into(), file, places })
    }

    /// Adds block number `block`, row by row, of image number `image`.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn add(&self, image: usize, block: usize, bytes: &[u8]) -> Result<()> {
        let mut places = self.places.lock().unwrap_or_else(PoisonError::into_inner);
        let at = places.end;
        places.end += bytes.len() as u64;
        places.of_images[image][block] = (at, bytes.len() as u32);
        drop(places);
        disk::write_all_at(&self.file, bytes, at).map_err(Error::io("write", &self.path))
    }

    /// Removes the file.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn discard(self) -> Result<()> {
        drop(self.file);
        disk::remove_file(&self.path).map_err(Error::io("remove", &self.path))
    }

    /// Ends the adding. `empty` stands for blocks without a height.
    pub(crate) fn finish(self, empty: Vec<u8>) -> FinishedBlocks {
        let places = self.places.into_inner().unwrap_or_else(PoisonError::into_inner);
        FinishedBlocks { path: self.path, file: self.file, empty, of_images: places.of_images }
    }
}

/// All blocks of a raster.
pub(crate) struct FinishedBlocks {
    path: PathBuf,
    file: File,
    empty: Vec<u8>,
    of_images: Vec<Vec<(u64, u32)>>,
}

impl FinishedBlocks {
    /// Returns the images with the lengths of their blocks.
    pub(crate) fn images(&self, sizes: &[[u32; 2]]) -> Vec<RasterImage> {
        let length = |(_, length): &(u64, u32)| if *length == 0 { self.empty.len() as u32 } else { *length };
        let image = |(size, places): (&[u32; 2], &Vec<_>)| RasterImage {
            size: *size,
            lengths: places.iter().map(length).collect(),
        };
        sizes.iter().zip(&self.of_images).map(image).collect()
    }

    /// Writes the raster as the pending file of `path`: `head`, then the blocks of all images, the last image first. Removes the waiting
    /// blocks.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Interrupted`].
    pub(crate) fn write(self, head: &[u8], path: &Path) -> Result<PendingFile> {
        let mut out = PendingWriter::create(path)?;
        out.write(head)?;
        let mut block = Vec::new();
        for (at, length) in self.of_images.iter().rev().flatten().copied() {
            interrupt::check()?;
            block.clear();
            block.extend(match length {
                0 => &self.empty[..],
                _ => &[],
            });
            if length > 0 {
                block.resize(length as usize, 0);
                let read = fault::read("read-result").and_then(|()| read_exact_at(&self.file, &mut block, at));
                read.map_err(Error::io("read", &self.path))?;
            }
            out.write(&(block.len() as u32).to_le_bytes())?;
            out.write(&block)?;
            out.write(&block[block.len().saturating_sub(TRAILER)..])?;
        }
        let raster = out.finish()?;
        drop(self.file);
        disk::remove_file(&self.path).map_err(Error::io("remove", &self.path))?;
        Ok(raster)
    }
}
