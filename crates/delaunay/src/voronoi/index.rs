//! The numbers of half-edges and vertices in a closed mesh.

use crate::geometry::Site;

/// A half-edge of a closed mesh. Half-edge `8 t + i` starts at corner `i` of the triangle in record `t`. A triangle is also named by
/// its first half-edge, `8 t`.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct ClosedEdge(pub(super) u32);

impl ClosedEdge {
    /// The twin of a half-edge on the hull once the ghost triangles are gone.
    pub(super) const OUTSIDE: ClosedEdge = ClosedEdge(u32::MAX);

    /// Returns the position of the half-edge's origin in the records of the mesh.
    #[inline(always)]
    pub(super) fn get(self) -> usize {
        self.0 as usize
    }

    /// Returns the half-edge after this one in its triangle. Arithmetic replaces a branch that would be mispredicted one time in three.
    #[inline(always)]
    pub(super) fn next(self) -> ClosedEdge {
        let is_last = self.0 >> 1 & 1;
        ClosedEdge(self.0.wrapping_add(1).wrapping_sub(3 * is_last))
    }

    /// Returns the half-edge before this one in its triangle.
    #[inline(always)]
    pub(super) fn previous(self) -> ClosedEdge {
        let is_first = (self.0 & 3 == 0) as u32;
        ClosedEdge(self.0.wrapping_add(3 * is_first).wrapping_sub(1))
    }

    /// Returns the corner of the triangle at which the half-edge starts: 0, 1 or 2.
    #[inline(always)]
    pub(super) fn corner(self) -> usize {
        (self.0 & 3) as usize
    }

    /// Returns the first half-edge of the triangle.
    #[inline(always)]
    pub(super) fn triangle(self) -> ClosedEdge {
        ClosedEdge(self.0 & !7)
    }

    /// Returns half-edge `i` (0, 1 or 2) of the triangle whose first half-edge this is.
    #[inline(always)]
    pub(super) fn side(self, i: u32) -> ClosedEdge {
        ClosedEdge(self.0 + i)
    }

    /// Returns the three half-edges of the triangle whose first half-edge this is.
    #[inline(always)]
    pub(super) fn sides(self) -> [ClosedEdge; 3] {
        [self, self.side(1), self.side(2)]
    }
}

/// A vertex of a closed mesh: the number of a site in its texture, or of the vertex at infinity, which is the last.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct VertexIndex(pub(super) u32);

impl VertexIndex {
    /// No vertex: the corner of a record that holds no triangle.
    pub(super) const NONE: VertexIndex = VertexIndex(u32::MAX);

    /// Returns the vertex's position in a list with an entry for every vertex.
    #[inline(always)]
    pub(super) fn get(self) -> usize {
        self.0 as usize
    }

    /// Returns the vertex's site, given the `sites` of all vertices.
    #[inline(always)]
    pub(super) fn site(self, sites: &[Site]) -> Site {
        sites[self.0 as usize]
    }
}
