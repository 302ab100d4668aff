//! Collecting points by bucket from many threads: each bucket has a buffer that is written to the point file when it is full.

use crate::partition::point_file::{PointBlock, PointFile, PointRun};
use points::Point;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use sys::{Error, Result};
use xxhash_rust::xxh3::xxh3_64;

/// What one bucket holds.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Bucket {
    /// Its blocks in the point file, in no particular order.
    pub blocks: Vec<PointBlock>,
    /// The number of points in them.
    pub points: u64,
    /// The digest of the points: the sum of their hashes, so their order does not matter. 0 unless [`Buckets::with_digests`] wants it.
    pub digest: u64,
}

/// Smaller blocks cost more system calls than their memory is worth, and more bytes, because points are packed in groups of 256.
const LEAST_BLOCK: u64 = 64;
/// Blocks of twice this size cost the whole job a quarter to two fifths more memory, and save at most a hundredth of the time.
const LARGEST_BLOCK: u64 = 1024;
/// Points are packed in pieces of this many, so that a block of whole pieces is not padded.
const PIECE: u64 = 32;

/// Buckets that several threads fill at the same time.
pub struct Buckets<'a> {
    /// The file that each bucket is written to; `None` if it must not get another point.
    files: Vec<Option<&'a PointFile>>,
    /// Points that a buffer holds.
    capacity: usize,
    open: Vec<Mutex<OpenBucket>>,
    /// Whether a bucket without a file got a point.
    has_refused: AtomicBool,
    has_digests: bool,
}

#[derive(Default)]
struct OpenBucket {
    buffer: Vec<Point>,
    run: PointRun,
    bucket: Bucket,
}

impl<'a> Buckets<'a> {
    /// Returns `count` empty buckets in one file that together buffer at most `memory` bytes.
    pub fn new(file: &'a PointFile, count: usize, memory: u64) -> Buckets<'a> {
        Buckets::on(vec![Some(file); count], memory)
    }

    /// Returns an empty bucket for each of `files`, which is where it is written to. Together they buffer at most `memory` bytes. A bucket
    /// without a file refuses points.
    pub fn on(files: Vec<Option<&'a PointFile>>, memory: u64) -> Buckets<'a> {
        let count = files.len();
        let room = memory / count as u64 / size_of::<Point>() as u64;
        let capacity = (room / PIECE * PIECE).clamp(LEAST_BLOCK, LARGEST_BLOCK) as usize;
        Buckets {
            files,
            capacity,
            open: (0..count).map(|_| Mutex::default()).collect(),
            has_refused: AtomicBool::new(false),
            has_digests: false,
        }
    }

    /// Returns the same buckets, with a digest of the points in each if `wanted`.
    #[must_use]
    pub fn with_digests(self, wanted: bool) -> Buckets<'a> {
        Buckets { has_digests: wanted, ..self }
    }

    /// Returns the bytes of one buffer where memory is ample.
    pub fn largest_buffer() -> u64 {
        LARGEST_BLOCK * size_of::<Point>() as u64
    }

    /// Adds `points`, which all belong to bucket `index`.
    ///
    /// # Errors
    /// [`Error::Io`] if a full buffer cannot be written, [`Error::Broken`] if the bucket has no file: see [`Buckets::has_refused`].
    pub fn extend(&self, index: usize, mut points: &[Point]) -> Result<()> {
        let mut open = lock(&self.open[index]);
        while !points.is_empty() {
            if open.buffer.capacity() == 0 {
                open.buffer.reserve_exact(self.capacity);
            }
            let (now, later) = points.split_at(points.len().min(self.capacity - open.buffer.len()));
            open.buffer.extend_from_slice(now);
            points = later;
            if open.buffer.len() == self.capacity {
                self.flush(index, &mut open, false)?;
            }
        }
        Ok(())
    }

    fn flush(&self, index: usize, open: &mut OpenBucket, is_last: bool) -> Result<()> {
        let file = self.files[index].ok_or_else(|| {
            self.has_refused.store(true, Ordering::Relaxed);
            Error::Broken("a bucket without a file gets points".into())
        })?;
        let block = file.append(&mut open.run, &open.buffer, is_last)?;
        open.bucket.blocks.push(block);
        open.bucket.points += block.points as u64;
        if self.has_digests {
            let points = open.buffer.iter().map(|point| xxh3_64(bytemuck::bytes_of(point)));
            open.bucket.digest = points.fold(open.bucket.digest, u64::wrapping_add);
        }
        open.buffer.clear();
        Ok(())
    }

    /// Tells whether a bucket without a file got a point.
    pub fn has_refused(&self) -> bool {
        self.has_refused.load(Ordering::Relaxed)
    }

    /// Writes what is still in the buffers and returns the buckets.
    ///
    /// # Errors
    /// [`Error::Io`] if a buffer cannot be written, [`Error::Broken`] as for [`Buckets::extend`].
    pub fn finish(&self) -> Result<Vec<Bucket>> {
        let finish = |(index, open): (usize, &Mutex<OpenBucket>)| {
            let mut open = lock(open);
            if !open.buffer.is_empty() {
                self.flush(index, &mut open, true)?;
            }
            open.buffer = Vec::new();
            Ok(std::mem::take(&mut open.bucket))
        };
        self.open.par_iter().enumerate().map(finish).collect()
    }
}

fn lock(open: &Mutex<OpenBucket>) -> MutexGuard<'_, OpenBucket> {
    open.lock().unwrap_or_else(PoisonError::into_inner)
}
