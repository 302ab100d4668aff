//! The overlay of two triangulated terrains: the areas and volumes between them.
//!
//! All corners are whole numbers on one lattice. Which triangles overlap is decided exactly (`pair.rs`). What a pair contributes is computed in
//! floating point from its two triangles alone, in the canonical order of their corners, and is added up as a fixed-point number
//! (`totals.rs`). So the sums have the same bits in any order of the triangles, on any number of threads, and however both terrains
//! are cut into tiles.
//!
//! [`compare()`] does this for two meshes, [`crossings()`] finds where a line crosses triangles, and [`Places`] have heights
//! on them.

#![warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable)]

mod compare;
mod crossings;
mod heights;
mod join;
mod mesh;
mod pair;
mod polygon;
mod rectangle;
#[cfg(test)]
mod tests;
mod totals;
mod whole_number;
mod zones;

pub use compare::{Comparison, compare};
pub use crossings::{Crossing, Met, Part, Segment, crossings};
pub use heights::Places;
pub use mesh::{MeshError, Point, REACH, TriangleMesh};
pub use rectangle::Rectangle;
pub use totals::{FixedSum, Totals};
pub use zones::{ZoneTriangles, Zones};
