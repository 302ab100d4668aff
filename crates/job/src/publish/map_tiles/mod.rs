//! `terrain.pmtiles`: map tiles of heights, from the raster that is written.
//!
//! The map is cut into quarters from the tile of the world down to tiles of the finest zoom, which are drawn from blocks of the raster.
//! On the way back up, each tile is made of the four below it. So tiles of all zooms are made at the same time, and they wait in a file
//! of their own until the archive is put together in the order of their numbers. Some levels from the finest up are made on all threads.

pub(crate) mod check;
pub(crate) mod raster_cells;
pub(crate) mod waiting_tiles;
pub(crate) mod web_map;
pub(crate) mod write_map_tiles;
