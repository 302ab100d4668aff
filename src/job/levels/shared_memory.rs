//! The memory that coarser tiles share while they are made: each takes what it needs, and waits until that much is free.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

/// A number of bytes, some of them taken.
pub struct SharedMemory {
    total: u64,
    free: Mutex<u64>,
    returned: Condvar,
}

/// Bytes that are taken until this is dropped.
pub struct Taken<'a> {
    from: &'a SharedMemory,
    bytes: u64,
}

impl SharedMemory {
    /// Returns `total` bytes, all free.
    pub fn new(total: u64) -> SharedMemory {
        SharedMemory { total, free: Mutex::new(total), returned: Condvar::new() }
    }

    /// Takes `bytes`, once they are free. Returns `None` if they are more than there are. A thread that holds some must not take more.
    pub fn take(&self, bytes: u64) -> Option<Taken<'_>> {
        if bytes > self.total {
            return None;
        }
        let wait = self.returned.wait_while(self.free(), |free| *free < bytes);
        *wait.unwrap_or_else(PoisonError::into_inner) -= bytes;
        Some(Taken { from: self, bytes })
    }

    fn free(&self) -> MutexGuard<'_, u64> {
        self.free.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Taken<'_> {
    fn drop(&mut self) {
        *self.from.free() += self.bytes;
        self.from.returned.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicU64, Ordering};

    #[test]
    fn no_more_is_taken_at_one_time_than_there_is() {
        let (memory, held, most) = (SharedMemory::new(100), AtomicU64::new(0), AtomicU64::new(0));
        std::thread::scope(|scope| {
            for thread in 0..8 {
                let (memory, held, most) = (&memory, &held, &most);
                scope.spawn(move || {
                    for i in 0..200 {
                        let bytes = 20 + (7 * thread + 13 * i) % 80;
                        let taken = memory.take(bytes).unwrap();
                        most.fetch_max(held.fetch_add(bytes, Ordering::SeqCst) + bytes, Ordering::SeqCst);
                        std::thread::yield_now();
                        held.fetch_sub(bytes, Ordering::SeqCst);
                        drop(taken);
                    }
                });
            }
        });
        assert!((20..=100).contains(&most.into_inner()));
        assert_eq!(*memory.free(), 100);
    }

    #[test]
    fn nobody_waits_for_more_than_there_is() {
        let memory = SharedMemory::new(100);
        assert!(memory.take(101).is_none());
        assert!(memory.take(100).is_some());
    }
}
