//! 3D Tiles: the tileset, and the map from the plane to the globe.

pub mod division;
pub mod georeference;
pub mod globe;
pub mod tileset;
