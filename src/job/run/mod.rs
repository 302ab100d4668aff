//! Runs the steps.

pub mod local_run;
pub mod resume;
pub mod tile_queue;
pub mod tree_walk;
