//! Which triangles of a node are final, and what the merge above still needs. This is the proof of the tree merge.
//!
//! A triangle whose circumscribed disc lies strictly inside the node's cell is final: no site outside the cell is inside or on its
//! circle, so it belongs to the triangulation of all sites. The other triangles are pending. The vertices of pending triangles and of
//! the hull are the frontier, which goes up together with the directed edges around the final ground.

use crate::partition::tree::Cell;
use delaunay::geometry::Site;
use delaunay::mesh::half_edge::HalfEdgeMesh;
use delaunay::mesh::index::{HalfEdgeIndex, SiteIndex};

/// What a node decides about a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TriangleState {
    /// It covers ground that is final below this node, so it is not a triangle of the result.
    Covered,
    /// It is a triangle of the result, and this node contributes it.
    Final,
    /// A node above decides.
    Pending,
}

/// What a node decides, and what it passes up.
#[derive(Debug)]
pub struct FinalTriangles {
    /// The state of every triangle of the node's mesh.
    pub states: Vec<TriangleState>,
    /// The sites that go up, ascending.
    pub frontier: Vec<SiteIndex>,
    /// For each of them a half-edge that starts there: the one on the hull if there is one; `None` if the site has no triangle.
    pub half_edges: Vec<Option<HalfEdgeIndex>>,
    /// The directed edges with final ground on their left and none on their right, as positions in `frontier`.
    pub boundary: Vec<[u32; 2]>,
    /// Their half-edges.
    pub boundary_edges: Vec<HalfEdgeIndex>,
}

/// Finds the final triangles of a node. `cell` is `None` at the root, where every triangle that covers new ground is final.
///
/// Only triangles near the hull need a test. Let the disc of a triangle reach a point outside the cell, which contains the hull.
/// Follow the straight line from the triangle to that point: beyond the edge where the line leaves a Delaunay triangle, the disc of
/// the next triangle covers that of the last. So the discs of all triangles along the line reach out too, and a flood from the
/// hull that stops at discs inside the cell meets every triangle whose disc is not.
pub fn find_final(
    mesh: &HalfEdgeMesh,
    sites: &[Site],
    cell: Option<&Cell>,
    covered: impl Fn(usize) -> bool,
) -> FinalTriangles {
    let state = |triangle| if covered(triangle) { TriangleState::Covered } else { TriangleState::Final };
    let states = (0..mesh.triangles.len()).map(state).collect();
    let mut found = FinalTriangles {
        states,
        frontier: Vec::new(),
        half_edges: Vec::new(),
        boundary: Vec::new(),
        boundary_edges: Vec::new(),
    };
    if let Some(cell) = cell {
        let hull: Vec<HalfEdgeIndex> = mesh.hull().collect();
        let pending = found.mark_pending(mesh, sites, cell, &hull);
        let position = found.find_frontier(mesh, &pending, &hull, sites.len());
        found.find_boundary(mesh, &pending, &hull, &position);
    }
    found
}

impl FinalTriangles {
    /// Marks the triangles that a node above decides, and returns them, ascending.
    fn mark_pending(&mut self, mesh: &HalfEdgeMesh, sites: &[Site], cell: &Cell, hull: &[HalfEdgeIndex]) -> Vec<usize> {
        let mut reached = vec![false; mesh.triangles.len()];
        let mut flood: Vec<usize> = hull.iter().map(|h| h.triangle()).collect();
        let mut pending = Vec::new();
        while let Some(t) = flood.pop() {
            let [a, b, c] = mesh.triangles[t].map(|v| sites[v.get()]);
            if std::mem::replace(&mut reached[t], true) || cell.holds_disc(a, b, c) {
                continue;
            }
            if self.states[t] == TriangleState::Final {
                self.states[t] = TriangleState::Pending;
                pending.push(t);
            }
            let twins = HalfEdgeIndex::of_triangle(t).map(|h| mesh.twin(h));
            flood.extend(twins.into_iter().filter(|&twin| twin != HalfEdgeIndex::HULL).map(HalfEdgeIndex::triangle));
        }
        pending.sort_unstable();
        pending
    }

