//! Step 8: writes what is beside the tiles.

pub(crate) mod classified;
pub(crate) mod contours;
pub(crate) mod exports;
pub(crate) mod flat_tile;
pub(crate) mod height_offset_check;
pub(crate) mod map_tiles;
pub(crate) mod one_file_limits;
pub(crate) mod placement;
pub(crate) mod published;
pub(crate) mod raster;
pub(crate) mod side_files;
pub(crate) mod terrain_tiles;
pub(crate) mod tileset_tree;
pub(crate) mod written_tiles;
