//! Checks what can be checked within one mesh of a tile, and collects its border to be matched with other meshes.

use bytemuck::cast_slice;
use xxhash_rust::xxh3::xxh3_64;

use crate::border::{BorderEdge, BorderSite, MeshBorder};
use crate::exact::{EdgeState, double_area, edge_state, side};
use crate::failures::Failure;
use crate::findings::Findings;
use crate::half_edges::HalfEdgesByOrigin;
use delaunay::geometry::Site;
use terrain::SourceGrid;
use tiles::attributes::PointAttributes;
use tiles::gltf::read::TilePart;

/// Checks `mesh` of tile number `tile`, adds what it finds to `findings`, and returns the border of the mesh and the lattice integers
/// of its vertices.
pub(super) fn check_mesh(
    mesh: &TilePart,
    tile: u32,
    grid: &SourceGrid,
    findings: &mut Findings,
) -> (MeshBorder, Vec<[i32; 3]>) {
    findings.triangles += mesh.triangles.len() as u64;
    let Some(points) = lattice_points(mesh, tile, grid, findings) else { return Default::default() };
    let sites: Vec<Site> = points.iter().map(|p| [p[0], p[1]]).collect();
    let mut check = MeshCheck { mesh, points: &points, sites, tile, grid, findings };
    check.check_triangles();
    let mut half_edges = HalfEdgesByOrigin::new(&mesh.triangles, points.len());
    check.check_edges(&mut half_edges);
    let border = check.border(&half_edges);
    let unused = check.check_use(&half_edges);
    findings.inner_sites += (points.len() - unused - border.sites.len()) as u64;
    (border, points)
}

/// Returns the lattice integers of the vertices, or `None` if some are not on the lattice.
fn lattice_points(mesh: &TilePart, tile: u32, grid: &SourceGrid, findings: &mut Findings) -> Option<Vec<[i32; 3]>> {
    let points = grid.points_of(mesh);
    if points.is_none() {
        for world in grid.strays_of(mesh) {
            findings.failures.note(Failure::OffLattice, tile, || format!("{world:?} m"));
        }
    }
    points
}

struct MeshCheck<'a> {
    mesh: &'a TilePart,
    /// The lattice integers of the vertices.
    points: &'a [[i32; 3]],
    /// The sites of the vertices.
    sites: Vec<Site>,
    tile: u32,
    grid: &'a SourceGrid,
    findings: &'a mut Findings,
}

impl MeshCheck<'_> {
    /// Checks the orientation of the triangles; adds them to area and digest.
    fn check_triangles(&mut self) {
        let coordinates: Vec<[f64; 3]> = self.points.iter().map(|&p| self.grid.coordinates(p)).collect();
        for &triangle in &self.mesh.triangles {
            let [a, b, c] = triangle.map(|v| self.sites[v as usize]);
            if side(a, b, c).is_le() {
                let corners = || [a, b, c].map(|site| self.grid.site_text(site)).join(" ");
                self.findings.failures.note(Failure::NotCounterclockwise, self.tile, corners);
            }
            self.findings.double_area += double_area(a, b, c);
            self.findings.digest.add(triangle.map(|v| coordinates[v as usize]));
        }
    }

    /// Matches the half-edges within the mesh and checks the edges between them. Half-edges that stay unmatched, doubles
    /// included, are matched with those of other meshes.
    fn check_edges(&mut self, half_edges: &mut HalfEdgesByOrigin) {
        half_edges.match_pairs(|corners| {
            let [a, b, c, d] = corners.map(|v| self.sites[v as usize]);
            match edge_state(a, b, c, d) {
                EdgeState::Delaunay => {}
                EdgeState::Tie => self.findings.ties += 1,
                EdgeState::NotDelaunay => {
                    self.findings.failures.note(Failure::NotDelaunay, self.tile, || self.grid.edge_text(a, c));
                }
            }
        });
    }

    /// Returns the half-edges that stayed unmatched, and their ends. Adds the other vertices to their digest.
    fn border(&mut self, half_edges: &HalfEdgesByOrigin) -> MeshBorder {
        let mut edges = Vec::new();
        let mut is_end = vec![false; self.sites.len()];
        for from in 0..self.sites.len() {
            for half_edge in half_edges.of(from).filter(|half_edge| !half_edge.is_matched()) {
                let [to, apex] = [half_edge.to(), half_edge.apex()].map(|v| self.sites[v as usize]);
                edges.push(BorderEdge::new(self.sites[from], to, apex, self.tile));
                is_end[from] = true;
                is_end[half_edge.to() as usize] = true;
            }
        }
        for v in (0..self.sites.len()).filter(|&v| !is_end[v] && half_edges.degree(v) > 0) {
            self.findings.vertices.add(self.points[v]);
        }
        let ends = (0..self.sites.len()).filter(|&v| is_end[v]);
        MeshBorder { edges, sites: ends.map(|v| self.border_site(v)).collect() }
    }

    /// Returns the bits of a vertex that have to be the same in every mesh.
    fn border_site(&self, v: usize) -> BorderSite {
        let position = xxh3_64(cast_slice(&self.mesh.world(v).map(f64::to_bits)));
        let normal = self.mesh.normals.as_ref().map_or([0; 3], |normals| normals.get(v).map(f32::to_bits));
        let color = self.mesh.colors.as_ref().map_or([0; 4], |colors| colors[v]);
        let PointAttributes { classification, intensity } = &self.mesh.attributes;
        let point = [
            classification.as_ref().map_or(0, |classes| u16::from(classes[v])),
            intensity.as_ref().map_or(0, |intensities| intensities[v]),
        ];
        let mut shading = [0; 24];
        shading[..12].copy_from_slice(cast_slice(&normal));
        shading[12..20].copy_from_slice(cast_slice(&color));
        shading[20..].copy_from_slice(cast_slice(&point));
        let (site, height) = (self.sites[v], self.points[v][2]);
        BorderSite { site, position, shading: xxh3_64(&shading), tile: self.tile, height, unshaded: 0, unused: 0 }
    }

    /// Notes the vertices without a triangle and returns their number.
    fn check_use(&mut self, half_edges: &HalfEdgesByOrigin) -> usize {
        let mut unused = 0;
        for v in (0..self.sites.len()).filter(|&v| half_edges.degree(v) == 0) {
            unused += 1;
            self.findings.failures.note(Failure::Unused, self.tile, || self.grid.site_text(self.sites[v]));
        }
        unused
    }
}
