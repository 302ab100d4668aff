//! Step 8: what stands beside the tiles.

pub mod finish;
pub mod placement;
pub mod tileset;
