//! Levels of detail: joining tiles, simplifying what they make, and measuring how far off the result is.

mod boundary;
mod cells;
mod height_bounds;
pub mod join;
pub mod simplify;
pub mod vertical_error;
