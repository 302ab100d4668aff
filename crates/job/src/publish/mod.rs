//! Step 8: writes what is beside the tiles.

pub mod flat_tile;
pub mod height_offset_check;
pub mod one_file_limits;
pub mod placement;
pub mod raster;
pub mod side_files;
pub mod tileset_tree;
