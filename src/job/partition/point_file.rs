//! The point file: the points between reading and triangulating, in blocks that each hold points of one bucket.

use crate::input::Point;
use crate::job::durable::mapped::{MappedFile, MappedSlice};
use crate::{Error, Result, disk, fault};
use bytemuck::{Pod, Zeroable};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use xxhash_rust::xxh3::xxh3_64;

/// A run of points of one bucket in the point file.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct PointBlock {
    /// The position in the file of the first point, counted in points.
    pub first: u64,
    /// The number of points.
    pub points: u32,
    /// The lower half of the XXH3 of their bytes.
    pub hash: u32,
}

impl PointBlock {
    /// Returns the position after the last point.
    pub fn end(&self) -> u64 {
        self.first + u64::from(self.points)
    }
}

/// The point file. It only grows; several threads append blocks to it in any order.
pub struct PointFile {
    path: PathBuf,
    file: File,
    /// The map of a finished file; of a growing one, blocks are mapped one by one.
    map: MappedFile,
    points: AtomicU64,
}

impl PointFile {
    /// Creates an empty point file at `path`.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be made.
    pub fn create(path: &Path) -> Result<PointFile> {
        let file = disk::create(path);
        Ok(PointFile {
            path: path.to_path_buf(),
            file: file.map_err(Error::io("create", path))?,
            map: MappedFile::default(),
            points: AtomicU64::new(0),
        })
    }

    /// Opens the point file at `path`, or makes one. New blocks follow the first `points` points.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be opened or made.
    pub fn append_to(path: &Path, points: u64) -> Result<PointFile> {
        let file = disk::open_or_create(path).map_err(Error::io("open", path))?;
        Ok(PointFile { path: path.to_path_buf(), file, map: MappedFile::default(), points: AtomicU64::new(points) })
    }

    /// Waits until all blocks are on the disk.
    ///
    /// # Errors
    /// [`Error::Io`] if they cannot be written.
    pub fn sync(&self) -> Result<()> {
        disk::sync_data(&self.file).map_err(Error::io("write", &self.path))
    }

    /// Opens the finished point file at `path` for reading.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be opened.
    pub fn open(path: &Path) -> Result<PointFile> {
        let file = File::open(path).map_err(Error::io("open", path))?;
        let map = MappedFile::new(&file);
        Ok(PointFile { path: path.to_path_buf(), file, map, points: AtomicU64::new(0) })
    }

    /// Returns the number of bytes written so far.
    pub fn bytes(&self) -> u64 {
        self.points.load(Ordering::Relaxed) * size_of::<Point>() as u64
    }

    /// Appends a block.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be written.
    pub fn append(&self, points: &[Point]) -> Result<PointBlock> {
        let first = self.points.fetch_add(points.len() as u64, Ordering::Relaxed);
        let at = first * size_of::<Point>() as u64;
        disk::write_all_at(&self.file, bytemuck::cast_slice(points), at).map_err(Error::io("write", &self.path))?;
        Ok(PointBlock { first, points: points.len() as u32, hash: hash(points) })
    }

    /// Tells whether `block` holds what was written to it.
    pub fn is_whole(&self, block: PointBlock) -> bool {
        self.read(block).is_ok_and(|points| hash(&points) == block.hash)
    }

    /// Returns the points of `block`.
    ///
    /// # Errors
    /// [`Error::Io`] if they cannot be read.
    pub fn read(&self, block: PointBlock) -> Result<MappedSlice<'_, Point>> {
        let at = block.first * size_of::<Point>() as u64;
        let slice = || self.map.slice(&self.file, at, block.points as usize);
        fault::read("read-points").and_then(|()| slice()).map_err(Error::io("read", &self.path))
    }
}

fn hash(points: &[Point]) -> u32 {
    xxh3_64(bytemuck::cast_slice(points)) as u32
}
