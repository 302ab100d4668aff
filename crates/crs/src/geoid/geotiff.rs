//! Geoid grids as GeoTIFF, as PROJ's packages of grids have them: one band of single precision, north up.
//!
//! The crate `tiff` reads the container. It may panic on hostile data, so every call is wrapped in [`catch_panic`].

use crate::geoid::block_cache::BlockCache;
use crate::geoid::errors::bad_file;
use crate::geoid::geotiff_tags::{check_kind, grid_of, no_height};
use crate::geoid::node_grid::{NodeGrid, NodeValues};
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use sys::Error;
use sys::catch_panic::catch_panic;
use sys::positional_io::read_at;
use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::{SampleFormat, Tag};

/// The most bytes that one tile or strip may have. Those of PROJ's grids have a quarter of a megabyte.
const MOST_BYTES: usize = 64 << 20;

/// Heights of geoids are within about 110 m.
const MOST_METRES: f32 = 1000.0;

type Image = Decoder<BufReader<File>>;

/// The heights in a file.
pub(super) struct GeoTiff {
    path: PathBuf,
    image: Mutex<Image>,
    columns: u64,
    rows: u64,
    /// The columns and rows of a tile or strip.
    block: [u64; 2],
    no_height: Option<f32>,
    blocks: BlockCache<Arc<[f32]>>,
}

/// Tells whether a file begins as TIFF does.
///
/// # Errors
/// The error of the operating system.
pub(super) fn is_tiff(file: &File) -> std::io::Result<bool> {
    let mut first = [0; 4];
    let read = read_at(file, &mut first, 0)?;
    // Either byte order, and the numbers of TIFF and of BigTIFF.
    Ok(read == 4 && [b"II*\0", b"II+\0", b"MM\0*", b"MM\0+"].contains(&&first))
}

impl GeoTiff {
    /// Reads the tags of the file at `path`.
    ///
    /// # Errors
    /// [`Error::Config`] if it is no grid that can be read.
    pub(super) fn open(path: &Path, file: File) -> Result<(NodeGrid, GeoTiff), Error> {
        let read = catch_panic(|| GeoTiff::read_tags(path, file));
        let no_grid = |what: String| bad_file(path, format!("it is not a readable geoid grid: {what}"));
        read.map_err(|e| e.to_string()).and_then(|read| read).map_err(no_grid)
    }

    fn read_tags(path: &Path, file: File) -> Result<(NodeGrid, GeoTiff), String> {
        let mut image = Decoder::new(BufReader::new(file)).map_err(|e| e.to_string())?;
        let mut limits = Limits::default();
        limits.decoding_buffer_size = MOST_BYTES;
        limits.intermediate_buffer_size = MOST_BYTES;
        image = image.with_limits(limits);
        if image.more_images() {
            return Err("it holds several images; name a file with one grid".into());
        }
        let color = image.colortype().map_err(|e| e.to_string())?;
        let format = image.get_tag_u16_vec(Tag::SampleFormat).unwrap_or_default();
        if color != ColorType::Gray(32) || format != [SampleFormat::IEEEFP.to_u16()] {
            return Err(format!(
                "it has {color:?} of the sample formats {format:?}; only one band of 32-bit floating point is supported"
            ));
        }
        let (columns, rows) = image.dimensions().map_err(|e| e.to_string())?;
        let [columns, rows] = [columns, rows].map(u64::from);
        let grid = grid_of(&mut image, [columns, rows])?;
        check_kind(&mut image)?;
        let (width, height) = image.chunk_dimensions();
        let block = [u64::from(width), u64::from(height).min(rows)];
        if block.contains(&0) {
            return Err("its tiles are empty".into());
        }
        let no_height = no_height(&mut image);
        let (path, image, blocks) = (path.into(), Mutex::new(image), BlockCache::new());
        Ok((grid, GeoTiff { path, image, columns, rows, block, no_height, blocks }))
    }

    /// Reads a tile or strip.
    fn read(&self, number: u64) -> Result<Arc<[f32]>, Error> {
        let mut image = self.image.lock().unwrap_or_else(PoisonError::into_inner);
        let read = catch_panic(|| image.read_chunk(number as u32).map_err(|e| e.to_string()));
        let damaged = |what: String| bad_file(&self.path, format!("part {number} of the grid cannot be read: {what}"));
        match read.map_err(|e| e.to_string()).and_then(|read| read).map_err(damaged)? {
            DecodingResult::F32(values) => Ok(values.into()),
            _ => Err(damaged("its data type differs from its tags".into())),
        }
    }
}

impl NodeValues for GeoTiff {
    fn value(&self, column: u64, row: u64) -> Result<Option<f64>, Error> {
        // An image has the north on top.
        let [place, size] = [[column, self.rows - 1 - row], [self.columns, self.rows]];
        let block = [0, 1].map(|axis| place[axis] / self.block[axis]);
        let across = self.columns.div_ceil(self.block[0]);
        let number = block[1] * across + block[0];
        let values = self.blocks.get(number, || self.read(number))?;
        // Tiles at the border are cut to the image.
        let width = (size[0] - block[0] * self.block[0]).min(self.block[0]);
        let at = place[1] % self.block[1] * width + place[0] % self.block[0];
        let value = values.get(at as usize).copied();
        let counts = |value: &f32| Some(*value) != self.no_height && value.abs() <= MOST_METRES;
        Ok(value.filter(counts).map(f64::from))
    }
}
