//! The triangulation of some vertices of a terrain within the terrain's boundary. It can take in more vertices.

use crate::lod::vertex_cells::plane;
use delaunay::geometry::Site;
use delaunay::mesh::half_edge::HalfEdgeMesh;
use delaunay::mesh::index::SiteIndex;
use delaunay::mesh::insert::{insert, locate};
use delaunay::mesh::region::covered;
use delaunay::triangulation;
use delaunay::triangulation::canonical;
use sys::{Error, Result};

/// The Delaunay triangulation of some of a terrain's vertices. The boundary's edges are among its edges, whichever vertices it has: see
/// `simplify.rs`. So a triangle between vertices of the terrain lies within the boundary as a whole, or not at all.
pub(crate) struct Filling<'a> {
    /// The vertices of the terrain.
    terrain: &'a [[i32; 3]],
    /// The number in the terrain of every site of the mesh.
    pub(crate) vertices: Vec<u32>,
    /// The x, y, z of every site. The height may not be that of the terrain.
    pub(crate) positions: Vec<[i32; 3]>,
    sites: Vec<Site>,
    mesh: HalfEdgeMesh,
    /// Which triangles of the mesh lie within the boundary.
    within: Vec<bool>,
}

impl<'a> Filling<'a> {
    /// Triangulates those vertices of `terrain` that are `kept`, among them all ends of the `boundary`, which has the terrain on its
    /// left.
    ///
    /// # Errors
    /// [`Error::Broken`] if the boundary is not that of a part of a Delaunay triangulation, [`Error::Interrupted`].
    pub(crate) fn new(terrain: &'a [[i32; 3]], kept: &[bool], boundary: &[[u32; 2]]) -> Result<Filling<'a>> {
        let mut vertices = Vec::with_capacity(kept.iter().filter(|kept| **kept).count());
        vertices.extend((0u32..).zip(kept).filter(|(_, kept)| **kept).map(|(v, _)| v));
        let mut number = vec![SiteIndex(u32::MAX); kept.len()];
        vertices.iter().zip(0..).for_each(|(&v, n)| number[v as usize] = SiteIndex(n));
        let positions: Vec<[i32; 3]> = vertices.iter().map(|&v| terrain[v as usize]).collect();
        let sites: Vec<Site> = positions.iter().map(|&p| plane(p)).collect();
        let mesh = canonical(&sites).map_err(|e| Error::of_triangulation(e.is_stopped(), e))?;
        let boundary: Vec<_> = boundary.iter().map(|edge| edge.map(|v| number[v as usize])).collect();
        let within = covered(&mesh, &boundary).map_err(|e| Error::of_triangulation(e.is_stopped(), e))?;
        if !within.contains(&true) {
            return Err(Error::Broken("a terrain without triangles cannot be simplified".into()));
        }
        Ok(Filling { terrain, vertices, positions, sites, mesh, within })
    }

    /// Returns the number of triangles of the mesh, within the boundary and without.
    pub(crate) fn triangles(&self) -> usize {
        self.mesh.triangles.len()
    }

    /// Returns the corners of a triangle as numbers of sites, or `None` if it does not lie within the boundary.
    #[inline(always)]
    pub(crate) fn corners(&self, triangle: usize) -> Option<[u32; 3]> {
        self.within[triangle].then(|| self.mesh.triangles[triangle].map(|v| v.0))
    }

    /// Returns the triangle under vertex `v` of the terrain, looking from triangle `start` on; `None` if that takes more than `steps`.
    pub(crate) fn locate(&self, v: u32, start: usize, steps: &mut u64) -> Option<usize> {
        locate(&self.mesh, &self.sites, start, plane(self.terrain[v as usize]), steps)
    }

    /// Takes in vertex `v`, which the mesh does not have, and looks for its place from triangle `start` on. It leaves the vertex out if
    /// that takes more than `steps`.
    pub(crate) fn insert(&mut self, v: u32, start: usize, steps: &mut u64) {
        let Some(triangle) = self.locate(v, start, steps).filter(|&triangle| self.within[triangle]) else { return };
        let position = self.terrain[v as usize];
        self.vertices.push(v);
        self.positions.push(position);
        self.sites.push(plane(position));
        insert(&mut self.mesh, &self.sites, SiteIndex::new(self.sites.len() - 1), triangle, |_| {});
        // Flips cross no edge of the boundary, so triangles stay on their side of it.
        self.within.resize(self.mesh.triangles.len(), true);
    }

    /// Returns the triangles within the boundary, with the vertices in the order of the terrain. Each is the corner of a triangle.
    pub(crate) fn into_coarse(self) -> CoarseMesh {
        let mut order: Vec<u32> = (0..self.vertices.len() as u32).collect();
        // Most are in order already, which a stable sort makes use of.
        order.sort_by_key(|&site| self.vertices[site as usize]);
        let mut number = vec![0; order.len()];
        order.iter().zip(0..).for_each(|(&site, n)| number[site as usize] = n);
        let mut triangles = Vec::with_capacity(self.mesh.triangles.len());
        let within = (0..self.mesh.triangles.len()).filter_map(|triangle| self.corners(triangle));
        triangles.extend(within.map(|corners| corners.map(|site| number[site as usize])));
        let vertices = order.iter().map(|&site| self.vertices[site as usize]).collect();
        let positions = order.iter().map(|&site| self.positions[site as usize]).collect();
        triangulation::recycle(self.mesh);
        CoarseMesh { vertices, positions, triangles }
    }
}

/// A mesh between some vertices of a terrain.
#[derive(Debug, Default)]
pub struct CoarseMesh {
    /// The number in the terrain of every vertex, ascending.
    pub vertices: Vec<u32>,
    /// The lattice integers x, y, z of every vertex. Those inside may have other heights than in the terrain.
    pub positions: Vec<[i32; 3]>,
    /// The triangles, counterclockwise seen from above.
    pub triangles: Vec<[u32; 3]>,
}
