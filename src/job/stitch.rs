//! Step 5 of a job, by tile: finish the normals of the tile's frontier with the triangles of the seams above it, so that
//! every tile that shares a vertex writes the same normal.

use super::records::{Frontier, Rim, RimDraft, RimVertex, RimVertices, Seam, SeamTriangle};
use super::store::Store;
use super::tree::Tree;
use crate::output::frame::Frame;
use crate::output::normals;
use crate::{Error, Result};

/// Leaves the finished frontier of `tile` in the store.
///
/// # Errors
/// [`crate::Error::Io`] or [`crate::Error::Broken`] on the store.
pub fn run(store: &Store, tree: &Tree, tile: usize, frame: &Frame) -> Result<()> {
    let frontier = Frontier::load(store, tree.leaves[tile])?;
    let RimDraft { mut sums, rgb, class } = RimDraft::load(store, tile)?;
    for [a, b, c] in seam_of(store, tree, tile)? {
        let normal = normals::cross(a.position, b.position, c.position);
        for corner in [a, b, c].iter().filter(|corner| corner.tile as usize == tile) {
            let at = frontier.sites.binary_search(corner);
            let at = at.map_err(|_| Error::Broken(format!("a seam uses a site that tile {tile} does not hand up")))?;
            sums[at] = normals::add(sums[at], normal);
        }
    }
    let finish = |(at, rim): (usize, &Rim)| RimVertex {
        site: rim.site,
        normal: normals::finish(sums[at], frame),
        rgb: rgb[at],
        class: class[at] as u16,
    };
    RimVertices(frontier.sites.iter().enumerate().map(finish).collect()).save(store, tile)
}

/// All triangles of the seams that touch `tile`.
///
/// # Errors
/// [`crate::Error::Io`] or [`crate::Error::Broken`] on the store.
pub fn seam_of(store: &Store, tree: &Tree, tile: usize) -> Result<Vec<SeamTriangle>> {
    let mut seam = Vec::new();
    for node in tree.merges_above(tree.leaves[tile]) {
        seam.extend(Seam::touching(store, node, tile)?);
    }
    Ok(seam)
}
