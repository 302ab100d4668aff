//! The topology of a triangulation: which sites make a triangle, and which triangles share an edge.

/// The twin of a half-edge on the hull, which has no triangle on its other side.
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
    /// Returns the site at which half-edge `h` starts.
    #[inline(always)]
    pub fn origin(&self, h: u32) -> u32 {
        self.triangles[h as usize / 3][h as usize % 3]
    }

    /// Returns the site at which half-edge `h` ends.
    #[inline(always)]
    pub fn destination(&self, h: u32) -> u32 {
        self.origin(next(h))
    }

    /// Returns the corner of the triangle of `h` that is not on `h`.
    #[inline(always)]
    pub fn apex(&self, h: u32) -> u32 {
        self.origin(previous(h))
    }

    /// Returns the triangles around the site at which half-edge `h` starts, counterclockwise. If the site lies on the hull, `h` must
    /// lie on the hull too.
    pub fn around(&self, h: u32) -> impl Iterator<Item = u32> {
        let turn =
            move |&outgoing: &u32| Some(self.twins[previous(outgoing) as usize]).filter(|&g| g != HULL && g != h);
        std::iter::successors(Some(h), turn).map(|outgoing| outgoing / 3)
    }
}

/// Returns the half-edge after `h` in its triangle.
#[inline(always)]
pub fn next(h: u32) -> u32 {
    if h % 3 == 2 { h - 2 } else { h + 1 }
}

/// Returns the half-edge before `h` in its triangle.
#[inline(always)]
pub fn previous(h: u32) -> u32 {
    if h.is_multiple_of(3) { h + 2 } else { h - 1 }
}
