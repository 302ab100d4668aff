//! Step 5 of a job, by tile: finish the normals of the tile's frontier with the triangles of the seams above it, so that
//! every tile that shares a vertex writes the same normal. Triangles that are left out of the terrain count for nothing.

use crate::job::durable::journal::Done;
use crate::job::durable::store::Store;
use crate::job::partition::tree::Tree;
use crate::job::records::{Frontier, Leaf, Rim, RimDraft, RimVertex, RimVertices, Seam, SeamTriangle};
use crate::job::tiles::dependencies::Settled;
use crate::job::tiles::write::Look;
use crate::output::normals::{self, NormalSum, Sums};
use crate::{Error, Result};

/// Leaves the finished frontier of a tile in the store; returns the other tiles that its own triangles have corners in.
///
/// # Errors
/// [`crate::Error::Io`] or [`crate::Error::Broken`] on the store.
pub fn run(store: &Store, tree: &Tree, settled: Settled, look: &Look) -> Result<Done<Vec<u32>>> {
    let tile = settled.tile;
    let frontier = Frontier::load(store, tree.leaves[tile])?;
    let RimDraft { mut sums, rgb, class } = RimDraft::load(store, tile)?;
    if !look.cut.is_nothing() {
        sums = sums_of_written(store, tile, &frontier, look)?;
    }
    let written = |t: &SeamTriangle| !look.cut.leaves_out(t.map(|corner| corner.position));
    let seam = seam_of(store, tree, settled)?;
    for &[a, b, c] in seam.iter().filter(|triangle| written(triangle)) {
        let normal = normals::cross(a.position, b.position, c.position);
        for corner in [a, b, c].iter().filter(|corner| corner.tile as usize == tile) {
            let at = frontier.sites.binary_search_by_key(&corner.site, |rim| rim.site);
            let at = at.map_err(|_| Error::Broken(format!("a seam uses a site that tile {tile} does not hand up")))?;
            sums[at] = normals::add(sums[at], normal);
        }
    }
    let finish = |(at, rim): (usize, &Rim)| RimVertex {
        site: rim.site,
        normal: normals::finish(sums[at], &look.frame),
        rgb: rgb[at],
        class: class[at] as u16,
    };
    let rim = RimVertices(frontier.sites.iter().enumerate().map(finish).collect());
    Ok(Done::new(neighbours(&seam, tile as u32), vec![rim.save(store, tile)?]))
}

/// The other tiles at corners of triangles that `tile` owns.
fn neighbours(seam: &[SeamTriangle], tile: u32) -> Vec<u32> {
    let own = seam.iter().filter(|triangle| owner(triangle) == tile);
    let mut neighbours: Vec<u32> = own.flatten().map(|corner| corner.tile).filter(|&other| other != tile).collect();
    neighbours.sort_unstable();
    neighbours.dedup();
    neighbours
}

/// A triangle belongs to the tile of its lowest-numbered corner.
pub fn owner(triangle: &SeamTriangle) -> u32 {
    triangle[0].tile.min(triangle[1].tile).min(triangle[2].tile)
}

/// The sums over only those of the leaf's triangles that are written.
fn sums_of_written(store: &Store, tile: usize, frontier: &Frontier, look: &Look) -> Result<Vec<NormalSum>> {
    let Leaf { positions, mut triangles, .. } = Leaf::load(store, tile)?;
    look.cut.take(&positions, &mut triangles);
    let sums = Sums::new(&positions, &triangles);
    Ok(frontier.sites.iter().map(|rim| sums.get(rim.site as usize)).collect())
}

/// All triangles of the seams that touch a tile.
///
/// # Errors
/// [`crate::Error::Io`] or [`crate::Error::Broken`] on the store.
pub fn seam_of(store: &Store, tree: &Tree, Settled { tile, by }: Settled) -> Result<Vec<SeamTriangle>> {
    let mut seam = Vec::new();
    // Whoever is above has the lower number.
    for node in tree.merges_above(tree.leaves[tile]).take_while(|&node| node >= by) {
        seam.extend(Seam::touching(store, node, tile)?);
    }
    Ok(seam)
}
