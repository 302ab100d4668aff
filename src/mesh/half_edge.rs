//! The topology of a triangulation: which sites make a triangle and which triangles share an edge.
//! It knows no coordinates.

/// In [`HalfEdgeMesh::twins`]: no triangle on the other side, the half-edge lies on the hull.
pub const HULL: u32 = u32::MAX;

/// A triangle mesh as half-edges. Half-edge `3 t + i` of triangle `t` starts at its `i`-th corner and ends at the next;
/// corners are counterclockwise.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct HalfEdgeMesh {
    /// The three corners of every triangle, as indices of sites.
    pub triangles: Vec<[u32; 3]>,
    /// For every half-edge the half-edge in the opposite direction, or [`HULL`]. Three times as long as `triangles`.
    pub twins: Vec<u32>,
}

impl HalfEdgeMesh {
    /// The site at which half-edge `h` starts.
    #[inline(always)]
    pub fn origin(&self, h: u32) -> u32 {
        self.triangles[h as usize / 3][h as usize % 3]
    }

    /// The site at which half-edge `h` ends.
    #[inline(always)]
    pub fn destination(&self, h: u32) -> u32 {
        self.origin(next(h))
    }

    /// The corner of the triangle of `h` that is not on `h`.
    #[inline(always)]
    pub fn apex(&self, h: u32) -> u32 {
        self.origin(previous(h))
    }

    /// The triangles around the site at which half-edge `h` starts, counterclockwise. If the site lies on the hull, so must `h`.
    pub fn around(&self, h: u32) -> impl Iterator<Item = u32> {
        let next = move |&spoke: &u32| Some(self.twins[previous(spoke) as usize]).filter(|&s| s != HULL && s != h);
        std::iter::successors(Some(h), next).map(|spoke| spoke / 3)
    }
}

/// The half-edge after `h` in its triangle.
#[inline(always)]
pub fn next(h: u32) -> u32 {
    if h % 3 == 2 { h - 2 } else { h + 1 }
}

/// The half-edge before `h` in its triangle.
#[inline(always)]
pub fn previous(h: u32) -> u32 {
    if h.is_multiple_of(3) { h + 2 } else { h - 1 }
}
