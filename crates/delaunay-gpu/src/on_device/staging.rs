//! What came back from an atlas, as workers read it: where the device has written it, so that the GPU's thread copies nothing. The staging
//! buffer goes back to the engine once every leaf has been read.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use wgpu::{Buffer, BufferView};

/// Staging buffers that are lent, or were lent and have come back.
pub(super) struct StagingPool {
    spare: Mutex<Vec<Buffer>>,
    /// The bytes of all buffers of the pool, lent or not.
    bytes: AtomicU64,
    /// The most bytes that they may have. Beyond that, each leaf is copied.
    most: u64,
}

impl StagingPool {
    /// Returns a pool without buffers, for at most `most` bytes.
    pub(super) fn new(most: u64) -> StagingPool {
        StagingPool { spare: Mutex::default(), bytes: AtomicU64::new(0), most }
    }

    /// Returns a pool for another device.
    pub(super) fn successor(&self) -> StagingPool {
        StagingPool::new(self.most)
    }

    /// Counts `buffer`, which is lent from now on. Returns whether it may stay with those who read it: beyond the limit, they must copy
    /// what they need at once.
    pub(super) fn lend(&self, buffer: &Buffer) -> bool {
        let mut bytes = self.bytes.fetch_add(buffer.size(), Ordering::AcqRel) + buffer.size();
        // Buffers that nobody reads make room.
        while bytes > self.most
            && buffer.size() <= self.most
            && let Some(spare) = self.take_spare(0)
        {
            bytes -= spare.size();
        }
        bytes <= self.most
    }

    /// Frees the buffers that nobody reads.
    pub(super) fn free_spares(&self) {
        while self.take_spare(0).is_some() {}
    }

    /// Takes a buffer that has come back out of the pool: the smallest one of at least `bytes` bytes, else the largest one.
    pub(super) fn take_spare(&self, bytes: u64) -> Option<Buffer> {
        let mut spare = self.spare.lock().unwrap_or_else(PoisonError::into_inner);
        let order = |&i: &usize| {
            let size = spare[i].size();
            if size >= bytes { (0, size) } else { (1, u64::MAX - size) }
        };
        let best = (0..spare.len()).min_by_key(order)?;
        let buffer = spare.swap_remove(best);
        self.bytes.fetch_sub(buffer.size(), Ordering::AcqRel);
        Some(buffer)
    }
}

/// The numbers in a staging buffer that is mapped.
pub(super) struct LentNumbers {
    /// `None` once the buffer goes back.
    view: Option<BufferView>,
    buffer: Buffer,
    pool: Arc<StagingPool>,
}

impl LentNumbers {
    /// Lends `view`, which is all that is mapped of `buffer`, which `pool` has counted.
    pub(super) fn new(view: BufferView, buffer: Buffer, pool: Arc<StagingPool>) -> LentNumbers {
        LentNumbers { view: Some(view), buffer, pool }
    }
}

impl AsRef<[u32]> for LentNumbers {
    fn as_ref(&self) -> &[u32] {
        let bytes = self.view.as_deref().unwrap_or_default();
        // Mapped memory is aligned. If it were not, there would be no numbers, and the leaves would be done without the device.
        bytemuck::try_cast_slice(bytes).unwrap_or_default()
    }
}

impl Drop for LentNumbers {
    fn drop(&mut self) {
        self.view = None;
        self.buffer.unmap();
        self.pool.spare.lock().unwrap_or_else(PoisonError::into_inner).push(self.buffer.clone());
    }
}
