//! Sites: the points that are triangulated.

/// A site: x and y in lattice steps, each within `lattice::REACH` of zero.
pub type Site = [i32; 2];
