//! Blocks that the memory does not hold, in a file: to write a block and to read it again takes far less time than to make it anew.

use crate::block::Block;
use crate::source::SelectionStore;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use sys::Result;

/// The most bytes of a file that the places of blocks have.
pub const MOST_SWAPPED: u64 = 2 << 30;

/// The places of blocks in a file.
#[derive(Debug, Default)]
pub(crate) struct SwapSpace {
    /// How many bytes they have.
    used: AtomicU64,
    /// Places that blocks have left. Not every disk takes their space back.
    left: Mutex<Vec<Place>>,
}

/// A place for so many bytes in a file.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    at: u64,
    bytes: u64,
}

impl SwapSpace {
    /// Returns a place for so many bytes: that of `before`, if it is large enough. `None` if there is no space left.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(crate) fn place(&self, bytes: u64, before: Option<Place>, store: &dyn SelectionStore) -> Result<Option<Place>> {
        if let Some(place) = before {
            if bytes <= place.bytes {
                return Ok(before);
            }
            self.free(place, store)?;
        }
        let place = self.left_place(bytes).unwrap_or_else(|| {
            // Blocks grow.
            let bytes = bytes + bytes / 4;
            Place { at: store.reserve(bytes), bytes }
        });
        if self.used.fetch_add(place.bytes, Ordering::Relaxed) + place.bytes > MOST_SWAPPED {
            self.free(place, store)?;
            return Ok(None);
        }
        Ok(Some(place))
    }

    /// Gives the space of a place back.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(crate) fn free(&self, Place { at, bytes }: Place, store: &dyn SelectionStore) -> Result<()> {
        self.used.fetch_sub(bytes, Ordering::Relaxed);
        // Before another block may write there.
        store.free(at, bytes)?;
        self.left.lock().unwrap_or_else(PoisonError::into_inner).push(Place { at, bytes });
        Ok(())
    }

    /// Returns the smallest place for so many bytes that a block has left.
    fn left_place(&self, bytes: u64) -> Option<Place> {
        let mut left = self.left.lock().unwrap_or_else(PoisonError::into_inner);
        let (number, _) =
            left.iter().enumerate().filter(|(_, place)| place.bytes >= bytes).min_by_key(|(_, place)| place.bytes)?;
        Some(left.swap_remove(number))
    }
}

/// A block whose columns are in a file.
pub(crate) struct SwappedBlock {
    /// The block with empty columns.
    block: Block,
    lengths: Vec<usize>,
    place: Place,
}

impl SwappedBlock {
    /// Writes a block to a place that is large enough.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(crate) fn write(mut block: Block, place: Place, store: &dyn SelectionStore) -> Result<SwappedBlock> {
        let columns = block.columns();
        let lengths = columns.iter().map(|column| column.length()).collect();
        let mut at = place.at;
        for column in columns {
            store.write(at, column.bytes())?;
            at += column.bytes().len() as u64;
            column.clear();
        }
        Ok(SwappedBlock { block, lengths, place })
    }

    /// Reads the block.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(crate) fn read(self, store: &dyn SelectionStore) -> Result<Block> {
        let SwappedBlock { mut block, lengths, place } = self;
        let mut at = place.at;
        for (column, length) in block.columns().into_iter().zip(lengths) {
            let bytes = column.filled(length);
            store.read(at, bytes)?;
            at += bytes.len() as u64;
        }
        Ok(block)
    }
}
