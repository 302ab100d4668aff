//! The part of a triangulation within given edges.

use crate::error::{Error, Result};
use crate::mesh::half_edge::HalfEdgeMesh;
use crate::mesh::index::{HalfEdgeIndex, SiteIndex};

/// Marks the triangles of `mesh` that lie to the left of the directed edges `boundary`, which are given by their sites. The edges form
/// closed loops, so these are the triangles that a flood from the right of the edges does not reach without crossing one of them.
///
/// # Errors
/// [`Error::Broken`] if a boundary edge is missing from the mesh. This should be impossible: an edge of the triangulation of all
/// sites is an edge of the triangulation of any subset with its two ends.
pub fn covered(mesh: &HalfEdgeMesh, boundary: &[[SiteIndex; 2]]) -> Result<Vec<bool>> {
    let edges = EdgesByOrigin::new(boundary);
    let mut is_boundary = vec![false; mesh.twins.len()];
    let mut found = 0;
    for (triangle, corners) in mesh.triangles.iter().enumerate() {
        // Most triangles have no corner where a boundary edge begins.
        if corners.iter().any(|&v| edges.leaves(v)) {
            for k in 0..3 {
                let is_edge = edges.contains([corners[k], corners[(k + 1) % 3]]);
                is_boundary[3 * triangle + k] = is_edge;
                found += usize::from(is_edge);
            }
        }
    }
    if found != boundary.len() {
        return Err(Error::Broken(format!(
            "{} of {} boundary edges are not in the triangulation",
            boundary.len() - found,
            boundary.len()
        )));
    }
    // What lies to the right of the boundary is little: pockets between it and the hull.
    let mut covered = vec![!boundary.is_empty(); mesh.triangles.len()];
    let right_of = |h: usize| Some(mesh.twins[h]).filter(|&twin| twin != HalfEdgeIndex::HULL);
    let beyond = |h: usize| right_of(h).filter(|twin| !is_boundary[twin.get()]).map(HalfEdgeIndex::triangle);
    let mut pending: Vec<usize> = (0..is_boundary.len()).filter(|&h| is_boundary[h]).filter_map(beyond).collect();
    while let Some(triangle) = pending.pop() {
        if std::mem::replace(&mut covered[triangle], false) {
            pending.extend((3 * triangle..3 * triangle + 3).filter_map(beyond));
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

    /// Tells whether an edge starts at this site.
    #[inline(always)]
    fn leaves(&self, origin: SiteIndex) -> bool {
        self.first.get(origin.get()..origin.get() + 2).is_some_and(|ends| ends[0] < ends[1])
    }

    fn contains(&self, [origin, destination]: [SiteIndex; 2]) -> bool {
        let origin = origin.get();
        let range =
            (origin + 1 < self.first.len()).then(|| self.first[origin] as usize..self.first[origin + 1] as usize);
        // A site in the middle of a star may have as many edges as there are sites.
        range.is_some_and(|range| self.ends[range].binary_search(&destination).is_ok())
    }
}
