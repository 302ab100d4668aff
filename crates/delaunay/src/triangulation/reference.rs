//! The reference: `spade`, then canonical flips. The tests compare the pipeline, and divide and conquer, with it.

use crate::error::Error;
use crate::geometry::Site;
use crate::geometry::predicates::orient2d;
use crate::mesh::flip::legalize;
use crate::mesh::half_edge::HalfEdgeMesh;
use crate::mesh::index::{HalfEdgeIndex, SiteIndex};
use spade::{DelaunayTriangulation, HasPosition, InsertionError, Point2, Triangulation as _};

struct SpadeVertex {
    site: Site,
    index: SiteIndex,
}

impl HasPosition for SpadeVertex {
    type Scalar = f64;

    fn position(&self) -> Point2<f64> {
        Point2::new(self.site[0] as f64, self.site[1] as f64)
    }
}

/// Computes the canonical Delaunay triangulation of distinct `sites`. It has no triangle if there are fewer than three sites or all
/// lie on one line.
///
/// # Errors
/// [`Error::Broken`] if `spade` refuses the sites, [`Error::Coincident`] if two of them coincide.
pub fn triangulate(sites: &[Site]) -> crate::Result<HalfEdgeMesh> {
    if collinear(sites) {
        return Ok(HalfEdgeMesh::default());
    }
    let delaunay = match strip_axis(sites) {
        Some(axis) => insert_along(sites, axis),
        None => DelaunayTriangulation::bulk_load(vertices(sites).collect()),
    };
    let delaunay = delaunay.map_err(|e| Error::Broken(format!("the reference triangulation refuses a site: {e}")))?;
    if delaunay.num_vertices() != sites.len() {
        return Err(Error::Coincident);
    }
    let mut mesh = to_mesh(&delaunay);
    legalize(&mut mesh, sites);
    Ok(mesh)
}

fn vertices(sites: &[Site]) -> impl Iterator<Item = SpadeVertex> {
    sites.iter().enumerate().map(|(i, &site)| SpadeVertex { site, index: SiteIndex::new(i) })
}

/// If the sites lie in a strip that is more than this many times longer than wide, they are inserted from one end to the other.
/// Bulk loading works from the middle outwards, and takes up to quadratic time on thin strips; on wide ones it is faster.
const STRIP_RATIO: f64 = 50.0;

/// Returns the axis along which `sites` are a long thin strip, if they are one.
fn strip_axis(sites: &[Site]) -> Option<usize> {
    let count = sites.len() as f64;
    let mean = [0, 1].map(|axis| sites.iter().map(|p| p[axis] as f64).sum::<f64>() / count);
    let offset = |p: &Site| [p[0] as f64 - mean[0], p[1] as f64 - mean[1]];
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for [x, y] in sites.iter().map(offset) {
        (xx, xy, yy) = (xx + x * x, xy + x * y, yy + y * y);
    }
    // The direction in which the sites vary most.
    let angle = 0.5 * (2.0 * xy).atan2(xx - yy);
    let (sin, cos) = angle.sin_cos();
    let extent = |part: &dyn Fn([f64; 2]) -> f64| {
        let parts = || sites.iter().map(offset).map(part);
        parts().fold(f64::NEG_INFINITY, f64::max) - parts().fold(f64::INFINITY, f64::min)
    };
    let length = extent(&|[x, y]| x * cos + y * sin);
    let width = extent(&|[x, y]| y * cos - x * sin);
    (length > STRIP_RATIO * width).then_some(if cos.abs() >= sin.abs() { 0 } else { 1 })
}

/// Inserts the sites in the order of their coordinate on `axis`, each close to the one before.
fn insert_along(sites: &[Site], axis: usize) -> Result<DelaunayTriangulation<SpadeVertex>, InsertionError> {
    let mut ordered: Vec<SpadeVertex> = vertices(sites).collect();
    ordered.sort_unstable_by_key(|vertex| (vertex.site[axis], vertex.site[1 - axis]));
    let mut delaunay = DelaunayTriangulation::new();
    let mut last = None;
    for vertex in ordered {
        last = Some(match last {
            Some(hint) => delaunay.insert_with_hint(vertex, hint)?,
            None => delaunay.insert(vertex)?,
        });
    }
    Ok(delaunay)
}

/// Returns whether distinct `sites` lie on one line. `spade` would find that out too, but in quadratic time.
fn collinear(sites: &[Site]) -> bool {
    match sites {
        [a, b, rest @ ..] => rest.iter().all(|&c| orient2d(*a, *b, c) == 0),
        _ => true,
    }
}

fn to_mesh(delaunay: &DelaunayTriangulation<SpadeVertex>) -> HalfEdgeMesh {
    let faces = delaunay.num_inner_faces();
    let mut half_edge_of = vec![HalfEdgeIndex::HULL; delaunay.num_directed_edges()];
    let mut mesh = HalfEdgeMesh { triangles: Vec::with_capacity(faces), twins: vec![HalfEdgeIndex::HULL; 3 * faces] };
    for face in delaunay.inner_faces() {
        let half_edges = HalfEdgeIndex::of_triangle(mesh.triangles.len());
        let edges = face.adjacent_edges();
        mesh.triangles.push(edges.map(|e| e.from().data().index));
        for (h, edge) in half_edges.into_iter().zip(&edges) {
            half_edge_of[edge.fix().index()] = h;
        }
    }
    for face in delaunay.inner_faces() {
        for edge in face.adjacent_edges() {
            let h = half_edge_of[edge.fix().index()];
            mesh.twins[h.get()] = half_edge_of[edge.rev().fix().index()];
        }
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::flip::fails;

    #[test]
    fn a_lattice_gets_the_one_canonical_triangulation() {
        let forward: Vec<Site> = (0..30).flat_map(|x| (0..20).map(move |y| [x, y])).collect();
        let backward: Vec<Site> = forward.iter().rev().copied().collect();
        assert_eq!(canonical(&forward), canonical(&backward));
        assert_eq!(canonical(&forward).len(), 2 * 29 * 19);
    }

    #[test]
    fn strips_in_any_direction_are_triangulated_like_any_sites() {
        for direction in [[10, 5], [1, 10], [-10, 10], [10, 0], [0, 10]] {
            let strip: Vec<Site> =
                (0..3000).map(|i| [direction[0] * i + i % 3, direction[1] * i + i * i % 5]).collect();
            assert!(strip_axis(&strip).is_some());
            let mesh = triangulate(&strip).unwrap();
            assert!(mesh.half_edges().all(|h| !fails(&mesh, &strip, h)));
            let hull = mesh.hull().count();
            assert_eq!(mesh.triangles.len(), 2 * strip.len() - hull - 2);
        }
        assert_eq!(strip_axis(&[[0, 0], [7, 1], [3, 9], [-4, 2]]), None);
    }

    /// Returns the triangles as coordinates, each from its smallest corner, sorted.
    fn canonical(sites: &[Site]) -> Vec<[Site; 3]> {
        let mesh = triangulate(sites).unwrap();
        let mut triangles: Vec<[Site; 3]> = mesh
            .triangles
            .iter()
            .map(|t| {
                let mut corners = t.map(|v| sites[v.get()]);
                let first = (0..3).min_by_key(|&i| corners[i]).unwrap();
                corners.rotate_left(first);
                corners
            })
            .collect();
        triangles.sort_unstable();
        triangles
    }
}
