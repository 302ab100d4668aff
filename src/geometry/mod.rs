//! Exact geometry on the job's integer lattice.

pub mod lattice;
pub mod predicates;

/// A site: x and y in lattice steps, each within [`lattice::REACH`] of zero.
pub type Site = [i32; 2];
