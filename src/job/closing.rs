//! Which triangles of a node are done, and what its parent still needs: design of the tree merge.
//!
//! A triangle whose circumscribed disc lies strictly inside the node's cell is closed: no site outside the cell can be
//! inside or on its circle, so it belongs to the triangulation of all sites. Whoever touches a triangle that is not
//! closed, or the hull, is in the frontier and goes up, with the directed edges round the closed ground.

use super::tree::Cell;
use crate::geometry::Site;
use crate::triangulation::mesh::{HULL, Mesh};
use crate::{Error, Result};

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

/// Marks the triangles of `mesh` that cover ground closed by the children: what a flood from the left of their directed
/// boundary edges (indices of `sites`) reaches without crossing one of them.
///
/// # Errors
/// [`Error::Broken`] if a boundary edge is missing from the mesh, which cannot be: it is an edge of the triangulation of
/// all sites, hence of any triangulation of some of them.
pub fn covered(mesh: &Mesh, boundary: &[[u32; 2]]) -> Result<Vec<bool>> {
    let wanted = Starting::new(boundary);
    let half_edges = 0..mesh.twins.len() as u32;
    let is_boundary: Vec<bool> = half_edges.clone().map(|h| wanted.has(mesh.origin(h), mesh.destination(h))).collect();
    let found = is_boundary.iter().filter(|&&b| b).count();
    if found != boundary.len() {
        return Err(Error::Broken(format!(
            "{} of {} closed edges are not in the merge",
            boundary.len() - found,
            boundary.len()
        )));
    }
    let mut covered = vec![false; mesh.triangles.len()];
    let mut pending: Vec<u32> = half_edges.filter(|&h| is_boundary[h as usize]).map(|h| h / 3).collect();
    while let Some(triangle) = pending.pop() {
        if std::mem::replace(&mut covered[triangle as usize], true) {
            continue;
        }
        for h in 3 * triangle..3 * triangle + 3 {
            let twin = mesh.twins[h as usize];
            if !is_boundary[h as usize] && twin != HULL {
                pending.push(twin / 3);
            }
        }
    }
    Ok(covered)
}

/// Directed edges by the site at which they start.
struct Starting {
    /// Where the edges of each site begin in `ends`, and where the last site's end.
    first: Vec<u32>,
    ends: Vec<u32>,
}

impl Starting {
    fn new(edges: &[[u32; 2]]) -> Starting {
        let mut edges = edges.to_vec();
        edges.sort_unstable();
        let sites = edges.last().map_or(0, |edge| edge[0] + 1);
        let mut first = Vec::with_capacity(sites as usize + 1);
        for (at, edge) in (0..).zip(&edges) {
            first.resize(edge[0] as usize + 1, at);
        }
        first.push(edges.len() as u32);
        Starting { first, ends: edges.iter().map(|edge| edge[1]).collect() }
    }

    fn has(&self, origin: u32, destination: u32) -> bool {
        let origin = origin as usize;
        let range =
            (origin + 1 < self.first.len()).then(|| self.first[origin] as usize..self.first[origin + 1] as usize);
        range.is_some_and(|range| self.ends[range].contains(&destination))
    }
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
