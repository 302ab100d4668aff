//! Step 8: writes what is beside the tiles.

pub mod limits;
pub mod placement;
pub mod side_files;
pub mod tileset_tree;
