//! The Delaunay triangulation of the sites of one tile. It is the same whichever backend computes it.

pub mod divide_and_conquer;
pub mod options;
pub mod reference;
#[cfg(test)]
mod tests;
mod triangulator;

pub(crate) use triangulator::MIN_POINTS_PER_THREAD;
pub use triangulator::{TriangulationCounts, Triangulator, canonical, recycle};
