//! Points on disk by bucket: one file of blocks, each block holding points of one bucket. Memory is one buffer a bucket.

use crate::input::Point;
use crate::positional_io::{read_exact_at, write_all_at};
use crate::{Error, Result};
use bytemuck::{Pod, Zeroable};
use rayon::prelude::*;
use std::fs::File;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use xxhash_rust::xxh3::xxh3_64;

/// A run of points of one bucket in the spill file.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct Block {
    /// The number in the file of the first of the points.
    pub first: u64,
    /// How many points.
    pub points: u32,
    /// The lower half of the XXH3 of their bytes.
    pub hash: u32,
}

/// The spill file. It only grows; blocks of several threads lie in it in any order.
pub struct Spill {
    path: PathBuf,
    file: File,
    points: AtomicU64,
}

impl Spill {
    /// An empty spill file at `path`.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be made.
    pub fn create(path: &Path) -> Result<Spill> {
        let file = File::options().read(true).write(true).create(true).truncate(true).open(path);
        Ok(Spill {
            path: path.to_path_buf(),
            file: file.map_err(Error::io("create", path))?,
            points: AtomicU64::new(0),
        })
    }

    /// The finished spill file at `path`, to read.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be opened.
    pub fn open(path: &Path) -> Result<Spill> {
        let file = File::open(path).map_err(Error::io("open", path))?;
        Ok(Spill { path: path.to_path_buf(), file, points: AtomicU64::new(0) })
    }

    /// The bytes written so far.
    pub fn bytes(&self) -> u64 {
        self.points.load(Ordering::Relaxed) * size_of::<Point>() as u64
    }

    /// Adds a block.
    fn append(&self, points: &[Point]) -> Result<Block> {
        let first = self.points.fetch_add(points.len() as u64, Ordering::Relaxed);
        let at = first * size_of::<Point>() as u64;
        write_all_at(&self.file, bytemuck::cast_slice(points), at).map_err(Error::io("write", &self.path))?;
        Ok(Block { first, points: points.len() as u32, hash: hash(points) })
    }

    /// Whether `block` holds what was written to it.
    pub fn is_whole(&self, block: Block) -> bool {
        let mut points = Vec::new();
        self.read(block, &mut points).is_ok() && hash(&points) == block.hash
    }

    /// Adds the points of `block` to `into`.
    ///
    /// # Errors
    /// [`Error::Io`] if they cannot be read.
    pub fn read(&self, block: Block, into: &mut Vec<Point>) -> Result<()> {
        let start = into.len();
        into.resize(start + block.points as usize, bytemuck::Zeroable::zeroed());
        let at = block.first * size_of::<Point>() as u64;
        let bytes = bytemuck::cast_slice_mut(&mut into[start..]);
        read_exact_at(&self.file, bytes, at).map_err(Error::io("read", &self.path))
    }

    /// Takes the points whose numbers in the job lie in one of `orders`, which ascend, out of `bucket`.
    ///
    /// # Errors
    /// [`Error::Io`] if its blocks cannot be read, or those with fewer points cannot be written.
    pub fn sift(&self, bucket: &mut Bucket, orders: &[Range<u64>]) -> Result<()> {
        let is_wanted = |point: &Point| {
            let order = point.order();
            let after = orders.partition_point(|range| range.start <= order);
            after == 0 || orders[after - 1].end <= order
        };
        let mut points = Vec::new();
        for block in &mut bucket.blocks {
            points.clear();
            self.read(*block, &mut points)?;
            points.retain(is_wanted);
            if points.len() < block.points as usize {
                *block = self.append(&points)?;
            }
        }
        bucket.blocks.retain(|block| block.points > 0);
        bucket.points = bucket.blocks.iter().map(|block| block.points as u64).sum();
        Ok(())
    }
}

fn hash(points: &[Point]) -> u32 {
    xxh3_64(bytemuck::cast_slice(points)) as u32
}

