//! The numbers of parts, tiles and tree nodes, as types that cannot be mixed up.

use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};
use std::fmt;

/// The number of a part of the job. Parts are numbered in the order in which they are done.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable, Serialize, Deserialize)]
#[serde(transparent)]
pub struct PartIndex(pub u32);

/// The number of a tile, which is a leaf of the tree of its part. The tiles of a part are numbered in depth-first order, from
/// [`PartIndex::STRIDE`] times the number of the part on.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable, Serialize, Deserialize)]
#[serde(transparent)]
pub struct TileIndex(pub u32);

/// The number of a node of a tree, leaf or inner. Node 0 is the root; a node comes after its parent.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable, Serialize, Deserialize)]
#[serde(transparent)]
pub struct NodeIndex(pub u32);

impl PartIndex {
    /// The only part of a small job, and the first one of a large job.
    pub const FIRST: PartIndex = PartIndex(0);

    /// The most parts of a job.
    pub const MOST: usize = 2000;

    /// The most nodes of the tree of a part.
    pub const STRIDE: usize = 1 << 21;

    /// Returns the part at position `index` of a list of all parts.
    pub fn new(index: usize) -> PartIndex {
        PartIndex(index as u32)
    }

    /// Returns the position in a list of all parts.
    pub fn get(self) -> usize {
        self.0 as usize
    }

    /// Returns the tile at position `index` of a list of the tiles of this part.
    pub fn tile(self, index: usize) -> TileIndex {
        TileIndex((self.get() * PartIndex::STRIDE + index) as u32)
    }

    /// Returns the number in the whole job of a node of this part's tree.
    pub fn node_number(self, node: NodeIndex) -> usize {
        self.get() * PartIndex::STRIDE + node.get()
    }
}

impl TileIndex {
    /// Returns the number in the whole job.
    pub fn number(self) -> usize {
        self.0 as usize
    }

    /// Returns the part that has the tile.
    pub fn part(self) -> PartIndex {
        PartIndex::new(self.number() / PartIndex::STRIDE)
    }

    /// Returns the position in a list of the tiles of its part.
    pub fn get(self) -> usize {
        self.number() % PartIndex::STRIDE
    }
}

impl NodeIndex {
    /// The root of the tree.
    pub const ROOT: NodeIndex = NodeIndex(0);

    /// Returns the node at position `index` of a list of all nodes.
    pub fn new(index: usize) -> NodeIndex {
        NodeIndex(index as u32)
    }

    /// Returns the position in a list of all nodes.
    pub fn get(self) -> usize {
        self.0 as usize
    }
}

impl fmt::Display for PartIndex {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl fmt::Display for TileIndex {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl fmt::Display for NodeIndex {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}
