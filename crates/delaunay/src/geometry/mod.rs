//! Exact geometry on the job's integer lattice.

mod bounds;
pub mod predicates;
mod site;
pub mod square_grid;

pub use bounds::{Bounds, bounds_of};
pub use site::{REACH, Site};
