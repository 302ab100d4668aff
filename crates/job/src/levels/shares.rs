//! How many vertices each of the finest coarser tiles gets. A fifth of its own would be too few for a wood and too many for a field beside it,
//! so those that are near each other share theirs.

use crate::index::TileIndex;
use crate::levels::hierarchy::{ChildTile, Hierarchy, LevelSizes};
use crate::records::{ExactTile, Store};
use sys::Result;
use tiles::lod::relief::Relief;

/// Of [`OF`] vertices so many are given to each tile by its size, the others to where vertices stand out furthest. With fewer, flat tiles have so few that
/// viewers show exact ones in their place from far; with more, the level is further from the exact mesh.
const EVENLY: u64 = 1;
const OF: u64 = 5;

/// The most times its own number of vertices that a tile gets.
const MOST_TIMES: u64 = 3;

/// What a tile gets, and what it would get if none shared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Share {
    vertices: u64,
    own: u64,
}

impl Share {
    /// That of a tile that shares with none.
    const WHOLE: Share = Share { vertices: 1, own: 1 };

    /// Returns the triangles of a tile that would have `triangles` without sharing.
    pub(crate) fn of(self, triangles: usize) -> usize {
        ((triangles as u64).saturating_mul(self.vertices) / self.own.max(1)).max(1) as usize
    }
}

/// Returns the share of coarser tile `index`, all of whose exact neighbours are in `store`.
///
/// # Errors
/// [`sys::Error::Io`] or [`sys::Error::Broken`] on the store.
pub(crate) fn share_of(store: &Store, hierarchy: &Hierarchy, sizes: LevelSizes, index: usize) -> Result<Share> {
    let (mut all, mut wanted, mut own) = (Relief::default(), 0, (Relief::default(), 0));
    for &near in &hierarchy.tiles[index].sharing {
        let exact = hierarchy.tiles[near].children.iter().filter_map(|&child| exact(child));
        let (relief, vertices) = of_exact(store, exact)?;
        let even = sizes.target(2 * vertices as usize) as u64 / 2;
        all.add(&relief);
        wanted += even;
        if near == index {
            own = (relief, even);
        }
    }
    let (relief, even) = own;
    if even == wanted {
        return Ok(Share::WHOLE);
    }
    let by_relief = Relief::share(&relief, &all, wanted - wanted * EVENLY / OF);
    let most = (MOST_TIMES * even).min(sizes.most_sites().max(even));
    Ok(Share { vertices: (even * EVENLY / OF + by_relief).min(most), own: even })
}

/// Returns an exact tile's number.
fn exact(child: ChildTile) -> Option<TileIndex> {
    if let ChildTile::Exact(tile) = child { Some(tile) } else { None }
}

/// Returns the relief of exact tiles together, and the number of their vertices.
fn of_exact(store: &Store, tiles: impl Iterator<Item = TileIndex>) -> Result<(Relief, u64)> {
    let (mut all, mut vertices) = (Relief::default(), 0);
    for tile in tiles {
        let ExactTile { summary, relief } = ExactTile::load(store, tile)?;
        all.add(&relief);
        vertices += u64::from(summary.vertices);
    }
    Ok((all, vertices))
}
