//! Contour lines of a triangulation. They are cut from its triangles, tile by tile, and are the same whatever the tiles.
//!
//! - A vertex at a level or above it is high, any other is low. So a triangle has no line of a level, or one segment between two of its
//!   edges. Saddles and flats need no rule of their own.
//! - The crossing of an edge is computed from the edge and the level alone. It lies strictly between the ends of the edge, and crossings of
//!   several levels lie on it in the order of the levels ([`Level`]). So no two lines touch, and none touches itself.
//! - Lines go with the higher ground on their left.
//! - A line around a single vertex, which lies at the level itself, is a point. It is left out.
//!
//! [`trace`] makes [`Chain`]s of the segments in a tile. [`join`] joins those of one level in all tiles, by the edges that they end on.

#![warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable)]

mod chain;
mod crossing_edges;
mod edge_key;
mod join;
mod levels;
mod line_points;
mod trace;

pub use chain::{Band, Chain};
pub use edge_key::EdgeKey;
pub use join::{JoinedLines, Line, Piece, join};
pub use levels::{CLOSEST, Level, LevelError, Levels};
pub use line_points::line_points;
pub use trace::{Plane, trace};

#[cfg(test)]
mod tests;
