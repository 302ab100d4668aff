//! Terrain out: glTF tiles, one scene of all tiles, the georeference and a picture.
//!
//! [`frame::Frame`] says where a lattice point lies in a glTF scene; everything that writes or reads positions asks it.

pub mod color;
pub mod frame;
pub mod gltf;
pub mod layout;
pub mod lod;
pub mod normals;
pub mod options;
pub mod preview;
mod tile;
pub mod tiles3d;

pub use gltf::encoding::Compression;
pub use tile::Tile;
