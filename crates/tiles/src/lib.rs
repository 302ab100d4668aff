//! Writes the terrain: glTF tiles, one scene of all tiles, 3D Tiles, the georeference, a raster of heights, contour lines and a picture.
//!
//! [`frame::Frame`] says where a lattice point lies in a glTF scene. All code that writes or reads positions asks it.

#![warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable)]

pub mod attributes;
pub(crate) mod axis_scale;
pub mod breakline_list;
pub mod checksums;
pub mod color;
pub mod compression;
pub mod contour_options;
pub mod curvature;
pub mod file_names;
pub mod frame;
pub mod geopackage;
pub mod gltf;
pub mod gzip;
mod huffman;
pub mod imagery_url;
pub mod lod;
pub mod map_tiles;
pub mod normals;
pub mod options;
pub mod page;
pub mod preview;
pub mod raster;
pub mod rewritten;
pub mod terrain_options;
pub mod tile;
pub mod tiles3d;

pub use compression::Compression;
pub use tile::Tile;
