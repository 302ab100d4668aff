//! The exact judge: whether a mesh is the canonical Delaunay triangulation of its sites, by definition and with 128-bit
//! integers. It shares no line with the program.

use std::collections::{HashMap, HashSet};

use delaunay::geometry::Site;
use delaunay::mesh::half_edge::HalfEdgeMesh;
use delaunay::mesh::index::HalfEdgeIndex;

/// Panics unless every triangle turns left, edges meet in pairs, the hull is convex and holds every site on it, Euler's formula
/// holds, and every edge is Delaunay with ties decided by the rule: the lexicographically last of four counts as outside.
pub(crate) fn judge(sites: &[Site], mesh: &HalfEdgeMesh) {
    if sites.len() < 3 || sites.iter().all(|&p| area(sites[0], sites[1], p) == 0) {
        assert!(mesh.triangles.is_empty(), "triangles on a line");
        return;
    }
    let at = |v: u32| sites[v as usize];
    let mut apex_of: HashMap<[u32; 2], u32> = HashMap::new();
    for &[a, b, c] in mesh.corners() {
        assert!(area(at(a), at(b), at(c)) > 0, "a triangle that does not turn left");
        for (edge, apex) in [([a, b], c), ([b, c], a), ([c, a], b)] {
            assert!(apex_of.insert(edge, apex).is_none(), "two triangles on one side of an edge");
        }
    }
    let mut hull = Vec::new();
    for (&[p, q], &apex) in &apex_of {
        match apex_of.get(&[q, p]) {
            Some(&other) => assert!(is_delaunay([at(p), at(q), at(apex), at(other)]), "an edge that is not Delaunay"),
            None => hull.push([p, q]),
        }
    }
    check_hull(sites, &hull);
    let used: HashSet<u32> = mesh.corners().iter().flatten().copied().collect();
    assert_eq!(used.len(), sites.len(), "a site without a triangle");
    assert_eq!(mesh.triangles.len(), 2 * sites.len() - hull.len() - 2, "Euler's formula");
    assert_eq!(mesh.hull().count(), hull.len());
    for (h, twin) in mesh.half_edges().map(|h| (h, mesh.twin(h))).filter(|(_, twin)| *twin != HalfEdgeIndex::HULL) {
        assert_eq!(mesh.twin(twin), h, "twins that are none");
        assert_eq!(mesh.origin(h), mesh.destination(twin), "twins with other ends");
    }
}

/// Every edge of the hull has all sites on its left, but for those on the edge's line beyond its ends.
fn check_hull(sites: &[Site], hull: &[[u32; 2]]) {
    for &[p, q] in hull {
        let (p, q) = (sites[p as usize], sites[q as usize]);
        for &site in sites {
            let is_between = || dot(p, q, site) > 0 && dot(q, p, site) > 0;
            let side = area(p, q, site);
            assert!(side > 0 || side == 0 && !is_between(), "a hull that is not convex, or leaves out a site on it");
        }
    }
}

/// Whether the edge pq between the triangles pqr and qps is Delaunay.
fn is_delaunay([p, q, r, s]: [Site; 4]) -> bool {
    let lifted = |v: Site| {
        let (x, y) = (v[0] as i128 - s[0] as i128, v[1] as i128 - s[1] as i128);
        [x, y, x * x + y * y]
    };
    let ([a, b, c], [d, e, f], [g, h, i]) = (lifted(p), lifted(q), lifted(r));
    match a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) {
        0 => p.max(q) < r.max(s),
        inside => inside < 0,
    }
}

/// Twice the area of abc, positive if it turns left.
fn area(a: Site, b: Site, c: Site) -> i128 {
    let [ux, uy, vx, vy] = [b[0], b[1], c[0], c[1]].map(i128::from);
    (ux - a[0] as i128) * (vy - a[1] as i128) - (uy - a[1] as i128) * (vx - a[0] as i128)
}

/// How far c lies in the direction from a to b.
fn dot(a: Site, b: Site, c: Site) -> i128 {
    let [ux, uy, vx, vy] = [b[0], b[1], c[0], c[1]].map(i128::from);
    (ux - a[0] as i128) * (vx - a[0] as i128) + (uy - a[1] as i128) * (vy - a[1] as i128)
}
