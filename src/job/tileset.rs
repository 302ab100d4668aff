//! `tileset.json` from what the steps before have left.

use super::directory::Directory;
use super::export::Look;
use super::levels::bounds_of;
use super::pyramid::{Child, Pyramid};
use super::records::{Level, LevelTile};
use super::store::Store;
use crate::output::read::read_tile;
use crate::output::tileset::{Node, tileset_json};
use crate::{Error, Result};

/// The root of the tiles, none of them placed on the globe yet.
///
/// # Errors
/// [`Error::Io`] on the output or the job directory, [`Error::Broken`] if there is no tile.
pub fn root(directory: &Directory, store: &Store, pyramid: &Pyramid, look: &Look) -> Result<Node> {
    let root = match pyramid.inner.len().checked_sub(1) {
        Some(last) => inner_node(store, pyramid, last)?,
        None => single_node(directory, look)?,
    };
    root.ok_or_else(|| Error::Broken("there is no tile to list in tileset.json".into()))
}

/// The text of `tileset.json`.
pub fn text(look: &Look, root: &Node) -> String {
    let mut text = tileset_json(&look.frame, root).to_string();
    text.push('\n');
    text
}

fn inner_node(store: &Store, pyramid: &Pyramid, at: usize) -> Result<Option<Node>> {
    let inner = &pyramid.inner[at];
    let Level { own, leaves } = Level::load(store, inner.node)?;
    let mut leaves = leaves.iter();
    let mut children = Vec::new();
    for &child in &inner.children {
        children.extend(match child {
            Child::Inner(below) => inner_node(store, pyramid, below)?,
            Child::Leaf(tile) => leaves.next().and_then(|leaf| node(leaf, format!("tiles/{tile:06}.glb"))),
        });
    }
    let node = node(&own, format!("levels/{:06}.glb", inner.node));
    Ok(node.map(|node| Node { children, ..node }))
}

fn node(tile: &LevelTile, uri: String) -> Option<Node> {
    let uri = (tile.content > 0).then_some(uri);
    Some(Node { uri, bounds: tile.bounds()?, error: tile.error, transform: None, children: Vec::new() })
}

/// The only tile of a small job.
fn single_node(directory: &Directory, look: &Look) -> Result<Option<Node>> {
    let bounds = bounds_of(&read_tile(&directory.tile(0))?, look);
    Ok(node(&LevelTile::new(bounds, true), "tiles/000000.glb".into()))
}
