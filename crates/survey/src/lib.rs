//! Surveys of written terrains: the cut and the fill between two of them, and heights along lines.
//!
//! [`diff::run`] reads the tiles of two terrains, brings both onto one lattice, and overlays them with the crate `overlay`. All sums are of
//! whole numbers, so that no digit depends on tiles, threads or their order. `written/` makes a raster and a mesh in colours of the difference.

#![warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable)]

mod areas;
mod common_lattice;
pub mod diff;
mod difference;
mod places;
pub mod profile;
mod tile_meshes;
pub mod written;

pub use difference::{AreaDifference, Difference, Figures};
