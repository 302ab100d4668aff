//! Exact geometry on the job's integer lattice.

mod bounds;
pub mod lattice;
pub mod predicates;
mod site;
pub mod square_grid;
mod vertex_digest;

pub use bounds::{Bounds, bounds_of};
pub use site::Site;
pub use vertex_digest::VertexDigest;
