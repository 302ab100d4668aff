//! A device's answer for a leaf.

use crate::geometry::Site;
use crate::voronoi::device_mesh::DeviceMesh;
use std::ops::Range;
use std::sync::Arc;

/// Numbers that came back from a device. The leaves of an atlas share them.
pub type SharedNumbers = Arc<dyn AsRef<[u32]> + Send + Sync>;

/// The mesh that a device has made of a leaf: where its parts lie among the numbers that came back; see [`DeviceMesh`].
pub struct MadeMesh {
    /// What came back, with that of other leaves.
    pub numbers: SharedNumbers,
    /// Eight numbers for each triangle.
    pub records: Range<usize>,
    /// A bit for each site that is not in the mesh.
    pub missing: Range<usize>,
    /// A bit for each record that the device has not finished.
    pub unfinished: Range<usize>,
    /// The first record of each block of pixels.
    pub block_starts: Range<usize>,
    /// Returns the number of the block that a site belongs to.
    pub block_of: Box<dyn Fn(Site) -> u32 + Send>,
}

impl MadeMesh {
    /// Returns the mesh with a copy of its own numbers, so that those of other leaves need not stay.
    pub fn alone(self) -> MadeMesh {
        let all = (*self.numbers).as_ref();
        let mut own = Vec::new();
        let ranges = [&self.records, &self.missing, &self.unfinished, &self.block_starts].map(|range| {
            let start = own.len();
            own.extend_from_slice(all.get(range.clone()).unwrap_or_default());
            start..own.len()
        });
        let [records, missing, unfinished, block_starts] = ranges;
        MadeMesh { numbers: Arc::new(own), records, missing, unfinished, block_starts, block_of: self.block_of }
    }

    /// Returns the mesh as the steps on the CPU read it. A part that did not come back is empty.
    pub(super) fn lend(&self) -> DeviceMesh<'_> {
        let numbers = (*self.numbers).as_ref();
        let part = |range: &Range<usize>| numbers.get(range.clone()).unwrap_or_default();
        DeviceMesh {
            records: part(&self.records),
            missing: part(&self.missing),
            unfinished: part(&self.unfinished),
            block_starts: part(&self.block_starts),
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
