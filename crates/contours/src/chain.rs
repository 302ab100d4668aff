//! Pieces of contour lines within a tile.

use crate::edge_key::EdgeKey;
use bytemuck::{Pod, Zeroable};
use std::ops::Range;

const CLOSED: u32 = 1;
const AROUND_PEAK: u32 = 2;

/// A piece of a contour line: from edge to edge of a tile, or a whole ring. It has plain bytes, so that it can wait in a file.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Chain {
    /// The edge of the triangulation that it begins on.
    pub start: EdgeKey,
    /// The edge that it ends on.
    pub end: EdgeKey,
    /// The least of its edges. A ring begins there.
    pub least: EdgeKey,
    /// The place of its first point. In a [`Band`] that is a number of [`Band::points`].
    pub at: u64,
    /// How many points it has.
    pub points: u32,
    /// The number of the point on the least edge.
    pub least_at: u32,
    flags: u32,
    padding: u32,
}

impl Chain {
    pub(crate) fn new([start, end]: [EdgeKey; 2], least: EdgeKey, least_at: u32, points: Range<usize>) -> Chain {
        let (at, count) = (points.start as u64, points.len() as u32);
        Chain { start, end, least, at, points: count, least_at, flags: 0, padding: 0 }
    }

    /// Says that its first point is at another place.
    pub fn moved_to(self, at: u64) -> Chain {
        Chain { at, ..self }
    }

    /// Says whether it is a ring.
    pub(crate) fn closed(self, is_closed: bool) -> Chain {
        Chain { flags: self.flags | if is_closed { CLOSED } else { 0 }, ..self }
    }

    /// Says whether all of its edges have the same high end, which lies at the level itself.
    pub(crate) fn around_peak(self, is_around: bool) -> Chain {
        Chain { flags: self.flags | if is_around { AROUND_PEAK } else { 0 }, ..self }
    }

    /// Tells whether it is a ring.
    pub fn is_closed(&self) -> bool {
        self.flags & CLOSED != 0
    }

    /// Tells whether all of its edges have the same high end, which lies at the level itself.
    pub fn is_around_peak(&self) -> bool {
        self.flags & AROUND_PEAK != 0
    }
}

/// The chains of some neighbouring levels in a tile.
#[derive(Debug, Default)]
pub struct Band {
    /// The number of the first level.
    pub first_level: u32,
    /// The chains of all levels, those of the first level first.
    pub chains: Vec<Chain>,
    /// The number of the first chain of each level, and the number of all chains.
    pub starts: Vec<u64>,
    /// The points of all chains, in their order: x and y in source units.
    pub points: Vec<[f64; 2]>,
}

impl Band {
    /// Returns the chains of level number `level`, which must be one of the band.
    pub fn chains_of(&self, level: u32) -> &[Chain] {
        let number = (level - self.first_level) as usize;
        &self.chains[self.starts[number] as usize..self.starts[number + 1] as usize]
    }

    /// Returns the numbers of its levels.
    pub fn levels(&self) -> Range<u32> {
        self.first_level..self.first_level + self.starts.len().saturating_sub(1) as u32
    }
}
