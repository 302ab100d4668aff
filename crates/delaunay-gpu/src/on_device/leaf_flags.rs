//! Why a leaf of an atlas goes to the CPU: bits that the steps on the device set, one number for each leaf.

/// Islands are left after the last round of step G3.
pub const ISLANDS_LEFT: u32 = 1;
/// The leaf has more triangles than there is room for. It has no records then.
pub const TOO_MANY_TRIANGLES: u32 = 4;
/// A Voronoi edge is longer than step G6 follows. The half-edges at its ends have no twins then.
pub const LONG_EDGE: u32 = 8;
