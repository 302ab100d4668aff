//! Step 2: reading the points, and cutting the plane into tiles.

pub mod grid;
pub mod point_file;
pub mod read;
pub mod tree;
