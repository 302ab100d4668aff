//! Step 7: makes coarser tiles for viewers, each from a few finer ones.

pub mod hierarchy;
pub mod make_level;
