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
    /// The directed edges that have closed ground on their left and none on their right, as positions in `frontier`.
    pub boundary: Vec<[u32; 2]>,
}

/// Closes what can be closed. `cell` is `None` at the root, where everything left is a triangle of the result.
pub fn close(mesh: &Mesh, sites: &[Site], cell: Option<&Cell>, covered: impl Fn(usize) -> bool) -> Closing {
    let state = |(t, corners): (usize, &[u32; 3])| {
        let [a, b, c] = corners.map(|v| sites[v as usize]);
        match cell {
            _ if covered(t) => State::Covered,
            Some(cell) if !cell.holds_disc(a, b, c) => State::Open,
            _ => State::Closed,
        }
    };
    let states: Vec<State> = mesh.triangles.iter().enumerate().map(state).collect();
    let mut closing = Closing { states, frontier: Vec::new(), boundary: Vec::new() };
    if cell.is_some() {
        let hull: Vec<u32> = (0..).zip(&mesh.twins).filter(|(_, twin)| **twin == HULL).map(|(h, _)| h).collect();
        let position = closing.find_frontier(mesh, &hull, sites.len());
        closing.find_boundary(mesh, &hull, &position);
    }
    closing
}

impl Closing {
    fn open_triangles(&self) -> impl Iterator<Item = u32> {
        (0..).zip(&self.states).filter(|(_, state)| **state == State::Open).map(|(triangle, _)| triangle)
    }

    /// Fills `frontier`; returns the position of every site in it.
    fn find_frontier(&mut self, mesh: &Mesh, hull: &[u32], sites: usize) -> Vec<u32> {
        // Without a triangle every site lies on the hull.
        let mut position = vec![if mesh.triangles.is_empty() { 0 } else { u32::MAX }; sites];
        for triangle in self.open_triangles() {
            mesh.triangles[triangle as usize].iter().for_each(|&v| position[v as usize] = 0);
        }
        for &h in hull {
            position[mesh.origin(h) as usize] = 0;
            position[mesh.destination(h) as usize] = 0;
        }
        for (site, position) in position.iter_mut().enumerate().filter(|(_, p)| **p == 0) {
            *position = self.frontier.len() as u32;
            self.frontier.push(site as u32);
        }
        position
    }

    /// Fills `boundary`: the edges of closed ground that open triangles see from outside, and those on the hull.
    fn find_boundary(&mut self, mesh: &Mesh, hull: &[u32], position: &[u32]) {
        let is_open = |h: u32| self.states[h as usize / 3] == State::Open;
        let seen = self.open_triangles().flat_map(|t| 3 * t..3 * t + 3).map(|h| mesh.twins[h as usize]);
        let inner = seen.filter(|&h| h != HULL && !is_open(h));
        let outer = hull.iter().copied().filter(|&h| !is_open(h));
        let ends = |h: u32| [mesh.origin(h), mesh.destination(h)].map(|v| position[v as usize]);
        self.boundary = inner.chain(outer).map(ends).collect();
    }
}
