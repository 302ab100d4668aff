//! From a record of any source to a point on the lattice.

pub(crate) mod axis;
pub(crate) mod filter;
pub(crate) mod point;
pub(crate) mod record;
pub(crate) mod rules;
