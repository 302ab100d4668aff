//! One mesh, from tiles, in formats that CAD and other programs open.
//!
//! [`TileSurface`] is the mesh of a tile, and [`VertexNumbers`] numbers the vertices of all tiles, tile by tile: a vertex on the border of
//! tiles gets one number. The numbered mesh waits wherever the caller puts it, and each format is written from there ([`MeshSource`]), in
//! chunks, on all threads. The bytes depend on the tiles and their order alone.
//!
//! Every format has its file: `landxml.rs`, `dxf_terrain.rs`, `obj.rs` and `ply.rs`. `dxf.rs` writes any faces and lines as DXF.

#![warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable)]

mod chunks;
mod corners;
pub mod dxf;
mod dxf_terrain;
mod exact_axis;
mod landxml;
mod mesh;
mod obj;
mod place;
mod ply;
mod polylines;
#[cfg(test)]
mod tests;
mod text;
mod tile_surface;
mod vertex_numbers;

pub use dxf_terrain::write_dxf;
pub use exact_axis::{ExactAxis, LatticePlace};
pub use landxml::write_landxml;
pub use mesh::{LengthUnit, Mesh, MeshSource, MeshSummary, Output, SystemNames, Units};
pub use obj::{ObjOffset, write_obj};
pub use place::Place;
pub use ply::write_ply;
pub use polylines::polylines;
pub use tile_surface::TileSurface;
pub use vertex_numbers::{NumberedTile, TooManyVertices, VertexNumbers};
