//! The part of a triangulation within given edges.

use crate::mesh::half_edge::HalfEdgeMesh;
use crate::mesh::index::{HalfEdgeIndex, SiteIndex};
use crate::{Error, Result};

/// Marks the triangles of `mesh` that lie to the left of the directed edges `boundary`, which are given by their sites: those that a
/// flood from the left of the edges reaches without crossing one of them.
///
/// # Errors
/// [`Error::Broken`] if a boundary edge is missing from the mesh. This should be impossible: an edge of the triangulation of all
/// sites is an edge of the triangulation of any subset with its two ends.
pub fn covered(mesh: &HalfEdgeMesh, boundary: &[[SiteIndex; 2]]) -> Result<Vec<bool>> {
    let edges = EdgesByOrigin::new(boundary);
    let is_boundary: Vec<bool> =
        mesh.half_edges().map(|h| edges.contains([mesh.origin(h), mesh.destination(h)])).collect();
    let found = is_boundary.iter().filter(|&&b| b).count();
    if found != boundary.len() {
        return Err(Error::Broken(format!(
            "{} of {} boundary edges are not in the triangulation",
            boundary.len() - found,
            boundary.len()
        )));
    }
    let mut covered = vec![false; mesh.triangles.len()];
    let mut pending = Vec::new();
    let mut reach = |triangle: usize, pending: &mut Vec<usize>| {
        if !std::mem::replace(&mut covered[triangle], true) {
            pending.push(triangle);
        }
    };
    mesh.half_edges().filter(|h| is_boundary[h.get()]).for_each(|h| reach(h.triangle(), &mut pending));
    while let Some(triangle) = pending.pop() {
        for h in HalfEdgeIndex::of_triangle(triangle) {
            let twin = mesh.twin(h);
            if !is_boundary[h.get()] && twin != HalfEdgeIndex::HULL {
                reach(twin.triangle(), &mut pending);
            }
        }
    }
    Ok(covered)
}

/// Directed edges, grouped by the site at which they start.
struct EdgesByOrigin {
    /// The position in `ends` of the first edge of each site, and the position after the last edge.
    first: Vec<u32>,
    /// The ends of the edges of each site, ascending.
    ends: Vec<SiteIndex>,
}

impl EdgesByOrigin {
    fn new(edges: &[[SiteIndex; 2]]) -> EdgesByOrigin {
        let mut edges = edges.to_vec();
        edges.sort_unstable();
        let sites = edges.last().map_or(0, |edge| edge[0].get() + 1);
        let mut first = Vec::with_capacity(sites + 1);
        for (at, edge) in (0..).zip(&edges) {
            first.resize(edge[0].get() + 1, at);
        }
        first.push(edges.len() as u32);
        EdgesByOrigin { first, ends: edges.iter().map(|edge| edge[1]).collect() }
    }

    fn contains(&self, [origin, destination]: [SiteIndex; 2]) -> bool {
        let origin = origin.get();
        let range =
            (origin + 1 < self.first.len()).then(|| self.first[origin] as usize..self.first[origin + 1] as usize);
        // A site in the middle of a star may have as many edges as there are sites.
        range.is_some_and(|range| self.ends[range].binary_search(&destination).is_ok())
    }
}
