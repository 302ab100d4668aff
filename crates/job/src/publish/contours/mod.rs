//! `contours.gpkg`: contour lines, from the tiles that are written.
//!
//! Each tile is read once, on any thread, and the lines of all levels are traced through its triangles. The pieces of lines wait in a file of
//! their own (`waiting_chains.rs`). Then they are joined level by level, the next lines while the last are written (`line_producer.rs`). What
//! is in memory is a band of levels for each thread, the heads of the pieces of one level, and a window of lines.

pub(crate) mod check;
pub(crate) mod write_contours;

mod drawing;
mod line_producer;
mod waiting_chains;
