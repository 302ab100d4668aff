//! `terrain.tif`: the raster of heights, from the tiles that are written.
//!
//! A window of some millions of cells goes over the raster. The tiles that meet it are read, and their triangles drawn, on all threads;
//! then its blocks are packed, and those of the overviews above it. The blocks of overviews come first in the file, and nobody knows their
//! sizes before the last is packed, so all blocks wait in a file of their own until they are put together.
//!
//! The tiles could have left their cells in the store when they were written. But that takes four bytes a cell of the disk until the end,
//! a tile of few points may have thousands of millions of cells, and another raster would take all tiles to be written again. Reading
//! the tiles takes about a third of the time of the raster.

pub(crate) mod check;
pub(crate) mod system;
pub(crate) mod tile_meshes;
pub(crate) mod waiting_blocks;
pub(crate) mod write_raster;

mod nodata_heights;
mod pyramid;
