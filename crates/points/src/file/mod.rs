//! Reading files at given positions: no shared seek position and no memory map, so that any thread may read, and a file that
//! shrinks is an error and never a crash.

pub(crate) mod random_access;
pub(crate) mod range;
