//! Exact geometry on integers.

mod bounds;
#[cfg(feature = "serde")]
mod bounds_serde;
pub mod predicates;
mod site;
pub mod square_grid;
mod z_order;

pub use bounds::{Bounds, bounds_of};
pub use site::{REACH, Site};
pub use z_order::z_order;
