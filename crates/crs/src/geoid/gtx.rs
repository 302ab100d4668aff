//! Geoid grids in the format GTX of NOAA's VDatum, which PROJ reads too: a header of 40 bytes, then the heights in metres as single
//! precision numbers, row by row from the south. All numbers are big-endian. The header has the latitude and the longitude of the
//! south-western node, the steps in latitude and in longitude (64-bit floating point, degrees), and the number of rows and of columns
//! (32-bit integers).

use crate::geoid::block_cache::BlockCache;
use crate::geoid::errors::bad_file;
use crate::geoid::node_grid::{NodeGrid, NodeValues};
use std::fs::File;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use sys::Error;
use sys::positional_io::read_exact_at;

/// Bytes of the header.
const HEADER: u64 = 40;

/// Nodes along each side of what is read at once.
const BLOCK: u64 = 64;

/// What stands where there is no height.
const NO_HEIGHT: f32 = -88.8888;

/// Heights of geoids are within about 110 m. PROJ takes what is farther off for no height, too.
const MOST_METRES: f32 = 1000.0;

/// The heights in a file.
pub(super) struct Gtx {
    path: PathBuf,
    file: File,
    columns: u64,
    rows: u64,
    blocks: BlockCache<Arc<[f32]>>,
}

impl Gtx {
    /// Reads the header of the file at `path`.
    ///
    /// # Errors
    /// [`Error::Config`] if it is no such grid, or is cut off; [`Error::Io`] if it cannot be read.
    pub(super) fn open(path: &Path, file: File) -> Result<(NodeGrid, Gtx), Error> {
        let length = file.metadata().map_err(Error::io("read", path))?.len();
        if length < HEADER {
            return Err(bad_file(
                path,
                format!("{length} bytes are not a geoid grid: a GTX file has a header of {HEADER}"),
            ));
        }
        let mut header = [0; HEADER as usize];
        read_exact_at(&file, &mut header, 0).map_err(Error::io("read", path))?;
        let [south, west, step_north, step_east] = [0, 8, 16, 24].map(|at| f64::from_be_bytes(eight(&header, at)));
        let [rows, columns] = [32, 36].map(|at| u64::try_from(int32(&header, at)).unwrap_or(0));
        let no_grid = |what: String| bad_file(path, format!("it is not a geoid grid in the format GTX: {what}"));
        let grid = NodeGrid::new([west, south], [step_east, step_north], [columns, rows]).map_err(no_grid)?;
        let needed = HEADER + 4 * columns * rows;
        if length < needed {
            return Err(bad_file(
                path,
                format!(
                    "the file is cut off: {columns} columns and {rows} rows take {needed} bytes, and it has {length}"
                ),
            ));
        }
        Ok((grid, Gtx { path: path.into(), file, columns, rows, blocks: BlockCache::new() }))
    }

    /// Reads the nodes from `column` and `row` on, at most [`BLOCK`] in either direction, row by row.
    fn read(&self, column: u64, row: u64) -> Result<Arc<[f32]>, Error> {
        let [width, height] = [self.columns - column, self.rows - row].map(|left| left.min(BLOCK));
        let mut values = Vec::with_capacity((width * height) as usize);
        let mut bytes = vec![0; 4 * width as usize];
        for row in row..row + height {
            let at = HEADER + 4 * (row * self.columns + column);
            read_exact_at(&self.file, &mut bytes, at).map_err(|e| self.not_read(e))?;
            values.extend(bytes.chunks_exact(4).map(|four| f32::from_bits(int32(four, 0) as u32)));
        }
        Ok(values.into())
    }

    fn not_read(&self, error: std::io::Error) -> Error {
        match error.kind() {
            ErrorKind::UnexpectedEof => bad_file(&self.path, "the file was cut off while the job ran"),
            _ => Error::io("read", &self.path)(error),
        }
    }
}

impl NodeValues for Gtx {
    fn value(&self, column: u64, row: u64) -> Result<Option<f64>, Error> {
        let [across, up] = [column / BLOCK, row / BLOCK];
        let number = up * self.columns.div_ceil(BLOCK) + across;
        let block = self.blocks.get(number, || self.read(across * BLOCK, up * BLOCK))?;
        let width = (self.columns - across * BLOCK).min(BLOCK);
        let value = block.get((row % BLOCK * width + column % BLOCK) as usize).copied();
        Ok(value.filter(|value| *value != NO_HEIGHT && value.abs() <= MOST_METRES).map(f64::from))
    }
}

fn eight(bytes: &[u8], at: usize) -> [u8; 8] {
    std::array::from_fn(|k| bytes[at + k])
}

fn int32(bytes: &[u8], at: usize) -> i32 {
    i32::from_be_bytes(std::array::from_fn(|k| bytes[at + k]))
}
