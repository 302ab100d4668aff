//! Reading files at given positions.

pub(crate) mod bytes;
pub(crate) mod random_access;
pub(crate) mod range;
