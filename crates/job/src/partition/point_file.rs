//! Point files: the points between reading and triangulating, packed in blocks that each hold points of one bucket. A part has one from
//! each reader that finds points for it, so that every file has one writer.
//!
//! A bucket appends its blocks to **runs** of whole pages, so that the points of a tile lie in few places of the file.

use crate::durable::mapped::{FilePart, MappedFile};
use crate::durable::packing::{pack, unpack};
use crate::durable::store::PAGE;
use bytemuck::{Pod, Zeroable};
use points::Point;
use std::fs::File;
use std::io::{self, ErrorKind};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use sys::{Error, Result, disk, fault};
use xxhash_rust::xxh3::xxh3_64;

/// Bytes of a run where more blocks will follow. What is left of it takes no room on the disk.
const RUN: u64 = 64 << 10;

/// Some points of one bucket in a point file.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct PointBlock {
    /// The position in the file of the first byte.
    at: u64,
    /// The XXH3 of the bytes.
    hash: u64,
    /// The number of bytes.
    bytes: u32,
    /// The number of points.
    pub points: u16,
    /// The number of the point file.
    file: u16,
}

impl PointBlock {
    /// Returns the number of bytes.
    pub fn bytes(&self) -> u64 {
        u64::from(self.bytes)
    }
}

/// What a bucket has left of its last run.
#[derive(Debug, Default)]
pub struct PointRun(Range<u64>);

/// A point file. It only grows; several threads append blocks to it in any order.
pub struct PointFile {
    number: u16,
    path: PathBuf,
    file: File,
    /// The map of a finished file; a growing one has none.
    map: MappedFile,
    /// Where the next run begins.
    end: AtomicU64,
    /// The bytes in all blocks.
    bytes: AtomicU64,
}

impl PointFile {
    /// Creates the empty point file with this `number` at `path`.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be made.
    pub fn create(path: &Path, number: u16) -> Result<PointFile> {
        let file = disk::create(path).map_err(Error::io("create", path))?;
        Ok(PointFile::new(path, number, file, MappedFile::default()))
    }

    /// Waits until all blocks are on the disk.
    ///
    /// # Errors
    /// [`Error::Io`] if they cannot be written.
    pub fn sync(&self) -> Result<()> {
        disk::sync_data(&self.file).map_err(Error::io("write", &self.path))
    }

    /// Opens the finished point file with this `number` at `path` for reading.
    fn open(path: &Path, number: u16) -> Result<PointFile> {
        let file = File::open(path).map_err(Error::io("open", path))?;
        let map = MappedFile::new(&file);
        Ok(PointFile::new(path, number, file, map))
    }

    fn new(path: &Path, number: u16, file: File, map: MappedFile) -> PointFile {
        PointFile { number, path: path.to_path_buf(), file, map, end: AtomicU64::new(0), bytes: AtomicU64::new(0) }
    }

    /// Returns the number of bytes in all blocks.
    pub fn bytes(&self) -> u64 {
        self.bytes.load(Ordering::Relaxed)
    }

    /// Appends a block to the `run` of its bucket, or begins another one; a short one if it `is_last`.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be written.
    pub fn append(&self, run: &mut PointRun, points: &[Point], is_last: bool) -> Result<PointBlock> {
        let mut packed = Vec::with_capacity(size_of_val(points) / 2);
        pack(points, Point::columns, &mut packed);
        // Few jobs read intensities, so they have a column of their own, which other files do not have.
        if points.iter().any(|point| point.intensity != 0) {
            pack(points, |point| [point.intensity as u32], &mut packed);
        }
        let bytes = packed.len() as u64;
        if run.0.end - run.0.start < bytes {
            let length = if is_last { bytes.next_multiple_of(PAGE) } else { bytes.next_multiple_of(RUN) };
            let start = self.end.fetch_add(length, Ordering::Relaxed);
            run.0 = start..start + length;
        }
        let at = run.0.start;
        disk::write_all_at(&self.file, &packed, at).map_err(Error::io("write", &self.path))?;
        run.0.start += bytes;
        self.bytes.fetch_add(bytes, Ordering::Relaxed);
        let (bytes, file) = (bytes as u32, self.number);
        Ok(PointBlock { at, hash: xxh3_64(&packed), bytes, points: points.len() as u16, file })
    }

