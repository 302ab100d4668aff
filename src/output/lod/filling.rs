//! The triangulation of some vertices of a terrain within the terrain's boundary. It can take in more vertices.

use crate::geometry::Site;
use crate::mesh::half_edge::HalfEdgeMesh;
use crate::mesh::index::SiteIndex;
use crate::mesh::insert::{insert, locate};
use crate::mesh::region::covered;
use crate::output::lod::vertex_cells::plane;
use crate::triangulation::{self, canonical};
use crate::{Error, Result};

/// The Delaunay triangulation of some of a terrain's vertices. The boundary's edges are among its edges, whichever vertices it has: see
/// `simplify.rs`. So a triangle between vertices of the terrain lies within the boundary as a whole, or not at all.
pub(crate) struct Filling<'a> {
    /// The vertices of the terrain.
    positions: &'a [[i32; 3]],
    /// The number in the terrain of every site of the mesh.
    vertices: Vec<u32>,
    sites: Vec<Site>,
    mesh: HalfEdgeMesh,
    /// Which triangles of the mesh lie within the boundary.
    within: Vec<bool>,
}

impl<'a> Filling<'a> {
    /// Triangulates those of `positions` that are `kept`, among them all ends of the `boundary`, which has the terrain on its left.
    ///
    /// # Errors
    /// [`Error::Broken`] if the boundary is not that of a part of a Delaunay triangulation, [`Error::Interrupted`].
    pub(crate) fn new(positions: &'a [[i32; 3]], kept: &[bool], boundary: &[[u32; 2]]) -> Result<Filling<'a>> {
        let mut vertices = Vec::with_capacity(kept.iter().filter(|kept| **kept).count());
        vertices.extend((0u32..).zip(kept).filter(|(_, kept)| **kept).map(|(v, _)| v));
        let mut number = vec![SiteIndex(u32::MAX); kept.len()];
        vertices.iter().zip(0..).for_each(|(&v, n)| number[v as usize] = SiteIndex(n));
        let sites: Vec<Site> = vertices.iter().map(|&v| plane(positions[v as usize])).collect();
        let mesh = canonical(&sites)?;
        let boundary: Vec<_> = boundary.iter().map(|edge| edge.map(|v| number[v as usize])).collect();
        let within = covered(&mesh, &boundary)?;
        if !within.contains(&true) {
            return Err(Error::Broken("a terrain without triangles cannot be simplified".into()));
        }
        Ok(Filling { positions, vertices, sites, mesh, within })
    }

    /// Returns the number of triangles of the mesh, within the boundary and without.
    pub(crate) fn triangles(&self) -> usize {
        self.mesh.triangles.len()
    }

    /// Returns the number in the terrain of the corners of a triangle, or `None` if it does not lie within the boundary.
    pub(crate) fn corners(&self, triangle: usize) -> Option<[u32; 3]> {
        self.within[triangle].then(|| self.mesh.triangles[triangle].map(|v| self.vertices[v.get()]))
    }

    /// Returns the triangle under vertex `v` of the terrain, looking from triangle `start` on; `None` if that takes more than `steps`.
    pub(crate) fn locate(&self, v: u32, start: usize, steps: &mut u64) -> Option<usize> {
        locate(&self.mesh, &self.sites, start, plane(self.positions[v as usize]), steps)
    }

    /// Takes in vertex `v`, which the mesh does not have, and looks for its place from triangle `start` on. It leaves the vertex out if
    /// that takes more than `steps`; returns whether it is in.
    pub(crate) fn insert(&mut self, v: u32, start: usize, steps: &mut u64) -> bool {
        let Some(triangle) = self.locate(v, start, steps).filter(|&triangle| self.within[triangle]) else {
            return false;
        };
        self.vertices.push(v);
        self.sites.push(plane(self.positions[v as usize]));
        insert(&mut self.mesh, &self.sites, SiteIndex::new(self.sites.len() - 1), triangle);
        // Flips cross no edge of the boundary, so triangles stay on their side of it.
        self.within.resize(self.mesh.triangles.len(), true);
        true
    }

    /// Returns the triangles within the boundary, between vertices of the terrain.
    pub(crate) fn into_triangles(self) -> Vec<[u32; 3]> {
        let mut triangles = Vec::with_capacity(self.mesh.triangles.len());
        triangles.extend((0..self.mesh.triangles.len()).filter_map(|triangle| self.corners(triangle)));
        triangulation::recycle(self.mesh);
        triangles
    }
}
