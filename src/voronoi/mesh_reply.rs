//! A device's answer for a leaf.

use crate::geometry::Site;
use crate::voronoi::device_mesh::DeviceMesh;

/// The mesh that a device has made of a leaf; see [`DeviceMesh`].
pub struct MadeMesh {
    /// Eight numbers for each triangle.
    pub records: Vec<u32>,
    /// A bit for each site that is not in the mesh.
    pub missing: Vec<u32>,
    /// A bit for each record that the device has not finished.
    pub unfinished: Vec<u32>,
    /// The first record of each block of pixels.
    pub block_starts: Vec<u32>,
    /// Returns the number of the block that a site belongs to.
    pub block_of: Box<dyn Fn(Site) -> u32 + Send>,
}

impl MadeMesh {
    /// Returns the mesh as the steps on the CPU read it.
    pub(super) fn lend(&self) -> DeviceMesh<'_> {
        DeviceMesh {
            records: &self.records,
            missing: &self.missing,
            unfinished: &self.unfinished,
            block_starts: &self.block_starts,
            block_of: &self.block_of,
        }
    }
}

/// A device's answer for a leaf.
pub enum MeshReply {
    /// A mesh, which need not be right.
    Made(MadeMesh),
    /// The device says itself that the leaf went wrong.
    Flagged,
    /// There is no answer: the device does not suit the leaf, is late, or is gone.
    Unavailable,
}