    /// Tells whether `block` holds what was written to it.
    ///
    /// # Errors
    /// [`Error::Io`] if the disk does not tell.
    pub fn is_whole(&self, block: PointBlock) -> Result<bool> {
        match self.packed(block) {
            Err(Error::Io { source, .. }) if source.kind() == ErrorKind::UnexpectedEof => Ok(false),
            bytes => Ok(xxh3_64(&bytes?) == block.hash),
        }
    }

    /// Appends the points of `block` to `points`.
    ///
    /// # Errors
    /// [`Error::Io`] if they cannot be read.
    pub fn read(&self, block: PointBlock, points: &mut Vec<Point>) -> Result<()> {
        let (packed, count, first) = (self.packed(block)?, block.points as usize, points.len());
        let damaged = || Error::io("read", &self.path)(io::Error::new(ErrorKind::InvalidData, "a block is damaged"));
        let rest = unpack(&packed, count, Point::of_columns, points).ok_or_else(damaged)?;
        if rest.is_empty() {
            return Ok(());
        }
        let mut intensities = Vec::with_capacity(count);
        let rest = unpack(rest, count, |[intensity]| intensity as u16, &mut intensities);
        for (point, intensity) in points[first..].iter_mut().zip(intensities) {
            point.intensity = intensity;
        }
        if rest.is_some_and(<[u8]>::is_empty) { Ok(()) } else { Err(damaged()) }
    }

    fn packed(&self, block: PointBlock) -> Result<FilePart<'_>> {
        let part = || self.map.part(&self.file, block.at, block.bytes as usize);
        fault::read("read-points").and_then(|()| part()).map_err(Error::io("read", &self.path))
    }
}

/// The point files of a part, by their numbers. The last of them may grow.
pub struct PointFiles(Vec<PointFile>);

impl PointFiles {
    /// Opens finished files for reading, given as their numbers and paths.
    ///
    /// # Errors
    /// [`Error::Io`] if one cannot be opened.
    pub fn open(paths: &[(u16, PathBuf)]) -> Result<PointFiles> {
        let open = |(number, path): &(u16, PathBuf)| PointFile::open(path, *number);
        paths.iter().map(open).collect::<Result<_>>().map(PointFiles)
    }

    /// Adds a file.
    #[must_use]
    pub fn and(mut self, file: PointFile) -> PointFiles {
        self.0.push(file);
        self
    }

    /// Returns the file that may grow.
    ///
    /// # Errors
    /// [`Error::Broken`] if there is none.
    pub fn growing(&self) -> Result<&PointFile> {
        self.0.last().ok_or_else(|| Error::Broken("there is no point file to write to".into()))
    }

    /// Tells whether `block` holds what was written to it. If its file is gone, it does not.
    ///
    /// # Errors
    /// [`Error::Io`] if the disk does not tell.
    pub fn is_whole(&self, block: PointBlock) -> Result<bool> {
        self.of(block).map_or(Ok(false), |file| file.is_whole(block))
    }

    /// Appends the points of `block` to `points`.
    ///
    /// # Errors
    /// [`Error::Io`] if they cannot be read, [`Error::Broken`] if their file is gone.
    pub fn read(&self, block: PointBlock, points: &mut Vec<Point>) -> Result<()> {
        self.of(block)?.read(block, points)
    }

