//! Step C4 as a plain loop: flips edges (Lawson) until every edge satisfies the canonical in-circle decision.

use crate::geometry::Site;
use crate::geometry::predicates::in_circle;
use crate::mesh::half_edge::HalfEdgeMesh;
use crate::mesh::index::{HalfEdgeIndex, SiteIndex};

/// Turns any triangulation of `sites` into their canonical Delaunay triangulation; returns the number of flips.
///
/// The loop always ends, because every flip lowers the surface of the sites lifted to the (symbolically perturbed) paraboloid.
pub fn legalize(mesh: &mut HalfEdgeMesh, sites: &[Site]) -> u64 {
    let first_halves = mesh.half_edges().filter(|&h| mesh.twin(h) > h);
    let mut pending: Vec<HalfEdgeIndex> = first_halves.filter(|&h| fails(mesh, sites, h)).collect();
    let mut flips = 0;
    while let Some(h) = pending.pop() {
        if !fails(mesh, sites, h) {
            continue;
        }
        let g = mesh.twin(h);
        flip(mesh, h);
        flips += 1;
        // The four edges around the two triangles, where the flip has put them.
        pending.extend([h, h.previous(), g, g.previous()]);
    }
    flips
}

/// Returns whether half-edge `h` is an inner edge whose opposite apex lies in the circle of its triangle.
#[inline]
pub fn fails(mesh: &HalfEdgeMesh, sites: &[Site], h: HalfEdgeIndex) -> bool {
    let g = mesh.twin(h);
    if g == HalfEdgeIndex::HULL {
        return false;
    }
    let [a, b, c] = mesh.triangles[h.triangle()].map(|v| sites[v.get()]);
    in_circle(a, b, c, sites[mesh.apex(g).get()])
}

/// Replaces the diagonal `h` of its two triangles by the other diagonal. If `g` is the twin of `h`, the two half-edges of the new
/// diagonal are then `h.next()` and `g.next()`, and `h`, `h.previous()`, `g`, `g.previous()` lie on the outline of the quadrilateral.
pub(crate) fn flip(mesh: &mut HalfEdgeMesh, h: HalfEdgeIndex) {
    let g = mesh.twin(h);
    let (r, s) = (mesh.apex(h), mesh.apex(g));
    let (h_next, g_next) = (h.next(), g.next());
    let (outer_h, outer_g) = (mesh.twin(h_next), mesh.twin(g_next));
    // The triangle of h, p q r, becomes p s r. The triangle of g, q p s, becomes q r s.
    set_origin(mesh, h_next, s);
    set_origin(mesh, g_next, r);
    mesh.link(h, outer_g);
    mesh.link(g, outer_h);
    mesh.link(h_next, g_next);
}

fn set_origin(mesh: &mut HalfEdgeMesh, h: HalfEdgeIndex, site: SiteIndex) {
    mesh.triangles[h.triangle()][h.corner()] = site;
}
