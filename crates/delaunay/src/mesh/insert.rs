//! Inserting sites into a Delaunay triangulation one by one: a walk finds the place of each (Green and Sibson 1978, "Computing Dirichlet
//! tessellations in the plane"), and flips make the mesh Delaunay again (Lawson 1977, "Software for C1 surface interpolation").

use crate::geometry::Site;
use crate::geometry::predicates::orient2d;
use crate::mesh::flip::{fails, flip};
use crate::mesh::half_edge::HalfEdgeMesh;
use crate::mesh::index::{HalfEdgeIndex, SiteIndex};

/// Returns the position of a triangle that `p` lies in, or on the border of, looking from triangle `start` on. Returns `None` if `p` lies
/// outside the mesh, or if the walk takes more than `steps`, of which it uses up some. A walk in a Delaunay triangulation always ends.
pub fn locate(mesh: &HalfEdgeMesh, sites: &[Site], start: usize, p: Site, steps: &mut u64) -> Option<usize> {
    let mut triangle = start;
    // The corner at which the side begins that the walk came through; it need not be looked at again.
    let mut entry = 3;
    loop {
        let corners = mesh.triangles[triangle].map(|v| sites[v.get()]);
        let is_beyond = |k: usize| k != entry && orient2d(corners[k], corners[(k + 1) % 3], p) < 0;
        let Some(side) = (0..3).find(|&k| is_beyond(k)) else { return Some(triangle) };
        let twin = mesh.twins[3 * triangle + side];
        *steps = steps.checked_sub(1)?;
        if twin == HalfEdgeIndex::HULL {
            return None;
        }
        (triangle, entry) = (twin.triangle(), twin.corner());
    }
}

/// Inserts site `v` into the canonical Delaunay triangulation `mesh`, which stays one. It lies in this `triangle` or on its border, and no
/// other site is in its place. One or two triangles are added to the end of the mesh, and others near `v` change: `note` gets the position of
/// each, some more than once, those that change before they do.
pub fn insert(mesh: &mut HalfEdgeMesh, sites: &[Site], v: SiteIndex, triangle: usize, mut note: impl FnMut(usize)) {
    note(triangle);
    let on_hull = HalfEdgeIndex::of_triangle(triangle).into_iter().find(|&h| {
        let [from, to] = [mesh.origin(h), mesh.destination(h)].map(|v| sites[v.get()]);
        mesh.twin(h) == HalfEdgeIndex::HULL && orient2d(from, to, sites[v.get()]) == 0
    });
    let first_added = mesh.triangles.len();
    let mut pending = match on_hull {
        Some(h) => split_at_hull(mesh, v, h).to_vec(),
        None => split_inside(mesh, sites, v, triangle, &mut note),
    };
    (first_added..mesh.triangles.len()).for_each(&mut note);
    // The triangle of each of these edges has its apex at `v`. Only such edges can fail: the others were edges of a Delaunay triangulation.
    while let Some(h) = pending.pop() {
        if fails(mesh, sites, h) {
            let g = mesh.twin(h);
            note(g.triangle());
            flip(mesh, h);
            pending.extend([h, g.previous()]);
        }
    }
}

/// Divides a triangle into three that meet at `v`, or two triangles into four if `v` lies on the edge between them. Returns the sides that
/// `v` looks at.
fn split_inside(
    mesh: &mut HalfEdgeMesh,
    sites: &[Site],
    v: SiteIndex,
    triangle: usize,
    mut note: impl FnMut(usize),
) -> Vec<HalfEdgeIndex> {
    let sides = split(mesh, v, triangle);
    let mut pending = sides.to_vec();
    for h in sides {
        let [from, to] = [mesh.origin(h), mesh.destination(h)].map(|v| sites[v.get()]);
        // A triangle without area cannot stay, whatever the circle test says of it.
        if orient2d(from, to, sites[v.get()]) == 0 {
            let twin = mesh.twin(h);
            note(twin.triangle());
            flip(mesh, h);
            pending.push(twin.previous());
            break;
        }
    }
    pending
}

/// Divides the triangle of `h`, an edge of the hull that `v` lies on, into two, and returns the sides that `v` looks at.
fn split_at_hull(mesh: &mut HalfEdgeMesh, v: SiteIndex, h: HalfEdgeIndex) -> [HalfEdgeIndex; 2] {
    let [a, b, c] = [mesh.origin(h), mesh.destination(h), mesh.apex(h)];
    let (of_bc, of_ca) = (mesh.twin(h.next()), mesh.twin(h.previous()));
    let (kept, added) = (h.triangle(), mesh.triangles.len());
    mesh.triangles[kept] = [a, v, c];
    mesh.triangles.push([v, b, c]);
    mesh.twins.resize(3 * mesh.triangles.len(), HalfEdgeIndex::HULL);
    let [av, vc, ca] = HalfEdgeIndex::of_triangle(kept);
    let [vb, bc, cv] = HalfEdgeIndex::of_triangle(added);
    for (h, twin) in [(av, HalfEdgeIndex::HULL), (vb, HalfEdgeIndex::HULL), (bc, of_bc), (ca, of_ca), (vc, cv)] {
        mesh.link(h, twin);
    }
    [bc, ca]
}

