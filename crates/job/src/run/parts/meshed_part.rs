//! What is known of a part once it is meshed.

use crate::index::TileIndex;
use crate::mesh::leaf::LeafStats;
use crate::tiles::write_tile::TileStats;
use serde::{Deserialize, Serialize};

/// What is known of a part once it is meshed.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct MeshedPart {
    /// Points before duplicates are dropped.
    pub(crate) points: u64,
    pub(crate) leaves: LeafStats,
    /// The tiles that are written.
    pub(crate) tiles: TileStats,
    /// The tiles that wait for other parts.
    pub(crate) waiting: Vec<TileIndex>,
    /// Those among them that merges above the part may change.
    pub(crate) open: Vec<TileIndex>,
    /// The most bytes of temporary files while it was meshed: its own, the points of later parts, and what earlier parts keep.
    pub(crate) temporary: u64,
    /// Whether a task meshed it, which knows nothing of other parts' files.
    pub(crate) by_task: bool,
    /// Bytes that its store keeps.
    pub(crate) stored: u64,
}
