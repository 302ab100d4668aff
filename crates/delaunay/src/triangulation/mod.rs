//! The canonical Delaunay triangulation of sites. It is the same whichever backend computes it.

pub mod canonical;
pub mod counts;
pub mod divide_and_conquer;
#[cfg(any(test, feature = "reference"))]
pub mod reference;
#[cfg(test)]
mod tests;

pub use canonical::{canonical, recycle};
pub use counts::TriangulationCounts;
