//! 3D Tiles: the tileset, and the way from the plane to the globe.

pub mod georeference;
pub mod globe;
pub mod tileset;
