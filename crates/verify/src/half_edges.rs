//! The half-edges of a mesh by the vertex where they start, so that each finds the one in the other direction.

use delaunay::mesh::adjacency::VertexAdjacency;

/// The half-edges of a mesh. The half-edge from vertex v along the edge from a to b opposite it goes from v to a, and b is the third
/// corner of its triangle: its apex. The highest bit of b says that the half-edge in the other direction is found.
pub(super) struct HalfEdgesByOrigin(VertexAdjacency);

/// A half-edge seen from the vertex where it starts: the vertex where it ends, and its apex with [`MATCHED`].
#[derive(Clone, Copy)]
#[repr(transparent)]
pub(super) struct OutgoingHalfEdge([u32; 2]);

/// The highest bit of an apex. A file has fewer vertices than that.
const MATCHED: u32 = 1 << 31;

impl OutgoingHalfEdge {
    /// Returns the vertex where it ends.
    #[inline(always)]
    pub(super) fn to(self) -> u32 {
        self.0[0]
    }

    /// Returns the third corner of its triangle.
    #[inline(always)]
    pub(super) fn apex(self) -> u32 {
        self.0[1] & !MATCHED
    }

    #[inline(always)]
    pub(super) fn is_matched(self) -> bool {
        self.0[1] & MATCHED != 0
    }
}

impl HalfEdgesByOrigin {
    pub(super) fn new(triangles: &[[u32; 3]], vertices: usize) -> HalfEdgesByOrigin {
        HalfEdgesByOrigin(VertexAdjacency::new(vertices, triangles))
    }

    /// Returns how many half-edges start at vertex `v`.
    pub(super) fn degree(&self, v: usize) -> usize {
        self.0.range(v as u32).len()
    }

    /// Returns the half-edges that start at vertex `v`.
    pub(super) fn of(&self, v: usize) -> impl Iterator<Item = OutgoingHalfEdge> {
        self.0.around(v as u32).iter().map(|&half_edge| OutgoingHalfEdge(half_edge))
    }

    /// Marks pairs of half-edges in opposite directions as matched and calls `pair` for each, as the triangles (a, b, c) and
    /// (a, c, d) over the edge ac. A half-edge that is there twice finds one partner at most.
    #[inline(always)]
    pub(super) fn match_pairs(&mut self, mut pair: impl FnMut([u32; 4])) {
        for from in 0..self.0.vertices() {
            let degree = self.degree(from);
            for i in self.0.range(from as u32) {
                let half_edge = OutgoingHalfEdge(self.0.opposite[i]);
                let to = half_edge.to();
                // Only towards the vertex with fewer half-edges: that keeps the search short round a hub of thousands.
                if (self.degree(to as usize), to as usize) >= (degree, from) || half_edge.is_matched() {
                    continue;
                }
                let Some(opposite) = self.take(to, from as u32) else { continue };
                self.0.opposite[i][1] |= MATCHED;
                pair([to, half_edge.apex(), from as u32, opposite]);
            }
        }
    }

    /// Marks an unmatched half-edge from `from` to `to` as matched and returns its apex.
    #[inline(always)]
    fn take(&mut self, from: u32, to: u32) -> Option<u32> {
        let range = self.0.range(from);
        let is_wanted = |half_edge: &&mut [u32; 2]| half_edge[0] == to && half_edge[1] & MATCHED == 0;
        let found = self.0.opposite[range].iter_mut().find(is_wanted)?;
        let apex = found[1];
        found[1] |= MATCHED;
        Some(apex)
    }
}
