//! Adds triangles at the end of a closed mesh, many in turn.
//!
//! It reads and writes the records of `closed_mesh`, for which there is room already. So no triangle asks for room, and the end of the
//! records stays in a register.

use crate::voronoi::index::{ClosedEdge, VertexIndex};

/// Adds triangles at the end of a closed mesh.
pub(super) struct TriangleWriter<'a> {
    records: &'a mut [u32],
    end: usize,
    /// What the mesh takes for the end, until the writer is dropped.
    mesh_end: &'a mut usize,
    front: ClosedEdge,
}

impl Drop for TriangleWriter<'_> {
    #[inline(always)]
    fn drop(&mut self) {
        *self.mesh_end = self.end;
    }
}

impl<'a> TriangleWriter<'a> {
    /// Returns what writes triangles into `records` from `end` on, which it sets when it is dropped. Half-edges before `front` are slots.
    #[inline(always)]
    pub(super) fn new(records: &'a mut [u32], end: &'a mut usize, front: ClosedEdge) -> TriangleWriter<'a> {
        TriangleWriter { records, end: *end, mesh_end: end, front }
    }

    /// Returns the first half-edge of the mesh that is no slot.
    #[inline(always)]
    pub(super) fn front(&self) -> ClosedEdge {
        self.front
    }

    /// Returns the first half-edge of the next triangle.
    #[inline(always)]
    pub(super) fn end(&self) -> ClosedEdge {
        ClosedEdge(self.end as u32)
    }

    #[inline(always)]
    pub(super) fn twin(&self, h: ClosedEdge) -> ClosedEdge {
        ClosedEdge(self.records[h.get() + 4])
    }

    #[inline(always)]
    pub(super) fn set_twin(&mut self, h: ClosedEdge, to: ClosedEdge) {
        self.records[h.get() + 4] = to.0;
    }

    /// Makes two half-edges each other's twins.
    #[inline(always)]
    pub(super) fn link(&mut self, h: ClosedEdge, g: ClosedEdge) {
        self.set_twin(h, g);
        self.set_twin(g, h);
    }

    /// Adds a triangle whose half-edges have `twins`, which need not lead back yet; returns its first half-edge.
    #[inline(always)]
    pub(super) fn push(&mut self, [a, b, c]: [VertexIndex; 3], [f, g, h]: [ClosedEdge; 3]) -> ClosedEdge {
        let t = self.end();
        let record = &mut self.records[self.end..self.end + 8];
        (record[0], record[1], record[2]) = (a.0, b.0, c.0);
        (record[4], record[5], record[6]) = (f.0, g.0, h.0);
        self.end += 8;
        t
    }
}
