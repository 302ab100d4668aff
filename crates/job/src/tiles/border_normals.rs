//! Step 5, once for each tile: finishes the normals on the tile's frontier with the triangles of its seam, so that every tile that
//! shares a vertex writes the same normal. Triangles that are left out of the terrain do not count.

use crate::index::TileIndex;
use crate::merge_records::{Frontier, SeamOfTile};
use crate::partition::tree::Tree;
use crate::records::{
    BorderAttributes, BorderVertex, FinishedBorder, Leaf, PartialNormals, SeamTriangle, Store, owner,
};
use crate::tiles::hull_slivers::HullSlivers;
use crate::tiles::style::TileStyle;
use delaunay::mesh::index::SiteIndex;
use sys::{Error, Result};
use tiles::normals;
use tiles::normals::NormalSum;

/// Stores the finished frontier of `tile`, whose seam is `seam`. Returns the other tiles that have corners of the tile's own triangles.
///
/// # Errors
/// [`Error::Io`] or [`Error::Broken`] on the store.
pub(crate) fn finish_border_normals(
    store: &Store,
    tree: &Tree,
    style: &TileStyle,
    tile: TileIndex,
    seam: &SeamOfTile,
) -> Result<Vec<TileIndex>> {
    finished_border(store, tree, style, tile, seam)?.save(store, tile)?;
    Ok(neighbours(&seam.triangles, tile))
}

/// Returns the finished frontier of `tile`, whose seam is `seam`.
///
/// # Errors
/// As [`finish_border_normals`].
pub(crate) fn finished_border(
    store: &Store,
    tree: &Tree,
    style: &TileStyle,
    tile: TileIndex,
    seam: &SeamOfTile,
) -> Result<FinishedBorder> {
    let frontier = Frontier::load(store, tree.leaf(tile))?;
    let PartialNormals { mut sums, rgb, class, intensity } = PartialNormals::load(store, tile)?;
    let slivers = HullSlivers::new(style.hull.as_ref(), &seam.trimmed);
    if !style.keeps_all() || !slivers.is_empty() {
        take_left_out(store, tile, &frontier, &slivers, style, &mut sums)?;
    }
    let is_kept = |t: &SeamTriangle| !style.leaves_out(t.map(|corner| corner.position)) && !slivers.has(t);
    for &[a, b, c] in seam.triangles.iter().filter(|triangle| is_kept(triangle)) {
        let normal = normals::cross(a.position, b.position, c.position);
        for corner in [a, b, c].iter().filter(|corner| corner.tile == tile) {
            let at = frontier.sites.binary_search_by_key(&corner.site, |vertex| vertex.site);
            let at =
                at.map_err(|_| Error::Broken(format!("a seam uses a site that is not in tile {tile}'s frontier")))?;
            sums[at] = normals::add(sums[at], normal);
        }
    }
    let finish = |(at, vertex): (usize, &BorderVertex)| BorderAttributes {
        site: vertex.site,
        normal: normals::unit_normal(sums[at], &style.frame),
        rgb: rgb[at],
        class: class[at] as u16,
    };
    Ok(FinishedBorder { vertices: frontier.sites.iter().enumerate().map(finish).collect(), intensity })
}

/// Returns the other tiles at corners of the triangles that `tile` owns.
fn neighbours(seam: &[SeamTriangle], tile: TileIndex) -> Vec<TileIndex> {
    let own = seam.iter().filter(|triangle| owner(triangle) == tile);
    let mut neighbours: Vec<TileIndex> =
        own.flatten().map(|corner| corner.tile).filter(|&other| other != tile).collect();
    neighbours.sort_unstable();
    neighbours.dedup();
    neighbours
}

/// Takes the normals of those of the leaf's triangles that are left out from the `sums` at its frontier.
fn take_left_out(
    store: &Store,
    tile: TileIndex,
    frontier: &Frontier,
    slivers: &HullSlivers,
    style: &TileStyle,
    sums: &mut [NormalSum],
) -> Result<()> {
    let Leaf { positions, mut triangles, .. } = Leaf::load_mesh(store, tile)?;
    let mut left_out = slivers.take(&positions, &mut triangles);
    left_out.extend(style.take_long(&positions, &mut triangles));
    for triangle in left_out {
        let [a, b, c] = triangle.map(|v| positions[v as usize]);
        let normal = normals::cross(a, b, c);
        for v in triangle.map(SiteIndex) {
            if let Ok(at) = frontier.sites.binary_search_by_key(&v, |vertex| vertex.site) {
                sums[at] = normals::add(sums[at], normal.map(|v| -v));
            }
        }
    }
    Ok(())
}
