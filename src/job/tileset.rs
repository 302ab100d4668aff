//! `tileset.json` from what the steps before have left.

use super::export::Look;
use super::pyramid::{Child, Pyramid};
use super::records::{Level, LevelTile};
use super::store::Store;
use crate::output::tileset::{Node, tileset_json};
use crate::{Error, Result};

/// The text of `tileset.json`.
///
/// # Errors
/// [`Error::Io`] on the output or the job directory, [`Error::Broken`] if there is no tile.
pub fn text(store: &Store, pyramid: &Pyramid, look: &Look, transform: Option<[f64; 16]>) -> Result<String> {
    let root = match pyramid.inner.len().checked_sub(1) {
        Some(last) => inner_node(store, pyramid, last)?,
        // The only tile of a small job.
        None => node(&LevelTile::load(store, 0)?, tile_uri(0)),
    };
    let root = root.ok_or_else(|| Error::Broken("there is no tile to list in tileset.json".into()))?;
    let mut text = tileset_json(&look.frame, &root, transform).to_string();
    text.push('\n');
    Ok(text)
}

fn inner_node(store: &Store, pyramid: &Pyramid, at: usize) -> Result<Option<Node>> {
    let inner = &pyramid.inner[at];
    let Level { own, leaves } = Level::load(store, inner.node)?;
    let mut leaves = leaves.iter();
    let mut children = Vec::new();
    for &child in &inner.children {
        children.extend(match child {
            Child::Inner(below) => inner_node(store, pyramid, below)?,
            Child::Leaf(tile) => leaves.next().and_then(|leaf| node(leaf, tile_uri(tile))),
        });
    }
    let node = node(&own, format!("levels/{:06}.glb", inner.node));
    Ok(node.map(|node| Node { children, ..node }))
}

fn node(tile: &LevelTile, uri: String) -> Option<Node> {
    let uri = (tile.content > 0).then_some(uri);
    Some(Node { uri, bounds: tile.bounds()?, error: tile.error, children: Vec::new() })
}

fn tile_uri(tile: usize) -> String {
    format!("tiles/{tile:06}.glb")
}
