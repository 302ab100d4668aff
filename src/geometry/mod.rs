//! Exact geometry on the job's integer lattice.

mod bounds;
pub mod lattice;
pub mod predicates;
pub mod square_grid;

pub use bounds::Bounds;

/// A site: x and y in lattice steps, each within [`lattice::REACH`] of zero.
pub type Site = [i32; 2];
