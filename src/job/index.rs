//! The numbers of tiles and of tree nodes, as types that cannot be mixed up.

use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};
use std::fmt;

/// The number of a tile, which is a leaf of the tree. Tiles are numbered in depth-first order.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable, Serialize, Deserialize)]
#[serde(transparent)]
pub struct TileIndex(pub u32);

/// The number of a node of the tree, leaf or inner. Node 0 is the root; a node comes after its parent.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable, Serialize, Deserialize)]
#[serde(transparent)]
pub struct NodeIndex(pub u32);

impl TileIndex {
    /// Returns the tile at position `index` of a list of all tiles.
    pub fn new(index: usize) -> TileIndex {
        TileIndex(index as u32)
    }

    /// Returns the position in a list of all tiles.
    pub fn get(self) -> usize {
        self.0 as usize
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
