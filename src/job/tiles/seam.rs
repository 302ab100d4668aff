//! The seam of a tile: the triangles that merge nodes above it made final and that touch it.

use crate::Result;
use crate::job::partition::tree::Tree;
use crate::job::records::{Seam, SeamTriangle, Store};
use crate::job::tiles::dependencies::FinishedTile;

/// Reads all triangles of seams that touch a tile.
///
/// # Errors
/// [`crate::Error::Io`] or [`crate::Error::Broken`] on the store.
pub fn seam_of(store: &Store, tree: &Tree, finished: FinishedTile) -> Result<Vec<SeamTriangle>> {
    let FinishedTile { tile, last_merge } = finished;
    let mut seam = Vec::new();
    // A node above has a lower number.
    for node in tree.merges_above(tree.leaf(tile)).take_while(|&node| node >= last_merge) {
        seam.extend(Seam::touching(store, node, tile)?);
    }
    Ok(seam)
}
