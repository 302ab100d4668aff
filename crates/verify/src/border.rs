//! What one mesh hands over to be matched with other meshes: its border, edge by edge and vertex by vertex.

use bytemuck::{Pod, Zeroable, bytes_of};
use xxhash_rust::xxh3::xxh3_64;

use crate::keyed_records::KeyedRecord;
use delaunay::geometry::Site;

/// An edge that has a triangle on one side only within its mesh.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Pod, Zeroable)]
pub(super) struct BorderEdge {
    /// The lesser end, then the greater.
    pub(super) ends: [Site; 2],
    /// 1 if the triangle runs along the edge from the greater end to the lesser.
    pub(super) reversed: u32,
    pub(super) tile: u32,
    /// The third corner of the triangle.
    pub(super) apex: Site,
}

impl BorderEdge {
    pub(super) fn new(from: Site, to: Site, apex: Site, tile: u32) -> BorderEdge {
        BorderEdge { ends: [from.min(to), from.max(to)], reversed: (from > to) as u32, tile, apex }
    }

    /// Returns the ends in the direction in which the triangle has them.
    pub(super) fn directed(&self) -> [Site; 2] {
        let [a, b] = self.ends;
        if self.reversed == 0 { [a, b] } else { [b, a] }
    }
}

impl KeyedRecord for BorderEdge {
    fn key_hash(&self) -> u64 {
        xxh3_64(bytes_of(&self.ends))
    }
}

/// A vertex at an end of a [`BorderEdge`].
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Pod, Zeroable)]
pub(super) struct BorderSite {
    pub(super) site: Site,
    pub(super) tile: u32,
    /// Its lattice integer in z.
    pub(super) height: i32,
    /// 1 in the files of `cut/`, which have neither normals nor colours nor attributes of points.
    pub(super) unshaded: u32,
    pub(super) unused: u32,
    /// Hash of the position in the scene.
    pub(super) position: u64,
    /// Hash of normal, colour and what the vertex carries of its point.
    pub(super) shading: u64,
}

impl KeyedRecord for BorderSite {
    fn key_hash(&self) -> u64 {
        xxh3_64(bytes_of(&self.site))
    }
}

/// The border of one mesh.
#[derive(Default)]
pub(super) struct MeshBorder {
    pub(super) edges: Vec<BorderEdge>,
    pub(super) sites: Vec<BorderSite>,
}