/// Divides a triangle into three that meet at `v`, and returns the sides of the old triangle.
fn split(mesh: &mut HalfEdgeMesh, v: SiteIndex, triangle: usize) -> [HalfEdgeIndex; 3] {
    let [a, b, c] = mesh.triangles[triangle];
    let [ab, bv, va] = HalfEdgeIndex::of_triangle(triangle);
    let (of_b, of_c) = (mesh.twin(bv), mesh.twin(va));
    let added = mesh.triangles.len();
    mesh.triangles[triangle] = [a, b, v];
    mesh.triangles.extend([[b, c, v], [c, a, v]]);
    mesh.twins.resize(3 * mesh.triangles.len(), HalfEdgeIndex::HULL);
    let [bc, cv, vb] = HalfEdgeIndex::of_triangle(added);
    let [ca, av, vc] = HalfEdgeIndex::of_triangle(added + 1);
    for (h, twin) in [(bc, of_b), (ca, of_c), (bv, vb), (cv, vc), (av, va)] {
        mesh.link(h, twin);
    }
    [ab, bc, ca]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::triangulation::canonical;
    use proptest::prelude::*;

    /// Returns the corners of the triangles, each from the least on, in order.
    fn normal_form(mesh: &HalfEdgeMesh) -> Vec<[u32; 3]> {
        let turned = |t: &[u32; 3]| {
            let mut t = *t;
            let least = (0..3).min_by_key(|&k| t[k]).unwrap_or(0);
            t.rotate_left(least);
            t
        };
        let mut all: Vec<_> = mesh.corners().iter().map(turned).collect();
        all.sort_unstable();
        all
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]

        /// Few places, so that many sites lie on edges and on circles of others.
        #[test]
        fn a_mesh_that_grew_is_the_mesh_of_all_sites(
            inside in prop::collection::hash_set((0..13i32, 0..13i32), 1..60),
            first in 0..4usize,
        ) {
            let mut sites = vec![[0, 0], [12, 0], [12, 12], [0, 12]];
            sites.extend(inside.iter().take(first).filter(|&&(x, y)| !(x % 12 == 0 && y % 12 == 0)).map(|&(x, y)| [x, y]));
            let mut mesh = canonical(&sites).unwrap();
            let mut near = 0;
            for (x, y) in inside.into_iter().skip(first).filter(|&(x, y)| !(x % 12 == 0 && y % 12 == 0)) {
                let v = SiteIndex::new(sites.len());
                sites.push([x, y]);
                near = locate(&mesh, &sites, near, [x, y], &mut u64::MAX.clone()).unwrap();
                let (before, mut noted) = (mesh.clone(), Vec::new());
                insert(&mut mesh, &sites, v, near, |triangle| noted.push(triangle));
                let is_as_before = |t: usize| before.triangles.get(t) == Some(&mesh.triangles[t]);
                prop_assert!((0..mesh.triangles.len()).all(|t| is_as_before(t) || noted.contains(&t)));
                let is_linked = |h| {
                    let twin = mesh.twin(h);
                    twin == HalfEdgeIndex::HULL || mesh.twin(twin) == h && mesh.origin(twin) == mesh.destination(h)
                };
                prop_assert!(mesh.half_edges().all(is_linked), "not linked");
            }
            prop_assert_eq!(normal_form(&mesh), normal_form(&canonical(&sites).unwrap()));
        }
    }

    #[test]
    fn a_walk_out_of_the_mesh_or_without_steps_finds_nothing() {
        let sites: Vec<Site> = (0..100).map(|i| [i % 10 * 7, i / 10 * 7 + i % 3]).collect();
        let mesh = canonical(&sites).unwrap();
        let from = |p, mut steps| locate(&mesh, &sites, 0, p, &mut steps);
        assert_eq!(from([-1, 30], 1000), None);
        let far = from([60, 60], 1000).unwrap();
        let around = mesh.triangles[far].map(|v| sites[v.get()]);
        assert!((0..3).all(|k| orient2d(around[k], around[(k + 1) % 3], [60, 60]) >= 0));
        assert_eq!(from([60, 60], 1), None);
    }
}
