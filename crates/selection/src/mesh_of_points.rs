//! A triangulation that knows the points in its triangles.

use crate::column::Column;
use crate::error_bound::{RoundBound, VerticalError};
use bytemuck::{Pod, Zeroable};
use delaunay::geometry::Site;
use delaunay::geometry::predicates::orient2d;
use delaunay::mesh::half_edge::HalfEdgeMesh;
use delaunay::mesh::index::HalfEdgeIndex;

/// Stands for no point and for no triangle.
pub(crate) const NONE: u32 = u32::MAX;

/// The corners of a triangle in ascending order.
pub(crate) type TriangleKey = [Site; 3];

/// A triangulation with the points that lie in each triangle.
pub(crate) struct MeshOfPoints {
    /// The vertices, and the height of each.
    pub(crate) sites: Vec<Site>,
    pub(crate) heights: Vec<i32>,
    pub(crate) mesh: HalfEdgeMesh,
    /// By triangle.
    pub(crate) held: Vec<Held>,
    /// The triangles that have changed since the last round, some of them several times.
    pub(crate) changed: Vec<u32>,
    /// The number of triangles whose worst point exceeds the bound.
    pub(crate) exceeding: usize,
    /// The number of the present list.
    list: u32,
}

/// The points in a triangle.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct Held {
    /// The first of them.
    pub(crate) first: u32,
    /// The worst of them.
    pub(crate) worst: u32,
    /// The numerator of its distance, in two halves: the triangle takes less memory.
    pub(crate) numerator: [u64; 2],
    /// Its distance in units of [`VerticalError::fixed`] if it exceeds the bound, else 0.
    pub(crate) excess: u64,
    /// The number of the list that the triangle was last put on.
    pub(crate) listed: u32,
    /// 1 if it lies in the block, so that it holds no points of others; else 0.
    inside: u32,
}

impl Held {
    const NOTHING: Held = Held { first: NONE, worst: NONE, numerator: [0; 2], excess: 0, listed: 0, inside: 0 };

    /// Returns that a triangle that was last put on a list holds nothing.
    #[inline(always)]
    pub(crate) fn on_list(listed: u32) -> Held {
        Held { listed, ..Held::NOTHING }
    }

    #[inline(always)]
    pub(crate) fn numerator(&self) -> u128 {
        u128::from(self.numerator[0]) << 64 | u128::from(self.numerator[1])
    }

    /// Tells whether the triangle lies in the block, so that it holds no points of others.
    #[inline(always)]
    pub(crate) fn is_inside(&self) -> bool {
        self.inside == 1
    }

    pub(crate) fn set_inside(&mut self, is_inside: bool) {
        self.inside = u32::from(is_inside);
    }

    #[inline(always)]
    pub(crate) fn set_worst(&mut self, point: u32, numerator: u128) {
        self.worst = point;
        self.numerator = [(numerator >> 64) as u64, numerator as u64];
    }
}

impl MeshOfPoints {
    /// Returns `mesh`, the triangulation of these points, without points in its triangles.
    pub(crate) fn new(corners: &[[i32; 3]], sites: Vec<Site>, mesh: HalfEdgeMesh) -> MeshOfPoints {
        let triangles = mesh.triangles.len();
        MeshOfPoints {
            sites,
            heights: corners.iter().map(|point| point[2]).collect(),
            mesh,
            held: vec![Held::NOTHING; triangles],
            changed: (0..triangles as u32).collect(),
            exceeding: 0,
            list: 0,
        }
    }

    /// Returns all that it has of sites and triangles.
    pub(crate) fn columns(&mut self) -> [&mut dyn Column; 6] {
        let MeshOfPoints { sites, heights, mesh, held, changed, .. } = self;
        [sites, heights, &mut mesh.triangles, &mut mesh.twins, held, changed]
    }

    /// Returns the bytes of memory that it takes.
    pub(crate) fn bytes(&self) -> usize {
        let MeshOfPoints { sites, heights, mesh, held, changed, .. } = self;
        sites.capacity() * size_of::<Site>()
            + (heights.capacity() + changed.capacity()) * size_of::<u32>()
            + mesh.triangles.capacity() * size_of::<[u32; 3]>()
            + mesh.twins.capacity() * size_of::<HalfEdgeIndex>()
            + held.capacity() * size_of::<Held>()
    }

    /// Returns those of the triangles that have changed, from the `first` of them on, and those beside them, each once, and `more`. If as many have
    /// changed as there are, these are all.
    pub(crate) fn changed_and_beside(&mut self, first: usize, more: Vec<u32>) -> Vec<u32> {
        self.list += 1;
        let (held, list) = (&mut self.held, self.list);
        if self.changed.len() - first >= held.len() {
            held.iter_mut().for_each(|held| held.listed = list);
            return (0..held.len() as u32).collect();
        }
        let mut triangles = Vec::with_capacity(more.len() + 2 * (self.changed.len() - first));
        let mut add = |t: usize| {
            if std::mem::replace(&mut held[t].listed, list) != list {
                triangles.push(t as u32);
            }
        };
        more.into_iter().for_each(|t| add(t as usize));
        for &t in &self.changed[first..] {
            add(t as usize);
            for twin in HalfEdgeIndex::of_triangle(t as usize).map(|h| self.mesh.twin(h)) {
                if twin != HalfEdgeIndex::HULL {
                    add(twin.triangle());
                }
            }
        }
        triangles
    }

    /// Tells whether a triangle is on the present list.
    pub(crate) fn is_listed(&self, triangle: u32) -> bool {
        self.held[triangle as usize].listed == self.list
    }

    /// Returns the places of the corners of a triangle.
    #[inline(always)]
    pub(crate) fn corners(&self, triangle: usize) -> [Site; 3] {
        self.mesh.triangles[triangle].map(|v| self.sites[v.get()])
    }

    /// Returns the twins of the sides of a triangle.
    #[inline(always)]
    pub(crate) fn twins_of(&self, triangle: usize) -> [HalfEdgeIndex; 3] {
        HalfEdgeIndex::of_triangle(triangle).map(|h| self.mesh.twin(h))
    }

    /// Returns the corners of a triangle in ascending order.
    pub(crate) fn key(&self, triangle: usize) -> TriangleKey {
        let mut corners = self.corners(triangle);
        corners.sort_unstable();
        corners
    }

    /// Returns the distance of the worst point of a triangle in units of [`VerticalError::fixed`] if it exceeds the bound, else 0.
    pub(crate) fn excess_over(&self, triangle: usize, bound: &RoundBound) -> u64 {
        let held = &self.held[triangle];
        if held.worst == NONE {
            return 0;
        }
        let [a, b, c] = self.corners(triangle);
        bound.excess(VerticalError { numerator: held.numerator(), area: orient2d(a, b, c) as u64 })
    }

    /// Returns x, y and z of the corners of a triangle.
    pub(crate) fn points(&self, triangle: usize) -> [[i32; 3]; 3] {
        let (sites, heights) = (self.corners(triangle), self.heights(triangle));
        [0, 1, 2].map(|k| [sites[k][0], sites[k][1], heights[k]])
    }

    /// Returns the heights of the corners of a triangle.
    #[inline(always)]
    pub(crate) fn heights(&self, triangle: usize) -> [i32; 3] {
        self.mesh.triangles[triangle].map(|v| self.heights[v.get()])
    }
}
