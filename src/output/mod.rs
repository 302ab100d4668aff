//! Terrain out: glTF tiles, one scene of all tiles, the georeference and a picture.
//!
//! [`frame::Frame`] says where a lattice point lies in a glTF scene; everything that writes or reads positions asks it.

mod cells;
pub mod color;
mod container;
pub mod deviation;
mod document;
pub mod encoding;
pub mod frame;
pub mod georeference;
pub mod glb;
pub mod globe;
pub mod join;
pub mod normals;
mod order;
mod outline;
mod packed;
mod parts;
pub mod picture;
pub mod preview;
pub mod read;
mod relief;
pub mod simplify;
pub mod terrain;
mod tile;
pub mod tileset;

pub use encoding::Compression;
pub use tile::Tile;
