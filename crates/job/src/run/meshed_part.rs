//! What is known of a part once it is meshed, and of its tiles.

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
    /// How many tiles it has.
    pub(crate) tiles: usize,
    /// The tiles that merges above the part may change.
    pub(crate) open: Vec<TileIndex>,
    /// Whether all that other tiles than written ones need is still there, too.
    pub(crate) is_kept: bool,
    /// The most bytes of temporary files while it was meshed: its own, the points of later parts, and what earlier parts keep.
    pub(crate) temporary: u64,
    /// Whether a task meshed it, which knows nothing of other parts' files.
    pub(crate) by_task: bool,
    /// Bytes that its store keeps.
    pub(crate) stored: u64,
}

/// Tiles of a part that were written at one time.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct SomeTiles {
    pub(crate) stats: TileStats,
    pub(crate) written: Vec<TileIndex>,
    /// Tiles whose borders are finished, each with the tiles that must be finished before it can be written.
    pub(crate) with_border: Vec<(TileIndex, Vec<TileIndex>)>,
    /// With `--update`, what is known of each tile that has waited for other parts.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) waited: Vec<WaitedTile>,
}

/// What is known of a written tile that merges above its part may have changed, or whose neighbours they may.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct WaitedTile {
    pub(crate) tile: TileIndex,
    pub(crate) stats: TileStats,
    /// A hash of what these merges have of the tile.
    pub(crate) key: u64,
    /// The tiles whose borders it shows.
    pub(crate) neighbours: Vec<TileIndex>,
}

impl SomeTiles {
    /// Adds tiles that were written later.
    pub(crate) fn add(&mut self, later: SomeTiles) {
        self.stats += later.stats;
        self.written.extend(later.written);
        self.with_border.extend(later.with_border);
        self.waited.extend(later.waited);
    }
}