/// What one bucket holds: its blocks on disk, and how many points in all.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Bucket {
    /// The blocks, in no particular order.
    pub blocks: Vec<Block>,
    /// The number of points in them.
    pub points: u64,
}

/// Smaller blocks cost more system calls than their memory is worth.
const LEAST_BLOCK: u64 = 64;
/// Larger blocks than this no longer read faster.
const LARGEST_BLOCK: u64 = 4096;

/// Collects points by bucket from many threads, a buffer a bucket.
pub struct Buckets<'a> {
    spill: &'a Spill,
    capacity: usize,
    open: Vec<Mutex<OpenBucket>>,
}

#[derive(Default)]
struct OpenBucket {
    buffer: Vec<Point>,
    bucket: Bucket,
}

impl<'a> Buckets<'a> {
    /// `count` empty buckets that together buffer at most `memory` bytes.
    pub fn new(spill: &'a Spill, count: usize, memory: u64) -> Buckets<'a> {
        let capacity = (memory / count as u64 / size_of::<Point>() as u64).clamp(LEAST_BLOCK, LARGEST_BLOCK) as usize;
        Buckets { spill, capacity, open: (0..count).map(|_| Mutex::default()).collect() }
    }

    /// The bytes of one buffer where memory is no matter.
    pub fn largest_buffer() -> u64 {
        LARGEST_BLOCK * size_of::<Point>() as u64
    }

    /// Adds `points`, all of bucket `index`.
    ///
    /// # Errors
    /// [`Error::Io`] if a full buffer cannot be written.
    pub fn extend(&self, index: usize, mut points: &[Point]) -> Result<()> {
        let mut open = self.open[index].lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        while !points.is_empty() {
            if open.buffer.capacity() == 0 {
                open.buffer.reserve_exact(self.capacity);
            }
            let (now, later) = points.split_at(points.len().min(self.capacity - open.buffer.len()));
            open.buffer.extend_from_slice(now);
            points = later;
            if open.buffer.len() == self.capacity {
                self.flush(&mut open)?;
            }
        }
        Ok(())
    }

    fn flush(&self, open: &mut OpenBucket) -> Result<()> {
        let block = self.spill.append(&open.buffer)?;
        open.bucket.blocks.push(block);
        open.bucket.points += block.points as u64;
        open.buffer.clear();
        Ok(())
    }

    /// Writes what is still in the buffers; the buckets with their blocks.
    ///
    /// # Errors
    /// [`Error::Io`] if a buffer cannot be written.
    pub fn finish(self) -> Result<Vec<Bucket>> {
        let finish = |open: &Mutex<OpenBucket>| {
            let mut open = open.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
            if !open.buffer.is_empty() {
                self.flush(&mut open)?;
            }
            open.buffer = Vec::new();
            Ok(std::mem::take(&mut open.bucket))
        };
        self.open.par_iter().map(finish).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sifting_takes_out_the_points_of_a_range_of_records_and_no_others() {
        let folder = tempfile::tempdir().unwrap();
        let spill = Spill::create(&folder.path().join("points.spill")).unwrap();
        let buckets = Buckets::new(&spill, 1, 0);
        let points: Vec<Point> = (0..1000).map(|i| Point::new([i as i32, 0], 0, [0; 3], 0, i)).collect();
        buckets.extend(0, &points).unwrap();
        let mut bucket = buckets.finish().unwrap().remove(0);
        spill.sift(&mut bucket, &[0..1, 64..64, 100..300, 999..2000]).unwrap();
        let mut left = Vec::new();
        bucket.blocks.iter().for_each(|&block| spill.read(block, &mut left).unwrap());
        let orders: Vec<u64> = left.iter().map(Point::order).collect();
        assert_eq!(orders, (1..100).chain(300..999).collect::<Vec<u64>>());
        assert_eq!(bucket.points, 798);
        spill.sift(&mut bucket, &[0..500, 500..1000]).unwrap();
        assert_eq!(bucket, Bucket::default());
    }
}