    fn of(&self, block: PointBlock) -> Result<&PointFile> {
        let file = self.0.iter().find(|file| file.number == block.file);
        file.ok_or_else(|| Error::Broken(format!("point file {} is gone", block.file)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(count: u32, of: impl Fn(u32) -> Point) -> Vec<Point> {
        (0..count).map(of).collect()
    }

    fn file() -> (tempfile::TempDir, PointFile) {
        let folder = tempfile::tempdir().unwrap();
        let file = PointFile::create(&folder.path().join("points"), 0).unwrap();
        (folder, file)
    }

    #[test]
    fn extreme_points_come_back() {
        let (_folder, file) = file();
        let (most, least) = (1 << 29, -(1 << 29));
        let extremes = [
            Point::new([most, least], i32::MAX, [u16::MAX, 0, 257], u8::MAX, (1 << 40) - 1),
            Point::new([least, most], i32::MIN, [0, u16::MAX, 256], 0, 0),
            Point::new([0, -1], 0, [1, 2, 3], 2, u32::MAX as u64),
            Point::new([1, 0], -1, [0; 3], 1, u32::MAX as u64 + 1).with_intensity(u16::MAX),
        ];
        let mut run = PointRun::default();
        let mut blocks = Vec::new();
        for count in [0, 1, 31, 32, 255, 256, 257, 4096, 5000] {
            let points = points(count, |i| extremes[(i % 4 * i / 3 % 4) as usize]);
            let block = file.append(&mut run, &points, false).unwrap();
            assert!(file.is_whole(block).unwrap());
            blocks.push((block, points));
        }
        for (block, expected) in &blocks {
            let mut read = vec![extremes[0]];
            file.read(*block, &mut read).unwrap();
            assert_eq!(read[1..], expected[..]);
        }
    }

    #[test]
    fn neighbours_take_less_than_half_the_bytes() {
        let (_folder, file) = file();
        let point = |i: u32| {
            let at = |step: u32| (i.wrapping_mul(step) >> 15) as i32;
            Point::new(
                [at(2_654_435_761) & 8191, at(40_503_001) & 8191],
                at(97) & 2047,
                [(i & 255) as u16 * 256; 3],
                2,
                i as u64,
            )
        };
        let block = file.append(&mut PointRun::default(), &points(4096, point), false).unwrap();
        assert!(block.bytes < 4096 * 10, "{} bytes", block.bytes);
    }

    #[test]
    fn intensities_take_room_only_where_there_are_some() {
        let (_folder, file) = file();
        let bytes = |of: fn(u32) -> u16| {
            let points = points(512, |i| Point::new([i as i32, 7], 3, [0; 3], 2, i as u64).with_intensity(of(i)));
            let block = file.append(&mut PointRun::default(), &points, true).unwrap();
            let mut read = Vec::new();
            file.read(block, &mut read).unwrap();
            assert_eq!(read, points);
            block.bytes
        };
        let none = bytes(|_| 0);
        // A column of two groups, each with a head of 6 bytes; the differences take 8 bits in one and no bit in the other.
        assert_eq!(bytes(|i| i.min(255) as u16), none + 2 * 6 + 256);
        assert_eq!(bytes(|_| u16::MAX), none + 2 * 6);
    }

    #[test]
    fn blocks_are_found_in_their_files() {
        let folder = tempfile::tempdir().unwrap();
        let path = |number: u16| folder.path().join(number.to_string());
        let write = |number: u16| {
            let file = PointFile::create(&path(number), number).unwrap();
            let points = points(100, |i| Point::new([i as i32, number as i32], 0, [0; 3], 0, i as u64));
            (file.append(&mut PointRun::default(), &points, true).unwrap(), points)
        };
        let written: Vec<_> = [7, 3, 2000].map(write).into();
        let files = PointFiles::open(&[(3, path(3)), (7, path(7))]).unwrap();
        for (block, expected) in &written[..2] {
            let mut found = Vec::new();
            files.read(*block, &mut found).unwrap();
            assert_eq!(found, *expected);
        }
        assert!(!files.is_whole(written[2].0).unwrap() && files.read(written[2].0, &mut Vec::new()).is_err());
        let files = files.and(PointFile::open(&path(2000), 2000).unwrap());
        assert!(written.iter().all(|(block, _)| files.is_whole(*block).unwrap()));
    }
}
