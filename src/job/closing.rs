//! Which triangles of a node are done, and what its parent still needs: design of the tree merge.
//!
//! A triangle whose circumscribed disc lies strictly inside the node's cell is closed: no site outside the cell can be
//! inside or on its circle, so it belongs to the triangulation of all sites. Whoever touches a triangle that is not
//! closed, or the hull, is in the frontier and goes up, with the directed edges round the closed ground.

use super::tree::Cell;
use crate::geometry::Site;
use crate::triangulation::mesh::{HULL, Mesh};

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
pub fn close(mesh: &Mesh, sites: &[Site], cell: Option<&Cell>, covered: impl Fn(usize) -> bool) -> Closing {
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
    fn open(&mut self, mesh: &Mesh, sites: &[Site], cell: &Cell, hull: &[u32]) -> Vec<u32> {
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
    fn find_frontier(&mut self, mesh: &Mesh, open: &[u32], hull: &[u32], sites: usize) -> Vec<u32> {
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
    fn find_boundary(&mut self, mesh: &Mesh, open: &[u32], hull: &[u32], position: &[u32]) {
        let is_open = |h: u32| self.states[h as usize / 3] == State::Open;
        let seen = open.iter().flat_map(|t| 3 * t..3 * t + 3).map(|h| mesh.twins[h as usize]);
        let inner = seen.filter(|&h| h != HULL && !is_open(h));
        let outer = hull.iter().copied().filter(|&h| !is_open(h));
        let ends = |h: u32| [mesh.origin(h), mesh.destination(h)].map(|v| position[v as usize]);
        self.boundary = inner.chain(outer).map(ends).collect();
    }
}
