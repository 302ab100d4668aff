//! What blocks take of the memory, and which of them may stay there from round to round. That changes how often they are read, and nothing else.

use crate::source::{BYTES_PER_LOADED, BYTES_PER_TRIANGULATED, BYTES_PER_WAITING};
use std::sync::atomic::{AtomicU64, Ordering};

/// The memory of a selection.
#[derive(Debug)]
pub(crate) struct BlockMemory {
    /// The bytes that all blocks together may take.
    limit: u64,
    /// Those that blocks take which stay.
    kept: AtomicU64,
    /// The most that a thread has taken with a block.
    most_of_thread: AtomicU64,
    /// Those of all proposals of this round so far.
    proposed: AtomicU64,
    /// Those of the round before: so much may come in this one.
    proposed_before: AtomicU64,
}

impl BlockMemory {
    pub(crate) fn new(limit: u64) -> BlockMemory {
        let [kept, most_of_thread, proposed, proposed_before] = Default::default();
        BlockMemory { limit, kept, most_of_thread, proposed, proposed_before }
    }

    /// A round begins, and the proposals of the one before are gone.
    pub(crate) fn begin_round(&self) {
        self.proposed_before.store(self.proposed.swap(0, Ordering::Relaxed), Ordering::Relaxed);
    }

    /// A block proposes points, which takes so many bytes until the end of the round.
    pub(crate) fn note_proposal(&self, bytes: u64) {
        self.proposed.fetch_add(bytes, Ordering::Relaxed);
    }

    /// Tells whether the points of a block stay, of which it has so many.
    pub(crate) fn keeps_points(&self, points: u64) -> bool {
        self.note_thread(points * BYTES_PER_LOADED);
        self.keeps(points * BYTES_PER_WAITING, 0)
    }

    /// The points of a block are taken.
    pub(crate) fn take_points(&self, points: u64) {
        self.release(points * BYTES_PER_WAITING);
    }

    /// Tells whether a block of `points` points stays whose triangulation has `sites` sites, and which takes so many `bytes`. All that is selected
    /// takes `selected` bytes.
    pub(crate) fn keeps_block(&self, points: u64, sites: u64, bytes: u64, selected: u64) -> bool {
        self.note_block(points, sites, bytes);
        self.keeps(bytes, selected)
    }

    /// A thread had a block of `points` points whose triangulation has `sites` sites, and which takes so many `bytes`.
    pub(crate) fn note_block(&self, points: u64, sites: u64, bytes: u64) {
        self.note_thread((points * BYTES_PER_LOADED).max(bytes + sites * BYTES_PER_TRIANGULATED));
    }

    /// A block that took so many bytes no longer does.
    pub(crate) fn release(&self, bytes: u64) {
        self.kept.fetch_sub(bytes, Ordering::Relaxed);
    }

    fn note_thread(&self, bytes: u64) {
        self.most_of_thread.fetch_max(bytes, Ordering::Relaxed);
    }

    fn keeps(&self, bytes: u64, selected: u64) -> bool {
        let of_threads = rayon::current_num_threads() as u64 * self.most_of_thread.load(Ordering::Relaxed);
        let proposed = self.proposed.load(Ordering::Relaxed).max(self.proposed_before.load(Ordering::Relaxed));
        let kept = self.kept.fetch_add(bytes, Ordering::Relaxed) + bytes;
        let stays = kept + of_threads + selected + proposed <= self.limit;
        if !stays {
            self.release(bytes);
        }
        stays
    }
}
