//! Sites: the points that are triangulated.

/// A site: x and y in lattice steps, each within [`REACH`] of zero.
pub type Site = [i32; 2];

/// Coordinates of sites lie within this distance of zero, so that the predicates cannot overflow.
pub const REACH: i32 = 1 << 29;
