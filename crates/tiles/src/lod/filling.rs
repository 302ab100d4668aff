//! The triangulation of some vertices of a terrain. It can take in more vertices.

use crate::lod::vertex_cells::plane;
use delaunay::geometry::Site;
use delaunay::mesh::half_edge::HalfEdgeMesh;
use delaunay::mesh::index::{HalfEdgeIndex, SiteIndex};
use delaunay::mesh::insert::{insert, locate};
use delaunay::mesh::region::covered;
use delaunay::triangulation;
use delaunay::triangulation::canonical;
use sys::{Error, Result};

/// The Delaunay triangulation of some of a terrain's vertices, among them those on the convex hull of all.
pub(crate) struct Filling<'a> {
    /// The vertices of the terrain.
    terrain: &'a [[i32; 3]],
    /// The number in the terrain of every site of the mesh.
    pub(crate) vertices: Vec<u32>,
    /// The x, y, z of every site. The height may not be that of the terrain.
    pub(crate) positions: Vec<[i32; 3]>,
    sites: Vec<Site>,
    mesh: HalfEdgeMesh,
}

impl<'a> Filling<'a> {
    /// Triangulates those vertices of `terrain` that are `kept`.
    ///
    /// # Errors
    /// [`Error::Broken`] if they have no triangle, [`Error::Interrupted`].
    pub(crate) fn new(terrain: &'a [[i32; 3]], kept: &[bool]) -> Result<Filling<'a>> {
        let mut vertices = Vec::with_capacity(kept.iter().filter(|kept| **kept).count());
        vertices.extend((0u32..).zip(kept).filter(|(_, kept)| **kept).map(|(v, _)| v));
        let positions: Vec<[i32; 3]> = vertices.iter().map(|&v| terrain[v as usize]).collect();
        let sites: Vec<Site> = positions.iter().map(|&p| plane(p)).collect();
        let mesh = canonical(&sites).map_err(|e| Error::of_triangulation(e.is_stopped(), e))?;
        if mesh.triangles.is_empty() {
            return Err(Error::Broken("a terrain without triangles cannot be simplified".into()));
        }
        Ok(Filling { terrain, vertices, positions, sites, mesh })
    }

    /// Returns the triangulation of the vertices that are `kept`, among them all that this one has. They keep their heights.
    ///
    /// # Errors
    /// As [`Filling::new`].
    pub(crate) fn again_with(self, kept: &[bool]) -> Result<Filling<'a>> {
        let number = self.numbers();
        let mut again = Filling::new(self.terrain, kept)?;
        for (position, &v) in again.positions.iter_mut().zip(&again.vertices) {
            if let Some(known) = self.positions.get(number[v as usize] as usize) {
                *position = *known;
            }
        }
        Ok(again)
    }

    /// Returns the number of triangles.
    pub(crate) fn triangles(&self) -> usize {
        self.mesh.triangles.len()
    }

    /// Returns the corners of a triangle as numbers of sites.
    #[inline(always)]
    pub(crate) fn corners(&self, triangle: usize) -> [u32; 3] {
        self.mesh.triangles[triangle].map(|v| v.0)
    }

    /// Returns the triangles that share a side with this one.
    pub(crate) fn neighbours(&self, triangle: usize) -> impl Iterator<Item = usize> {
        let twins = HalfEdgeIndex::of_triangle(triangle).map(|h| self.mesh.twin(h));
        twins.into_iter().filter(|&twin| twin != HalfEdgeIndex::HULL).map(HalfEdgeIndex::triangle)
    }

    /// Returns the border of the triangles that are `shown`.
    pub(crate) fn border(&self, shown: &[bool]) -> Border {
        let mesh = &self.mesh;
        let is_shown = |h: HalfEdgeIndex| h != HalfEdgeIndex::HULL && shown[h.triangle()];
        let ends_of = |h: HalfEdgeIndex| [mesh.origin(h).0, mesh.destination(h).0];
        let mut on_border: Vec<HalfEdgeIndex> =
            mesh.half_edges().filter(|&h| is_shown(h) && !is_shown(mesh.twin(h))).collect();
        on_border.sort_unstable_by_key(|&h| ends_of(h));
        let edges: Vec<[u32; 2]> = on_border.iter().map(|&h| ends_of(h)).collect();
        let mut arriving = Vec::with_capacity(edges.len());
        for &h in &on_border {
            let mut last = h.previous();
            while is_shown(mesh.twin(last)) {
                last = mesh.twin(last).previous();
            }
            arriving.push(edges.partition_point(|edge| *edge < ends_of(last)) as u32);
        }
        Border { edges, arriving }
    }

