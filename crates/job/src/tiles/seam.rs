//! The seam of a tile: the triangles that merge nodes above it made final and that touch it.

use crate::merge_records::{Seam, SeamOfTile};
use crate::partition::tree::Tree;
use crate::records::{StepRecord, Store};
use crate::tiles::dependencies::FinishedTile;
use sys::Result;

/// Reads what all seams have of a tile.
///
/// # Errors
/// [`sys::Error::Io`] or [`sys::Error::Broken`] on the store.
pub(crate) fn seam_of(store: &Store, tree: &Tree, finished: FinishedTile) -> Result<SeamOfTile> {
    let FinishedTile { tile, last_merge } = finished;
    let (leaf, mut seam) = (tree.leaf(tile), SeamOfTile::default());
    if store.has(StepRecord::Seam(leaf)) {
        // The tile is the whole job.
        seam.add(Seam::touching(store, leaf, tile)?);
    }
    // A node above has a lower number.
    for node in tree.merges_above(leaf).take_while(|&node| node >= last_merge) {
        seam.add(Seam::touching(store, node, tile)?);
    }
    seam.sort();
    Ok(seam)
}
