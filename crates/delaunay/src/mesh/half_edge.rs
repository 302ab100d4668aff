//! The topology of a triangulation: which sites make a triangle, and which triangles share an edge.

use crate::mesh::index::{HalfEdgeIndex, SiteIndex};

/// A triangle mesh as half-edges. Half-edge `3 t + i` of triangle `t` starts at its `i`-th corner and ends at the next;
/// corners are counterclockwise.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct HalfEdgeMesh {
    /// The three corners of every triangle.
    pub triangles: Vec<[SiteIndex; 3]>,
    /// The half-edge in the opposite direction of every half-edge, or [`HalfEdgeIndex::HULL`]. Three times as long as `triangles`.
    pub twins: Vec<HalfEdgeIndex>,
}

impl HalfEdgeMesh {
    /// Returns the three corners of every triangle as plain numbers.
    pub fn corners(&self) -> &[[u32; 3]] {
        bytemuck::cast_slice(&self.triangles)
    }

    /// Returns all half-edges.
    #[inline]
    pub fn half_edges(&self) -> impl Iterator<Item = HalfEdgeIndex> + use<> {
        (0..self.twins.len()).map(HalfEdgeIndex::new)
    }

    /// Returns the half-edges on the hull, ascending.
    #[inline]
    pub fn hull(&self) -> impl Iterator<Item = HalfEdgeIndex> {
        // Few are: vector instructions tell which pieces have any.
        const PIECE: usize = 64;
        let has_any =
            |piece: &[HalfEdgeIndex]| piece.iter().fold(false, |any, &twin| any | (twin == HalfEdgeIndex::HULL));
        let pieces = self.twins.chunks(PIECE).enumerate().filter(move |(_, piece)| has_any(piece));
        let half_edges = pieces.flat_map(|(at, piece)| (at * PIECE..at * PIECE + piece.len()).map(HalfEdgeIndex::new));
        half_edges.filter(|&h| self.twin(h) == HalfEdgeIndex::HULL)
    }

    /// Returns the half-edge in the opposite direction of `h`, or [`HalfEdgeIndex::HULL`].
    #[inline(always)]
    pub fn twin(&self, h: HalfEdgeIndex) -> HalfEdgeIndex {
        self.twins[h.get()]
    }

    /// Returns the site at which half-edge `h` starts.
    #[inline(always)]
    pub fn origin(&self, h: HalfEdgeIndex) -> SiteIndex {
        self.triangles[h.triangle()][h.corner()]
    }

    /// Returns the site at which half-edge `h` ends.
    #[inline(always)]
    pub fn destination(&self, h: HalfEdgeIndex) -> SiteIndex {
        self.origin(h.next())
    }

    /// Returns the corner of the triangle of `h` that is not on `h`.
    #[inline(always)]
    pub fn apex(&self, h: HalfEdgeIndex) -> SiteIndex {
        self.origin(h.previous())
    }

    /// Makes `h` and `twin` each other's twins. If `twin` is [`HalfEdgeIndex::HULL`], `h` lies on the hull.
    #[inline(always)]
    pub(crate) fn link(&mut self, h: HalfEdgeIndex, twin: HalfEdgeIndex) {
        self.twins[h.get()] = twin;
        if twin != HalfEdgeIndex::HULL {
            self.twins[twin.get()] = h;
        }
    }

    /// Returns the positions of the triangles around the origin of `h`, counterclockwise. If the origin lies on the hull, `h` must
    /// lie on the hull too.
    #[inline]
    pub fn around(&self, h: HalfEdgeIndex) -> impl Iterator<Item = usize> {
        let turn = move |outgoing: &HalfEdgeIndex| {
            Some(self.twin(outgoing.previous())).filter(|&g| g != HalfEdgeIndex::HULL && g != h)
        };
        std::iter::successors(Some(h), turn).map(HalfEdgeIndex::triangle)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_hull_is_all_half_edges_without_a_twin(
            twins in prop::collection::vec(prop::option::weighted(0.97, 0u32..1000), 0..400),
        ) {
            let expected: Vec<usize> = (0..twins.len()).filter(|&h| twins[h].is_none()).collect();
            let twins = twins.into_iter().map(|twin| twin.map_or(HalfEdgeIndex::HULL, HalfEdgeIndex)).collect();
            let mesh = HalfEdgeMesh { triangles: Vec::new(), twins };
            prop_assert_eq!(mesh.hull().map(HalfEdgeIndex::get).collect::<Vec<_>>(), expected);
        }
    }
}