    /// Returns the triangle under vertex `v` of the terrain, looking from triangle `start` on; `None` if that takes more than `steps`.
    pub(crate) fn locate(&self, v: u32, start: usize, steps: &mut u64) -> Option<usize> {
        locate(&self.mesh, &self.sites, start, plane(self.terrain[v as usize]), steps)
    }

    /// Takes in vertex `v`, which the mesh does not have, and looks for its place from triangle `start` on. It leaves the vertex out if
    /// that takes more than `steps`.
    pub(crate) fn insert(&mut self, v: u32, start: usize, steps: &mut u64, note: impl FnMut(usize)) {
        let Some(triangle) = self.locate(v, start, steps) else { return };
        let position = self.terrain[v as usize];
        self.vertices.push(v);
        self.positions.push(position);
        self.sites.push(plane(position));
        insert(&mut self.mesh, &self.sites, SiteIndex::new(self.sites.len() - 1), triangle, note);
    }

    /// Marks the triangles on the left of the directed edges `outline` between vertices of the terrain.
    ///
    /// # Errors
    /// [`Error::Broken`] if one of them is not in the triangulation.
    pub(crate) fn within(&self, outline: &[[u32; 2]]) -> Result<Vec<bool>> {
        let number = self.numbers();
        let edges: Vec<_> = outline.iter().map(|edge| edge.map(|v| SiteIndex(number[v as usize]))).collect();
        covered(&self.mesh, &edges).map_err(|e| Error::of_triangulation(e.is_stopped(), e))
    }

    /// Returns the number of the site of each vertex of the terrain, `u32::MAX` for those that are left out.
    pub(crate) fn numbers(&self) -> Vec<u32> {
        let mut number = vec![u32::MAX; self.terrain.len()];
        self.vertices.iter().zip(0..).for_each(|(&v, site)| number[v as usize] = site);
        number
    }

    /// Returns the triangles that are `shown`, with the vertices in the order of the terrain, and the number there of each site. Each vertex
    /// is the corner of a triangle.
    pub(crate) fn coarse(&self, shown: &[bool]) -> (CoarseMesh, Vec<u32>) {
        let mut triangles = Vec::with_capacity(self.mesh.triangles.len());
        triangles.extend((0..self.triangles()).filter(|&t| shown[t]).map(|t| self.corners(t)));
        let mut is_corner = vec![false; self.vertices.len()];
        triangles.as_flattened().iter().for_each(|&site| is_corner[site as usize] = true);
        let mut order: Vec<u32> = (0..self.vertices.len() as u32).filter(|&site| is_corner[site as usize]).collect();
        // Most are in order already, which a stable sort makes use of.
        order.sort_by_key(|&site| self.vertices[site as usize]);
        let mut number = vec![u32::MAX; self.vertices.len()];
        order.iter().zip(0..).for_each(|(&site, n)| number[site as usize] = n);
        triangles.as_flattened_mut().iter_mut().for_each(|corner| *corner = number[*corner as usize]);
        let vertices = order.iter().map(|&site| self.vertices[site as usize]).collect();
        let positions = order.iter().map(|&site| self.positions[site as usize]).collect();
        (CoarseMesh { vertices, positions, triangles }, number)
    }

    /// Lets other triangulations have the memory.
    pub(crate) fn recycle(self) {
        triangulation::recycle(self.mesh);
    }
}

/// The edges around some triangles of a [`Filling`].
pub(crate) struct Border {
    /// Their ends, sorted. The triangles are on the left.
    pub(crate) edges: Vec<[u32; 2]>,
    /// For each edge the number of the one that arrives where it begins, on the other side of the triangles there.
    pub(crate) arriving: Vec<u32>,
}

/// A mesh between some vertices of a terrain.
#[derive(Clone, Debug, Default)]
pub struct CoarseMesh {
    /// The number in the terrain of every vertex, ascending.
    pub vertices: Vec<u32>,
    /// The lattice integers x, y, z of every vertex. They may have other heights than in the terrain.
    pub positions: Vec<[i32; 3]>,
    /// The triangles, counterclockwise seen from above.
    pub triangles: Vec<[u32; 3]>,
}
