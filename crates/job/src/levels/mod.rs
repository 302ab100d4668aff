//! Step 7: makes coarser tiles for viewers, each from a few finer ones.

pub(crate) mod hierarchy;
mod level_mesh;
pub(crate) mod make_level;
mod shares;
