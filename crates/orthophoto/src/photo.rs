//! An orthophoto.

use crate::bands::Bands;
use crate::chunks::Chunks;
use crate::errors::PhotoError;
use crate::georeference::{PixelGrid, crs_of, way};
use crate::image::PictureBytes;
use crs::{Crs, CrsTransform};
use std::path::{Path, PathBuf};
use sys::catch_panic::catch_panic;
use sys::{Result, Warnings, interrupt};
use tiff::decoder::Decoder;

/// What is wrong with other files.
const NO_GEOTIFF: &str = "it is not a readable GeoTIFF";

/// An orthophoto, open to be asked for colours. Threads may share it.
#[derive(Debug)]
pub struct Orthophoto {
    path: PathBuf,
    bands: Bands,
    pixels: PixelGrid,
    chunks: Chunks,
    /// The way from the CRS of the points; `None` if the picture is in the same.
    way: Option<CrsTransform>,
    /// What the user should know about it.
    pub warnings: Warnings,
}

/// A pixel in the chunks of a picture.
struct Spot {
    chunk: u32,
    at: [u32; 2],
    /// The number of the place.
    place: usize,
}

impl Orthophoto {
    /// Opens a GeoTIFF of these `bytes`, which messages call `path`. It is to be asked for places in the CRS `points`, and takes up to twice
    /// `most_bytes` bytes of memory.
    ///
    /// # Errors
    /// [`sys::Error::Input`] if it is not a readable GeoTIFF, is not georeferenced, or the CRS of the points cannot be transformed into its own;
    /// [`sys::Error::Io`] if the bytes cannot be read.
    pub fn open(path: &Path, bytes: Box<dyn PictureBytes>, points: &Crs, most_bytes: u64) -> Result<Orthophoto> {
        let read = catch_panic(|| Orthophoto::read(path, bytes, points, most_bytes));
        let read = read.unwrap_or_else(|e| Err(PhotoError::Bad(e.to_string()).with(NO_GEOTIFF)));
        read.map_err(|what| what.about(path))
    }

    fn read(
        path: &Path,
        bytes: Box<dyn PictureBytes>,
        points: &Crs,
        most_bytes: u64,
    ) -> std::result::Result<Orthophoto, PhotoError> {
        let mut image = Decoder::new(bytes).map_err(|e| PhotoError::from(e).with(NO_GEOTIFF))?;
        let bands = Bands::of(&mut image)?;
        let pixels = PixelGrid::of(&mut image)?;
        let mut warnings = Warnings::default();
        let crs = crs_of(&mut image, &mut warnings)?;
        let way = way(points, &crs, &mut warnings)?;
        let chunks = Chunks::new(image, bands, most_bytes)?;
        Ok(Orthophoto { path: path.into(), bands, pixels, chunks, way, warnings })
    }

    /// Returns the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the sRGB colours of the pixels at places in the CRS of the points; `None` outside the picture and where it is empty.
    ///
    /// # Errors
    /// [`sys::Error::Input`] or [`sys::Error::Io`] if a tile or strip of it cannot be read; [`sys::Error::Interrupted`].
    pub fn colors(&self, places: impl Iterator<Item = [f64; 2]>) -> Result<Vec<Option<[u8; 3]>>> {
        let pixels: Vec<_> = places.map(|place| self.pixel(place)).collect();
        let mut colors = vec![None; pixels.len()];
        let mut spots: Vec<Spot> =
            (0..).zip(&pixels).filter_map(|(place, pixel)| Some(self.spot(place, (*pixel)?))).collect();
        spots.sort_unstable_by_key(|spot| (spot.chunk, spot.place));
        for spots in spots.chunk_by(|one, other| one.chunk == other.chunk) {
            interrupt::check()?;
            let Some(Spot { chunk, .. }) = spots.first() else { continue };
            let chunk = self.chunks.get(*chunk).map_err(|what| what.about(&self.path))?;
            for Spot { at: [column, row], place, .. } in spots {
                colors[*place] = self.bands.color(chunk.pixel(*column, *row, self.bands.count));
            }
        }
        Ok(colors)
    }

    fn spot(&self, place: usize, pixel: [u32; 2]) -> Spot {
        let (chunk, at) = self.chunks.grid.place(pixel);
        Spot { chunk, at, place }
    }

    fn pixel(&self, place: [f64; 2]) -> Option<[u32; 2]> {
        let there = match &self.way {
            Some(way) => way.apply(place)?,
            None => place,
        };
        self.pixels.pixel(there, self.chunks.grid.size)
    }
}
