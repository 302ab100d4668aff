//! Packed blocks, in a file of their own until the raster is put together.

use crate::durable::atomic_file::{PendingFile, PendingWriter};
use crate::durable::waiting_file::WaitingFile;
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use sys::{Result, interrupt};
use tiles::raster::geotiff::{RasterImage, TRAILER};
use tiles::raster::grid::blocks;

/// The blocks of a raster and its overviews. Threads may add blocks in any order.
pub(crate) struct WaitingBlocks {
    file: WaitingFile,
    /// For each image and block: where it is, and its length. The length of a block without a height is 0: it is not in the file.
    of_images: Mutex<Vec<Vec<(u64, u32)>>>,
}

impl WaitingBlocks {
    /// Makes the file at `path` for images of these sizes.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(crate) fn create(path: &Path, sizes: &[[u32; 2]]) -> Result<WaitingBlocks> {
        let file = WaitingFile::at(path)?;
        let places = |size: &[u32; 2]| {
            let [columns, rows] = blocks(*size);
            vec![(0, 0); columns * rows]
        };
        Ok(WaitingBlocks { file, of_images: Mutex::new(sizes.iter().map(places).collect()) })
    }

    /// Adds block number `block`, row by row, of image number `image`.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(crate) fn add(&self, image: usize, block: usize, bytes: &[u8]) -> Result<()> {
        let at = self.file.add(bytes)?;
        let mut of_images = self.of_images.lock().unwrap_or_else(PoisonError::into_inner);
        of_images[image][block] = (at, bytes.len() as u32);
        Ok(())
    }

    /// Removes the file.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(crate) fn discard(self) -> Result<()> {
        self.file.discard()
    }

    /// Ends the adding. `empty` stands for blocks without a height.
    pub(crate) fn finish(self, empty: Vec<u8>) -> FinishedBlocks {
        let of_images = self.of_images.into_inner().unwrap_or_else(PoisonError::into_inner);
        FinishedBlocks { file: self.file, empty, of_images }
    }
}

/// All blocks of a raster.
pub(crate) struct FinishedBlocks {
    file: WaitingFile,
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
    /// [`sys::Error::Io`], [`sys::Error::Interrupted`].
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
                self.file.read(&mut block, at)?;
            }
            out.write(&(block.len() as u32).to_le_bytes())?;
            out.write(&block)?;
            out.write(&block[block.len().saturating_sub(TRAILER)..])?;
        }
        let raster = out.finish()?;
        self.file.discard()?;
        Ok(raster)
    }
}
