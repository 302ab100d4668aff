//! Levels of detail: joins tiles, simplifies them, and measures how far the result is from the exact mesh.

mod boundary;
mod cell_grid;
mod covering;
mod filling;
mod fit;
mod height_bounds;
pub mod join;
mod kept_lines;
mod outline;
mod refine;
pub mod relief;
mod rim;
pub mod simplify;
pub mod terrain;
mod vertex_cells;
mod vertical_error;
