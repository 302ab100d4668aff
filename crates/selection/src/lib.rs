//! Error-bounded selection: few points of a cloud, so that every point is within a bound of their Delaunay triangulation, along the vertical.
//!
//! It is greedy insertion (Garland and Heckbert 1995, "Fast Polygonal Approximation of Terrains and Height Fields") in rounds. A round
//! triangulates what is selected, and selects the worst points of the triangles where they exceed the bound, but for those that a worse one beside
//! them may make superfluous (`rounds.rs`). In clouds of more than a million points, rounds
//! go over samples first (`sample.rs`).
//!
//! The canonical triangulation of a set of sites is unique, a round looks at nothing but a triangle, those beside it and the points in
//! them, and all of its points join at once. Which points are in a sample goes by their places. So the selection depends on the points and the
//! bound alone, not on how the points are divided into blocks, on threads or on the machine. All decisions are exact, in integers.

#![warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable)]

mod area;
mod block;
mod column;
mod concern;
mod disc;
mod error_bound;
mod held_points;
mod hull;
mod lattice_cells;
mod memory;
mod mesh_of_points;
mod near_points;
mod outline;
mod regions;
mod rounds;
mod sample;
mod seeds;
mod select;
mod selected_sites;
mod site_cells;
mod source;
mod stored_sites;
mod swap;
#[cfg(test)]
mod tests;

pub use error_bound::{ErrorBound, VerticalError};
pub use held_points::HeldPoints;
pub use rounds::{Figures, Selection};
pub use select::{select, select_like};
pub use selected_sites::SelectedSites;
pub use source::{BYTES_PER_POINT, BlockPoints, PointSource, SelectionStore};
pub use swap::MOST_SWAPPED;
