//! The Delaunay triangulation of the sites of one tile.

pub mod flip;
pub mod mesh;
pub mod reference;