    /// Fills `frontier` and `half_edges`, and returns the position of every frontier site in the frontier.
    fn find_frontier(
        &mut self,
        mesh: &HalfEdgeMesh,
        pending: &[usize],
        hull: &[HalfEdgeIndex],
        sites: usize,
    ) -> Vec<u32> {
        let mut starts = vec![None; sites];
        for h in pending.iter().flat_map(|&t| HalfEdgeIndex::of_triangle(t)).chain(hull.iter().copied()) {
            starts[mesh.origin(h).get()] = Some(h);
        }
        let mut position = vec![0; sites];
        // If there is no triangle, every site lies on the hull.
        let is_frontier = |start: &Option<HalfEdgeIndex>| start.is_some() || mesh.triangles.is_empty();
        for (site, start) in starts.into_iter().enumerate().filter(|(_, start)| is_frontier(start)) {
            position[site] = self.frontier.len() as u32;
            self.frontier.push(SiteIndex::new(site));
            self.half_edges.push(start);
        }
        position
    }

    /// Fills `boundary` with the edges of final ground that pending triangles see from outside, and those on the hull.
    fn find_boundary(&mut self, mesh: &HalfEdgeMesh, pending: &[usize], hull: &[HalfEdgeIndex], position: &[u32]) {
        let is_pending = |h: HalfEdgeIndex| self.states[h.triangle()] == TriangleState::Pending;
        let seen = pending.iter().flat_map(|&t| HalfEdgeIndex::of_triangle(t)).map(|h| mesh.twin(h));
        let inner = seen.filter(|&h| h != HalfEdgeIndex::HULL && !is_pending(h));
        let outer = hull.iter().copied().filter(|&h| !is_pending(h));
        let ends = |h: HalfEdgeIndex| [mesh.origin(h), mesh.destination(h)].map(|v| position[v.get()]);
        self.boundary_edges = inner.chain(outer).collect();
        self.boundary = self.boundary_edges.iter().map(|&h| ends(h)).collect();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use delaunay::geometry::predicates::{in_circle_determinant, orient2d};
    use delaunay::triangulation::canonical;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    /// Tells whether a lattice point outside `cell` lies in or on the circle through abc. If any point of a line of lattice points
    /// lies in the disc, so does one next to the middle of the chord.
    fn reaches_out(cell: &Cell, [a, b, c]: [Site; 3]) -> bool {
        let double_area = orient2d(a, b, c) as f64;
        let from_a = |p: Site| [0, 1].map(|k| (p[k] - a[k]) as f64);
        let ([bx, by], [cx, cy]) = (from_a(b), from_a(c));
        let (bb, cc) = (bx * bx + by * by, cx * cx + cy * cy);
        let center = [(bb * cy - cc * by) / (2.0 * double_area), (cc * bx - bb * cx) / (2.0 * double_area)];
        (0..2).any(|axis| {
            let middle = (center[1 - axis] + a[1 - axis] as f64).clamp(-1e8, 1e8) as i32;
            [cell.min[axis] - 1, cell.max[axis]].into_iter().any(|beyond| {
                (middle - 2..=middle + 2).any(|along| {
                    let mut point = [along; 2];
                    point[axis] = beyond as i32;
                    in_circle_determinant(a, b, c, point) >= 0
                })
            })
        })
    }

    proptest! {
        /// The sites are grids with many cocircular sites, scattered, or nearly on a line.
        #[test]
        fn discs_of_final_triangles_reach_no_site_outside(
            sites in prop::collection::btree_set(prop::array::uniform2(0i32..200), 3..150),
            squeeze in prop::array::uniform2(prop::sample::select(vec![1, 7, 60])),
            room in prop::array::uniform4(0i64..20),
        ) {
            let sites: BTreeSet<Site> = sites.into_iter().map(|p| [p[0] / squeeze[0], p[1] / squeeze[1]]).collect();
            let sites = Vec::from_iter(sites);
            let along = |axis: usize| sites.iter().map(move |p| p[axis] as i64);
            let low = [0, 1].map(|axis| along(axis).min().unwrap() - room[axis]);
            let high = [0, 1].map(|axis| along(axis).max().unwrap() + 1 + room[2 + axis]);
            let cell = Cell { min: low, max: high };
            let mesh = canonical(&sites).unwrap();
            let found = find_final(&mesh, &sites, Some(&cell), |_| false);
            for (corners, state) in mesh.triangles.iter().zip(&found.states) {
                let [a, b, c] = corners.map(|v| sites[v.get()]);
                prop_assert!(*state == TriangleState::Pending || !reaches_out(&cell, [a, b, c]), "{a:?} {b:?} {c:?} in {cell:?}");
                prop_assert!(*state == TriangleState::Final || !cell.holds_disc(a, b, c));
            }
            for (&site, &start) in found.frontier.iter().zip(&found.half_edges) {
                let around = start.into_iter().flat_map(|start| mesh.around(start));
                let corners = mesh.triangles.iter().flatten().filter(|&&v| v == site).count();
                prop_assert_eq!(around.count(), corners);
            }
        }
    }
}
