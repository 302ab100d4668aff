//! The tree of tiles in `tileset.json`, from what the tiles and levels stored.

use crate::index::{NodeIndex, PartIndex};
use crate::levels::hierarchy::{ChildTile, Hierarchy};
use crate::partition::tree::{Cell, Tree};
use crate::records::{ExactTile, LevelSummary, Store, TileSummary};
use delaunay::geometry::Bounds;
use sys::Result;
use tiles::file_names::{level_uri, tile_uri};
use tiles::tiles3d::tileset::TilesetNode;

/// The tiles over one tree, and what is known of them.
pub(crate) struct TilesOfTree<'a> {
    /// Has what the steps stored.
    pub store: &'a Store,
    /// The tree.
    pub tree: &'a Tree,
    /// The coarser tiles over it.
    pub hierarchy: &'a Hierarchy,
    /// Returns the root of the tiles of a part, if the leaves of the tree are parts.
    pub part_root: &'a dyn Fn(PartIndex) -> Result<Option<TilesetNode>>,
}

impl TilesOfTree<'_> {
    /// Returns the root of the tiles, none of them placed on the globe yet; `None` if there is no triangle.
    ///
    /// # Errors
    /// [`sys::Error::Io`] or [`sys::Error::Broken`] on the store.
    pub(crate) fn root(&self) -> Result<Option<TilesetNode>> {
        if let Some(last) = self.hierarchy.tiles.len().checked_sub(1) {
            return self.coarse_node(last);
        }
        // Few points make one tile.
        let tile = self.tree.part.tile(0);
        Ok(node(
            &ExactTile::load(self.store, tile)?.summary,
            &self.tree.node(NodeIndex::ROOT).cell,
            tile_uri(tile.number()),
        ))
    }

    fn coarse_node(&self, index: usize) -> Result<Option<TilesetNode>> {
        let coarse = &self.hierarchy.tiles[index];
        let LevelSummary { own, leaves } = LevelSummary::load(self.store, coarse.node)?;
        let mut leaves = leaves.iter();
        let mut children = Vec::new();
        for &child in &coarse.children {
            children.extend(match child {
                ChildTile::Coarse(below) => self.coarse_node(below)?,
                ChildTile::Part(part) => (self.part_root)(part)?,
                ChildTile::Exact(tile) => {
                    let cell = &self.tree.node(self.tree.leaf(tile)).cell;
                    leaves.next().and_then(|leaf| node(leaf, cell, tile_uri(tile.number())))
                }
            });
        }
        let uri = level_uri(self.tree.part.node_number(coarse.node));
        let node = node(&own, &self.tree.node(coarse.node).cell, uri);
        Ok(node.map(|node| TilesetNode { children, ..node }))
    }
}

/// Returns the node of one tile without its children, or `None` if the tile has no triangle.
fn node(tile: &TileSummary, cell: &Cell, uri: String) -> Option<TilesetNode> {
    let (uri, bounds, drawn) = ((tile.vertices > 0).then_some(uri), tile.bounds()?, tile.drawn()?);
    let (error, greatest_error, middle) = (tile.error, tile.greatest_error, middle(cell, bounds));
    let (transform, file, children) = (None, None, Vec::new());
    Some(TilesetNode { uri, bounds, drawn, middle, error, greatest_error, transform, file, children })
}

/// Returns the middle of the part of `bounds` in the tile's cell, or of all of it if no part is. A triangle along the hull can be as
/// long as the whole terrain, but the tile's other triangles are in its cell.
fn middle(cell: &Cell, bounds: Bounds<3>) -> [i32; 2] {
    [0, 1].map(|axis| {
        let (low, high) = (bounds.min[axis] as i64, bounds.max[axis] as i64);
        let (own_low, own_high) = (low.max(cell.min[axis]), high.min(cell.max[axis] - 1));
        let (low, high) = if own_low <= own_high { (own_low, own_high) } else { (low, high) };
        (low + (high - low) / 2) as i32
    })
}
