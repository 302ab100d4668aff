//! Step C4 as a plain loop: flips edges (Lawson) until every edge satisfies the canonical in-circle decision.

use crate::geometry::{Site, predicates::in_circle};
use crate::mesh::half_edge::{HULL, HalfEdgeMesh, next, previous};

/// Turns any triangulation of `sites` into their canonical Delaunay triangulation; returns the number of flips.
///
/// The loop always ends, because every flip lowers the surface of the sites lifted to the (symbolically perturbed) paraboloid.
pub fn legalize(mesh: &mut HalfEdgeMesh, sites: &[Site]) -> u64 {
    let is_first_half = |&h: &u32| mesh.twins[h as usize] > h;
    let half_edges = (0..mesh.twins.len() as u32).filter(is_first_half);
    let mut pending: Vec<u32> = half_edges.filter(|&h| fails(mesh, sites, h)).collect();
    let mut flips = 0;
    while let Some(h) = pending.pop() {
        if !fails(mesh, sites, h) {
            continue;
        }
        let g = mesh.twins[h as usize];
        flip(mesh, h);
        flips += 1;
        // The four edges around the two triangles, where the flip has put them.
        pending.extend([h, previous(h), g, previous(g)]);
    }
    flips
}

/// Returns whether half-edge `h` is an inner edge whose opposite apex lies in the circle of its triangle.
#[inline]
pub fn fails(mesh: &HalfEdgeMesh, sites: &[Site], h: u32) -> bool {
    let g = mesh.twins[h as usize];
    if g == HULL {
        return false;
    }
    let [a, b, c] = mesh.triangles[h as usize / 3].map(|v| sites[v as usize]);
    in_circle(a, b, c, sites[mesh.apex(g) as usize])
}

/// Replaces the diagonal `h` of its two triangles by the other diagonal. Afterwards `next(h)` and `next(g)` are the two
/// half-edges of the new diagonal, and `h`, `previous(h)`, `g`, `previous(g)` lie on the outline of the quadrilateral.
fn flip(mesh: &mut HalfEdgeMesh, h: u32) {
    let g = mesh.twins[h as usize];
    let (r, s) = (mesh.apex(h), mesh.apex(g));
    let (h_next, g_next) = (next(h), next(g));
    let (outer_h, outer_g) = (mesh.twins[h_next as usize], mesh.twins[g_next as usize]);
    // The triangle of h, p q r, becomes p s r. The triangle of g, q p s, becomes q r s.
    set_origin(mesh, h_next, s);
    set_origin(mesh, g_next, r);
    link(mesh, h, outer_g);
    link(mesh, g, outer_h);
    link(mesh, h_next, g_next);
}

fn set_origin(mesh: &mut HalfEdgeMesh, h: u32, site: u32) {
    mesh.triangles[h as usize / 3][h as usize % 3] = site;
}

fn link(mesh: &mut HalfEdgeMesh, h: u32, twin: u32) {
    mesh.twins[h as usize] = twin;
    if twin != HULL {
        mesh.twins[twin as usize] = h;
    }
}
