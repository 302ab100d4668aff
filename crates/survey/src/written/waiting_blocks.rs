//! Packed blocks of a raster in a file of their own until all are there: nobody knows before where a block begins in the raster.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use sys::positional_io::read_exact_at;
use sys::{Error, Result, disk, interrupt};
use tiles::raster::geotiff::{RasterImage, TRAILER};
use tiles::raster::grid::blocks;

/// The blocks of a raster and its overviews. Threads may add them in any order.
pub(crate) struct WaitingBlocks {
    path: PathBuf,
    file: File,
    places: Mutex<Places>,
}

#[derive(Default)]
struct Places {
    /// The bytes in the file.
    end: u64,
    /// Where each block of each image is, and its length: 0 of a block without a value, which is not in the file.
    images: Vec<Vec<(u64, u32)>>,
}

impl WaitingBlocks {
    /// Makes the file at `path` for images of these sizes.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn create(path: &Path, sizes: &[[u32; 2]]) -> Result<WaitingBlocks> {
        let file = disk::create(path).map_err(Error::io("create", path))?;
        let nowhere = |size: &[u32; 2]| vec![(0, 0); blocks(*size).into_iter().product()];
        let places = Places { end: 0, images: sizes.iter().map(nowhere).collect() };
        Ok(WaitingBlocks { path: path.into(), file, places: Mutex::new(places) })
    }

    /// Adds a block, by its number row by row, of an image.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn add(&self, image: usize, block: usize, bytes: &[u8]) -> Result<()> {
        let length = u32::try_from(bytes.len()).map_err(|_| Error::Broken("a block of a raster is too long".into()))?;
        let mut places = self.places.lock().unwrap_or_else(PoisonError::into_inner);
        let at = places.end;
        places.end += u64::from(length);
        places.images[image][block] = (at, length);
        drop(places);
        disk::write_all_at(&self.file, bytes, at).map_err(Error::io("write", &self.path))
    }

    /// Writes the raster to the file at `path`: what `head` returns for its images, then the blocks of all images, the last image first.
    /// `empty` stands for blocks without a value. Removes the waiting blocks.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Interrupted`].
    pub(crate) fn write(
        self,
        sizes: &[[u32; 2]],
        empty: &[u8],
        head: impl FnOnce(&[RasterImage]) -> Vec<u8>,
        path: &Path,
    ) -> Result<()> {
        let places = self.places.into_inner().unwrap_or_else(PoisonError::into_inner);
        let of_empty = u32::try_from(empty.len()).unwrap_or(u32::MAX);
        let length = |(_, length): &(u64, u32)| if *length == 0 { of_empty } else { *length };
        let image = |(size, blocks): (&[u32; 2], &Vec<(u64, u32)>)| RasterImage {
            size: *size,
            lengths: blocks.iter().map(length).collect(),
        };
        let images: Vec<RasterImage> = sizes.iter().zip(&places.images).map(image).collect();
        let file = disk::create(path).map_err(Error::io("create", path))?;
        let mut at = 0;
        let mut append = |bytes: &[u8]| {
            disk::write_all_at(&file, bytes, at).map_err(Error::io("write", path))?;
            at += bytes.len() as u64;
            Ok::<(), Error>(())
        };
        append(&head(&images))?;
        let mut piece = Vec::new();
        for place in places.images.iter().rev().flatten() {
            interrupt::check()?;
            let length = length(place);
            piece.clear();
            piece.extend(length.to_le_bytes());
            if place.1 == 0 {
                piece.extend_from_slice(empty);
            } else {
                let first = piece.len();
                piece.resize(first + length as usize, 0);
                read_exact_at(&self.file, &mut piece[first..], place.0).map_err(Error::io("read", &self.path))?;
            }
            piece.extend_from_within(piece.len() - TRAILER..);
            append(&piece)?;
        }
        disk::sync(&file).map_err(Error::io("write", path))?;
        drop(self.file);
        disk::remove_file(&self.path).map_err(Error::io("remove", &self.path))
    }
}
