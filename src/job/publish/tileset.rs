//! `tileset.json` from what the steps before have left.

use crate::job::durable::store::Store;
use crate::job::levels::hierarchy::{Child, Pyramid};
use crate::job::partition::tree::{Cell, Tree};
use crate::job::records::{Level, LevelTile};
use crate::job::tiles::write::Look;
use crate::output::tiles3d::tileset::{Node, tileset_json};
use crate::{Error, Result};

/// The root of the tiles, none of them placed on the globe yet.
///
/// # Errors
/// [`Error::Io`] on the store, [`Error::Broken`] if there is no tile.
pub fn root(store: &Store, tree: &Tree, pyramid: &Pyramid) -> Result<Node> {
    let root = match pyramid.inner.len().checked_sub(1) {
        Some(last) => inner_node(store, tree, pyramid, last)?,
        // The only tile of a small job.
        None => node(&LevelTile::load(store, 0)?, &Cell::PLANE, tile_uri(0)),
    };
    root.ok_or_else(|| Error::Broken("there is no tile to list in tileset.json".into()))
}

/// The text of `tileset.json`.
pub fn text(look: &Look, root: &Node) -> String {
    let mut text = tileset_json(&look.frame, root).to_string();
    text.push('\n');
    text
}

fn inner_node(store: &Store, tree: &Tree, pyramid: &Pyramid, at: usize) -> Result<Option<Node>> {
    let inner = &pyramid.inner[at];
    let Level { own, leaves } = Level::load(store, inner.node)?;
    let mut leaves = leaves.iter();
    let mut children = Vec::new();
    for &child in &inner.children {
        children.extend(match child {
            Child::Inner(below) => inner_node(store, tree, pyramid, below)?,
            Child::Leaf(tile) => {
                let cell = &tree.nodes[tree.leaves[tile]].cell;
                leaves.next().and_then(|leaf| node(leaf, cell, tile_uri(tile)))
            }
        });
    }
    let node = node(&own, &tree.nodes[inner.node].cell, format!("levels/{:06}.glb", inner.node));
    Ok(node.map(|node| Node { children, ..node }))
}

fn node(tile: &LevelTile, cell: &Cell, uri: String) -> Option<Node> {
    let (uri, bounds) = ((tile.content > 0).then_some(uri), tile.bounds()?);
    let (error, middle) = (tile.error, middle(cell, bounds));
    Some(Node { uri, bounds, middle, error, transform: None, children: Vec::new() })
}

/// The middle of what a tile has in its cell, or else of all that it has. A triangle along the hull can be as long as the whole
/// terrain; the tile's other triangles are where its cell is.
fn middle(cell: &Cell, bounds: [[i32; 3]; 2]) -> [i32; 2] {
    [0, 1].map(|k| {
        let [low, high] = bounds.map(|corner| corner[k] as i64);
        let (own_low, own_high) = (low.max(cell.min[k]), high.min(cell.max[k] - 1));
        let (low, high) = if own_low <= own_high { (own_low, own_high) } else { (low, high) };
        (low + (high - low) / 2) as i32
    })
}

fn tile_uri(tile: usize) -> String {
    format!("tiles/{tile:06}.glb")
}
