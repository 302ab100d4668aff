//! Levels of detail: joins tiles, simplifies them, and measures how far the result is from the exact mesh.

mod boundary;
mod cell_grid;
mod filling;
mod furthest;
mod height_bounds;
pub mod join;
mod kept_lines;
pub mod simplify;
mod surface;
mod vertex_cells;
pub mod vertical_error;
