//! What tells edges of the triangulation from each other, in any tile.

use bytemuck::{Pod, Zeroable};

/// The two ends of an edge, the low one first. Each is the place of its vertex on the Z-order curve. So edges with neighbouring keys are near
/// each other, and sorted lines stay near each other in a file.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable)]
pub struct EdgeKey(pub [u64; 2]);
