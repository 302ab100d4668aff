//! The sums over all checked meshes.

use crate::digest::Digest;
use crate::failures::Failures;
use lattice::VertexDigest;

/// What was found within meshes.
#[derive(Debug, Default)]
pub(super) struct Findings {
    pub(super) failures: Failures,
    pub(super) triangles: u64,
    /// The triangles among them that are left out of the terrain.
    pub(super) cut_triangles: u64,
    /// Vertices that lie on no border of a mesh.
    pub(super) inner_sites: u64,
    /// Edges whose four corners lie on one circle.
    pub(super) ties: u64,
    /// Twice the area of the triangles, in square lattice steps.
    pub(super) double_area: i128,
    pub(super) digest: Digest,
    /// The digest of the vertices that lie on no border.
    pub(super) vertices: VertexDigest,
}

impl Findings {
    /// Returns the sums of both.
    pub(super) fn merge(mut self, other: Findings) -> Findings {
        self.failures.merge(other.failures);
        Findings {
            failures: self.failures,
            triangles: self.triangles + other.triangles,
            cut_triangles: self.cut_triangles + other.cut_triangles,
            inner_sites: self.inner_sites + other.inner_sites,
            ties: self.ties + other.ties,
            double_area: self.double_area + other.double_area,
            digest: self.digest.join(other.digest),
            vertices: self.vertices.join(other.vertices),
        }
    }
}
