//! Which triangles of a tile are slivers along the hull, so that viewers do not see them: `[output] hull`.
//!
//! Leaves and merges have followed the ways of [`HullRule`]. A tile knows from its seams which of its edges have a way out of the hull; from
//! there it goes back to its own triangles. Slivers go to `cut/`: nothing of the exact mesh is lost.

use crate::mesh::hull_rule::HullRule;
use crate::records::SeamTriangle;
use delaunay::geometry::Site;
use std::collections::{HashMap, HashSet};

/// The edges over which a triangle that touches the tile flows out of the hull.
#[derive(Debug, Default)]
pub(crate) struct HullSlivers {
    /// `None` if all triangles stay.
    rule: Option<HullRule>,
    edges: HashSet<[Site; 2]>,
}

impl HullSlivers {
    /// Returns the slivers of a tile from whose edges `trimmed` ways lead out of the hull; none without a `rule`.
    pub(crate) fn new(rule: Option<&HullRule>, trimmed: &[[Site; 2]]) -> HullSlivers {
        match rule {
            Some(rule) if !trimmed.is_empty() => {
                HullSlivers { rule: Some(rule.clone()), edges: trimmed.iter().copied().collect() }
            }
            _ => HullSlivers::default(),
        }
    }

    /// Tells whether no triangle of the tile is a sliver.
    pub(crate) fn is_empty(&self) -> bool {
        self.rule.is_none()
    }

    /// Tells whether a triangle of the tile's seam is a sliver.
    pub(crate) fn has(&self, triangle: &SeamTriangle) -> bool {
        self.rule
            .as_ref()
            .and_then(|rule| flow(rule, triangle.map(|corner| corner.plane())))
            .is_some_and(|edge| self.edges.contains(&edge))
    }

    /// Removes the slivers from the `triangles` that the tile's leaf has made final, and returns them. Both stay in order.
    pub(crate) fn take(&self, positions: &[[i32; 3]], triangles: &mut Vec<[u32; 3]>) -> Vec<[u32; 3]> {
        let Some(rule) = &self.rule else { return Vec::new() };
        let corners = |t: &[u32; 3]| t.map(|v| [positions[v as usize][0], positions[v as usize][1]]);
        let flows = triangles.iter().enumerate().filter_map(|(at, t)| Some((flow(rule, corners(t))?, at)));
        let flows: HashMap<[Site; 2], usize> = flows.collect();
        let mut is_sliver = vec![false; triangles.len()];
        let mut edges: Vec<[Site; 2]> = self.edges.iter().copied().collect();
        while let Some(edge) = edges.pop() {
            let Some(&at) = flows.get(&edge) else { continue };
            if !std::mem::replace(&mut is_sliver[at], true) {
                let [a, b, c] = corners(&triangles[at]);
                // A triangle beyond flows in over the edge that it sees from its other side.
                edges.extend([[b, a], [c, b], [a, c]].into_iter().filter(|&[to, from]| [from, to] != edge));
            }
        }
        let mut at = 0..;
        triangles.extract_if(.., |_| at.next().is_some_and(|at| is_sliver[at])).collect()
    }
}

/// Returns the edge over which a triangle flows.
fn flow(rule: &HullRule, corners: [Site; 3]) -> Option<[Site; 2]> {
    rule.flow(corners).map(|from| [corners[from], corners[(from + 1) % 3]])
}
