//! The Delaunay triangulation of the sites of one tile.

pub mod mesh;
