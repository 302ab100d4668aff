//! The numbers of sites and of half-edges, as types that cannot be mixed up.

use bytemuck::{Pod, Zeroable};

/// The position of a site in the list of sites that a mesh connects.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable)]
pub struct SiteIndex(pub u32);

impl SiteIndex {
    /// Returns the site at position `index` of the list.
    #[inline(always)]
    pub fn new(index: usize) -> SiteIndex {
        SiteIndex(index as u32)
    }

    /// Returns the position in the list.
    #[inline(always)]
    pub fn get(self) -> usize {
        self.0 as usize
    }
}

/// A half-edge of a half-edge mesh. Half-edge `3 t + i` of triangle `t` starts at its `i`-th corner and ends at the next.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable)]
pub struct HalfEdgeIndex(pub u32);

impl HalfEdgeIndex {
    /// The twin of a half-edge on the hull, which has no triangle on its other side.
    pub const HULL: HalfEdgeIndex = HalfEdgeIndex(u32::MAX);

    /// Returns the half-edge at position `index` of a list of all half-edges.
    #[inline(always)]
    pub fn new(index: usize) -> HalfEdgeIndex {
        HalfEdgeIndex(index as u32)
    }

    /// Returns the three half-edges of the triangle at position `triangle`.
    #[inline(always)]
    pub fn of_triangle(triangle: usize) -> [HalfEdgeIndex; 3] {
        [0, 1, 2].map(|corner| HalfEdgeIndex::new(3 * triangle + corner))
    }

    /// Returns the position in a list of all half-edges.
    #[inline(always)]
    pub fn get(self) -> usize {
        self.0 as usize
    }

    /// Returns the position of the triangle in a list of all triangles.
    #[inline(always)]
    pub fn triangle(self) -> usize {
        self.get() / 3
    }

    /// Returns the corner of the triangle at which the half-edge starts: 0, 1 or 2.
    #[inline(always)]
    pub fn corner(self) -> usize {
        self.get() % 3
    }

    /// Returns the half-edge after this one in its triangle.
    #[inline(always)]
    pub fn next(self) -> HalfEdgeIndex {
        HalfEdgeIndex(if self.0 % 3 == 2 { self.0 - 2 } else { self.0 + 1 })
    }

    /// Returns the half-edge before this one in its triangle.
    #[inline(always)]
    pub fn previous(self) -> HalfEdgeIndex {
        HalfEdgeIndex(if self.0.is_multiple_of(3) { self.0 + 2 } else { self.0 - 1 })
    }
}
