//! Which triangles of a node are done, and what its parent still needs: design of the tree merge.
//!
//! A triangle whose circumscribed disc lies strictly inside the node's cell is closed: no site outside the cell can be
//! inside or on its circle, so it belongs to the triangulation of all sites. Whoever touches a triangle that is not
//! closed, or the hull, is in the frontier and goes up, with the directed edges round the closed ground.

use crate::geometry::Site;
use crate::job::partition::tree::Cell;
use crate::mesh::half_edge::{HULL, HalfEdgeMesh};

/// What has become of a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// It covers ground that is closed below this node, and is no triangle of the result.
    Covered,
    /// It is a triangle of the result, contributed by this node.
    Closed,
    /// A node above decides.
    Open,
}

/// The outcome for one node.
#[derive(Debug)]
pub struct Closing {
    /// For every triangle of the node's mesh.
    pub states: Vec<State>,
    /// The sites that go up, ascending.
    pub frontier: Vec<u32>,
    /// For each of them a half-edge that starts there, the one on the hull if there is one; [`HULL`] if it has no triangle.
    pub spokes: Vec<u32>,
    /// The directed edges that have closed ground on their left and none on their right, as positions in `frontier`.
    pub boundary: Vec<[u32; 2]>,
}

/// Closes what can be closed. `cell` is `None` at the root, where everything left is a triangle of the result.
///
/// Only triangles near the hull are looked at. If the disc of a triangle reaches a point outside the cell, which holds the
/// hull, so do the discs of all triangles on the straight way from it to that point: beyond the edge where the way leaves a
/// Delaunay triangle, the disc of the next one covers that of the last. So a flood from the hull that
/// stops at held discs meets all that are not held.
pub fn close(mesh: &HalfEdgeMesh, sites: &[Site], cell: Option<&Cell>, covered: impl Fn(usize) -> bool) -> Closing {
    let state = |triangle| if covered(triangle) { State::Covered } else { State::Closed };
    let states = (0..mesh.triangles.len()).map(state).collect();
    let mut closing = Closing { states, frontier: Vec::new(), spokes: Vec::new(), boundary: Vec::new() };
    if let Some(cell) = cell {
        let hull: Vec<u32> = (0..).zip(&mesh.twins).filter(|(_, twin)| **twin == HULL).map(|(h, _)| h).collect();
        let open = closing.open(mesh, sites, cell, &hull);
        let position = closing.find_frontier(mesh, &open, &hull, sites.len());
        closing.find_boundary(mesh, &open, &hull, &position);
    }
    closing
}

impl Closing {
    /// Marks the triangles that a node above decides; returns them, ascending.
    fn open(&mut self, mesh: &HalfEdgeMesh, sites: &[Site], cell: &Cell, hull: &[u32]) -> Vec<u32> {
        let mut reached = vec![false; mesh.triangles.len()];
        let mut pending: Vec<u32> = hull.iter().map(|h| h / 3).collect();
        let mut open = Vec::new();
        while let Some(triangle) = pending.pop() {
            let t = triangle as usize;
            let [a, b, c] = mesh.triangles[t].map(|v| sites[v as usize]);
            if std::mem::replace(&mut reached[t], true) || cell.holds_disc(a, b, c) {
                continue;
            }
            if self.states[t] == State::Closed {
                self.states[t] = State::Open;
                open.push(triangle);
            }
            pending.extend(mesh.twins[3 * t..3 * t + 3].iter().filter(|&&twin| twin != HULL).map(|twin| twin / 3));
        }
        open.sort_unstable();
        open
    }

    /// Fills `frontier` and `spokes`; returns the position of every site in it.
    fn find_frontier(&mut self, mesh: &HalfEdgeMesh, open: &[u32], hull: &[u32], sites: usize) -> Vec<u32> {
        const INSIDE: u32 = u32::MAX - 1;
        // A half-edge from every site of the frontier. Without a triangle every site lies on the hull.
        let mut position = vec![if mesh.triangles.is_empty() { HULL } else { INSIDE }; sites];
        for h in open.iter().flat_map(|t| 3 * t..3 * t + 3).chain(hull.iter().copied()) {
            position[mesh.origin(h) as usize] = h;
        }
        for (site, position) in position.iter_mut().enumerate().filter(|(_, h)| **h != INSIDE) {
            self.spokes.push(std::mem::replace(position, self.frontier.len() as u32));
            self.frontier.push(site as u32);
        }
        position
    }

    /// Fills `boundary`: the edges of closed ground that open triangles see from outside, and those on the hull.
    fn find_boundary(&mut self, mesh: &HalfEdgeMesh, open: &[u32], hull: &[u32], position: &[u32]) {
        let is_open = |h: u32| self.states[h as usize / 3] == State::Open;
        let seen = open.iter().flat_map(|t| 3 * t..3 * t + 3).map(|h| mesh.twins[h as usize]);
        let inner = seen.filter(|&h| h != HULL && !is_open(h));
        let outer = hull.iter().copied().filter(|&h| !is_open(h));
        let ends = |h: u32| [mesh.origin(h), mesh.destination(h)].map(|v| position[v as usize]);
        self.boundary = inner.chain(outer).map(ends).collect();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::predicates::{in_circle_determinant, orient2d};
    use crate::triangulation::canonical;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    /// Whether a lattice point outside `cell` lies in or on the circle through abc. Where a line of lattice points cuts the disc,
    /// one of those next to the middle of the chord is inside, if any is.
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
        /// On grids (small sides, many cocircular sites) as well as scattered and nearly on a line.
        #[test]
        fn what_is_not_open_reaches_no_site_outside(
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
            let closing = close(&mesh, &sites, Some(&cell), |_| false);
            for (corners, state) in mesh.triangles.iter().zip(&closing.states) {
                let [a, b, c] = corners.map(|v| sites[v as usize]);
                prop_assert!(*state == State::Open || !reaches_out(&cell, [a, b, c]), "{a:?} {b:?} {c:?} in {cell:?}");
                prop_assert!(*state == State::Closed || !cell.holds_disc(a, b, c));
            }
            for (&site, &spoke) in closing.frontier.iter().zip(&closing.spokes) {
                let around = (spoke != HULL).then(|| mesh.around(spoke)).into_iter().flatten();
                let corners = mesh.triangles.iter().flatten().filter(|&&v| v == site).count();
                prop_assert_eq!(around.count(), corners);
            }
        }
    }
}
