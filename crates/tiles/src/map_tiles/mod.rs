//! `terrain.pmtiles`: the heights of the raster as map tiles, for MapLibre, deck.gl and other web maps.
//!
//! A tile is a picture of [`TILE`] x [`TILE`] pixels in web Mercator whose colours are heights (`encoding.rs`). A pixel of the finest zoom
//! has the height of the raster at its centre, interpolated between four cells (`drawing.rs`); one of a coarser zoom has the mean of the
//! four pixels below it. All tiles stand in one file, a PMTiles archive of version 3 (`archive.rs`).
//!
//! Only plain IEEE operations and `libm` are used, in a fixed order, so the bytes are the same everywhere.

pub mod archive;
pub mod drawing;
pub mod encoding;
pub mod filling;
pub mod image;
pub(crate) mod patch;
pub mod tile_id;
pub mod web_mercator;

/// Pixels along the side of a tile: what MapLibre and deck.gl expect if nobody names another size.
pub const TILE: usize = 512;

/// Leads from a pixel of the finest zoom, counted from the north-west of the map, to a column and a row of the raster. Whole numbers are
/// centres of cells, and of pixels. `None` where the system of the raster has no such place.
pub type PixelWay<'a> = dyn Fn([f64; 2]) -> Option<[f64; 2]> + Sync + 'a;
