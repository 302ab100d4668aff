//! The tree of tiles in `tileset.json`, from what the tiles and levels stored.

use crate::geometry::Bounds;
use crate::job::index::TileIndex;
use crate::job::levels::hierarchy::{ChildTile, Hierarchy};
use crate::job::partition::tree::{Cell, Tree};
use crate::job::records::{LevelSummary, Store, TileSummary};
use crate::output::file_names::{level_uri, tile_uri};
use crate::output::tiles3d::tileset::TilesetNode;
use crate::{Error, Result};

/// Returns the root of the tiles, none of them placed on the globe yet.
///
/// # Errors
/// [`Error::Io`] on the store, [`Error::Broken`] if there is no tile.
pub fn tileset_root(store: &Store, tree: &Tree, hierarchy: &Hierarchy) -> Result<TilesetNode> {
    let root = match hierarchy.tiles.len().checked_sub(1) {
        Some(last) => coarse_node(store, tree, hierarchy, last)?,
        // A small job has one tile.
        None => node(&TileSummary::load(store, TileIndex(0))?, &Cell::PLANE, tile_uri(0)),
    };
    root.ok_or_else(|| Error::Broken("there is no tile to list in tileset.json".into()))
}

fn coarse_node(store: &Store, tree: &Tree, hierarchy: &Hierarchy, index: usize) -> Result<Option<TilesetNode>> {
    let coarse = &hierarchy.tiles[index];
    let LevelSummary { own, leaves } = LevelSummary::load(store, coarse.node)?;
    let mut leaves = leaves.iter();
    let mut children = Vec::new();
    for &child in &coarse.children {
        children.extend(match child {
            ChildTile::Coarse(below) => coarse_node(store, tree, hierarchy, below)?,
            ChildTile::Exact(tile) => {
                let cell = &tree.node(tree.leaf(tile)).cell;
                leaves.next().and_then(|leaf| node(leaf, cell, tile_uri(tile.get())))
            }
        });
    }
    let node = node(&own, &tree.node(coarse.node).cell, level_uri(coarse.node.get()));
    Ok(node.map(|node| TilesetNode { children, ..node }))
}

/// Returns the node of one tile without its children, or `None` if the tile has no triangle.
fn node(tile: &TileSummary, cell: &Cell, uri: String) -> Option<TilesetNode> {
    let (uri, bounds) = ((tile.vertices > 0).then_some(uri), tile.bounds()?);
    let (error, middle) = (tile.error, middle(cell, bounds));
    Some(TilesetNode { uri, bounds, middle, error, transform: None, file: None, children: Vec::new() })
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
