//! The half-edges of a mesh by the vertex where they start, so that each finds the one in the other direction.

use std::ops::Range;

/// The half-edges of vertex v are `half_edges[start[v]..start[v + 1]]`.
pub(super) struct HalfEdgesByOrigin {
    start: Vec<u32>,
    half_edges: Vec<OutgoingHalfEdge>,
}

/// A half-edge seen from the vertex where it starts.
#[derive(Clone, Copy, Default)]
pub(super) struct OutgoingHalfEdge {
    /// The vertex where it ends.
    pub(super) to: u32,
    /// The third corner of its triangle, and [`MATCHED`] once the half-edge in the other direction is found.
    apex_and_mark: u32,
}

/// The highest bit of [`OutgoingHalfEdge::apex_and_mark`]. A file has fewer vertices than that.
const MATCHED: u32 = 1 << 31;

impl OutgoingHalfEdge {
    /// Returns the third corner of its triangle.
    #[inline(always)]
    pub(super) fn apex(self) -> u32 {
        self.apex_and_mark & !MATCHED
    }

    #[inline(always)]
    pub(super) fn is_matched(self) -> bool {
        self.apex_and_mark & MATCHED != 0
    }
}

impl HalfEdgesByOrigin {
    pub(super) fn new(triangles: &[[u32; 3]], vertices: usize) -> HalfEdgesByOrigin {
        // One place further than needed: filling moves every start to the next one's place.
        let mut start = vec![0u32; vertices + 2];
        for &v in triangles.as_flattened() {
            start[v as usize + 2] += 1;
        }
        for v in 2..start.len() {
            start[v] += start[v - 1];
        }
        let mut half_edges = vec![OutgoingHalfEdge::default(); 3 * triangles.len()];
        for &[a, b, c] in triangles {
            for (from, to, apex) in [(a, b, c), (b, c, a), (c, a, b)] {
                let place = &mut start[from as usize + 1];
                half_edges[*place as usize] = OutgoingHalfEdge { to, apex_and_mark: apex };
                *place += 1;
            }
        }
        HalfEdgesByOrigin { start, half_edges }
    }

    fn range(&self, v: usize) -> Range<usize> {
        self.start[v] as usize..self.start[v + 1] as usize
    }

    /// Returns how many half-edges start at vertex `v`.
    pub(super) fn degree(&self, v: usize) -> usize {
        self.range(v).len()
    }

    /// Returns the half-edges that start at vertex `v`.
    pub(super) fn of(&self, v: usize) -> &[OutgoingHalfEdge] {
        &self.half_edges[self.range(v)]
    }

    /// Marks pairs of half-edges in opposite directions as matched and calls `pair` for each, as the triangles (a, b, c) and
    /// (a, c, d) over the edge ac. A half-edge that is there twice finds one partner at most.
    #[inline(always)]
    pub(super) fn match_pairs(&mut self, mut pair: impl FnMut([u32; 4])) {
        for from in 0..self.start.len() - 2 {
            let degree = self.degree(from);
            for i in self.range(from) {
                let half_edge = self.half_edges[i];
                let to = half_edge.to;
                // Only towards the vertex with fewer half-edges: that keeps the search short round a hub of thousands.
                if (self.degree(to as usize), to as usize) >= (degree, from) || half_edge.is_matched() {
                    continue;
                }
                let Some(opposite) = self.take(to as usize, from as u32) else { continue };
                self.half_edges[i].apex_and_mark |= MATCHED;
                pair([to, half_edge.apex(), from as u32, opposite]);
            }
        }
    }

    /// Marks an unmatched half-edge from `from` to `to` as matched and returns its apex.
    #[inline(always)]
    fn take(&mut self, from: usize, to: u32) -> Option<u32> {
        let range = self.range(from);
        let found =
            self.half_edges[range].iter_mut().find(|half_edge| half_edge.to == to && !half_edge.is_matched())?;
        let apex = found.apex();
        found.apex_and_mark |= MATCHED;
        Some(apex)
    }
}
