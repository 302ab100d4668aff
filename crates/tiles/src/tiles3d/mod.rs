//! 3D Tiles: the tileset, and the map from the plane to the globe.

pub mod curve_fit;
pub mod division;
pub mod georeference;
pub mod globe;
pub mod ground;
pub mod tileset;
