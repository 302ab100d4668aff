//! `terrain.tif`: the terrain as a raster of heights, a Cloud-Optimized GeoTIFF; and the rasters that follow from it (`products.rs`).
//!
//! A cell has the height of the terrain at its centre. [`grid::RasterGrid`] says where the centres are, in whole numbers, so which triangle
//! holds a centre is decided exactly. The height follows from that triangle's corners alone (`height.rs`), or, on an
//! edge or a vertex, from the ends of the edge or the vertex alone. So all triangles that meet there give the same bits, and a cell does
//! not depend on the tiles, their order or the threads.

pub mod block;
pub mod block_reader;
pub mod file_list;
pub mod geokeys;
pub mod geotiff;
pub mod grid;
pub(crate) mod height;
pub mod options;
pub mod overview;
pub mod products;
pub(crate) mod tags;
pub(crate) mod whole_numbers;
pub mod window;

/// Cells along the side of a block: a tile of the TIFF file.
pub const BLOCK: usize = 512;
