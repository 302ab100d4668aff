//! The Delaunay triangulation of the sites of one tile. It is the same whichever backend computes it.

pub mod canonical;
pub mod counts;
pub mod divide_and_conquer;
pub mod reference;
#[cfg(test)]
mod tests;

pub use canonical::{canonical, recycle};
pub use counts::TriangulationCounts;
