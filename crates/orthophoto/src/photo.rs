//! An orthophoto.

use crate::bands::Bands;
use crate::chunks::Chunks;
use crate::errors::{bad_photo, require_file};
use crate::georeference::{PixelGrid, crs_of, way};
use crs::{Crs, CrsTransform};
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use sys::catch_panic::catch_panic;
use sys::{Error, Result, Warnings, interrupt};
use tiff::decoder::Decoder;

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
    /// Opens the GeoTIFF at `path`, which is to be asked for places in the CRS `points`. It takes up to twice `most_bytes` bytes of memory.
    ///
    /// # Errors
    /// [`Error::Config`] if there is no such file; [`Error::Input`] if it is no picture that can be read, or says not where it is, or there is
    /// no way to its CRS; [`Error::Io`] if it cannot be read.
    pub fn open(path: &Path, points: &Crs, most_bytes: u64) -> Result<Orthophoto> {
        require_file(path)?;
        let file = File::open(path).map_err(Error::io("read", path))?;
        let read = catch_panic(|| Orthophoto::read(path, file, points, most_bytes));
        let read = read.map_err(|e| bad_photo(path, format!("it is not a readable GeoTIFF: {e}")))?;
        read.map_err(|what| bad_photo(path, what))
    }

    fn read(path: &Path, file: File, points: &Crs, most_bytes: u64) -> std::result::Result<Orthophoto, String> {
        let other = file.try_clone().map_err(|e| e.to_string())?;
        let not_read = |e: tiff::TiffError| format!("it is not a readable GeoTIFF: {e}");
        let mut image = Decoder::new(BufReader::new(other)).map_err(not_read)?;
        let bands = Bands::of(&mut image)?;
        let pixels = PixelGrid::of(&mut image)?;
        let mut warnings = Warnings::default();
        let crs = crs_of(&mut image, &mut warnings).map_err(|e| e.to_string())?;
        let way = way(points, &crs, &mut warnings)?;
        let chunks = Chunks::new(image, file, bands, most_bytes)?;
        Ok(Orthophoto { path: path.into(), bands, pixels, chunks, way, warnings })
    }

    /// Returns the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the sRGB colours of the pixels at places in the CRS of the points; `None` outside the picture and where it is empty.
    ///
    /// # Errors
    /// [`Error::Input`] if a tile or strip of it cannot be read; [`Error::Interrupted`].
    pub fn colors(&self, places: impl Iterator<Item = [f64; 2]>) -> Result<Vec<Option<[u8; 3]>>> {
        let pixels: Vec<_> = places.map(|place| self.pixel(place)).collect();
        let mut colors = vec![None; pixels.len()];
        let mut spots: Vec<Spot> =
            (0..).zip(&pixels).filter_map(|(place, pixel)| Some(self.spot(place, (*pixel)?))).collect();
        spots.sort_unstable_by_key(|spot| (spot.chunk, spot.place));
        for spots in spots.chunk_by(|one, other| one.chunk == other.chunk) {
            interrupt::check()?;
            let Some(Spot { chunk, .. }) = spots.first() else { continue };
            let chunk = self.chunks.get(*chunk).map_err(|what| bad_photo(&self.path, what))?;
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
