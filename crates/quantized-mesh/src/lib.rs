//! Terrain tiles in the format quantized-mesh 1.0, cut from a triangulation, for globes such as CesiumJS.
//!
//! - [`cut`] clips triangles to the tiles of the finest zoom. All crossings of an edge with a border are computed from the edge and the border
//!   alone, in whole numbers, so that tiles on both sides of a border have the same vertices there.
//! - [`assemble`] joins the [`Piece`]s of a tile. What the terrain does not cover is filled, because a globe has no holes.
//! - [`coarser`] selects vertices of four tiles for the tile above them, within the bound of its zoom ([`LEVEL_ZERO_ERROR`]).
//! - [`encode`] writes the bytes of a tile, and [`decode`] reads them. [`layer`] lists the tiles.
//!
//! Tiles depend on the triangulation alone, not on how it was divided or in which order pieces came.

#![warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable)]

mod assemble;
mod bound;
mod coarser;
mod cut;
mod decode;
mod encode;
mod fill;
mod groups;
mod halves;
mod header;
mod layer;
mod mesh;
mod normals;
mod number_hash;
mod place;
mod refine;
mod rough;
mod scheme;
mod side;
#[cfg(test)]
mod tests;
mod tile;
mod unfold;
mod water;

pub use assemble::assemble;
pub use bound::{FIRST_SURROUNDED_ZOOM, LEVEL_ZERO_ERROR, finest_zoom};
pub use coarser::{Child, coarser, flat};
pub use cut::{Piece, cut};
pub use decode::{DecodedTile, NotATile, decode};
pub use encode::{HeightSteps, Surface, encode};
pub use layer::{LayerAbout, ZoomTiles, layer};
pub use mesh::{Node, OUTSIDE, TileMesh};
pub use normals::{BorderNormal, border_normals};
pub use place::{GridPoint, HEIGHT_STEPS, SPAN, TileGrid, height_steps};
pub use scheme::Scheme;
pub use tile::Tile;
pub use water::{Shore, Water};
