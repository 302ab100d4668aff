//! Step 7: coarser tiles.

pub mod hierarchy;
pub mod level;
