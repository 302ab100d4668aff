//! Finds the points of a cloud that lie on the ground.

#![warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable)]

mod cell_count;
mod cells;
mod density;
mod fill;
mod find;
mod ground;
mod lowest;
mod metric_lattice;
mod morphology;
mod pits;
mod plane;
mod regions;
mod sizes;
mod slope;
mod terrain;
#[cfg(test)]
mod tests;

pub use cell_count::CellCount;
pub use density::{CoveredArea, PointCollector};
pub use ground::{BYTES_PER_CELL, CellNumbers, Ground, GroundColumns};
pub use lowest::LowestHeights;
pub use metric_lattice::MetricLattice;
pub use sizes::GroundSizes;
