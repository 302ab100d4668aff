//! Triangles that rounding has turned over or flattened become others by flips of edges.

use crate::groups::Groups;
use crate::mesh::{Node, double_area, in_order, least_first};
use crate::number_hash::NumberMap;

/// No tile needs as many rounds of flips.
const MOST_ROUNDS: usize = 16;

/// Returns triangles that cover what `triangles` cover, each place once as far as flips reach that, and whether they do. Those that are left turned over or flat
/// are no longer among them.
pub(crate) fn unfolded(nodes: &[Node], triangles: Vec<[u32; 3]>) -> (Vec<[u32; 3]>, bool) {
    let area = |triangle: &[u32; 3]| double_area(triangle.map(|v| nodes[v as usize]));
    let mut triangles: Vec<[u32; 3]> = triangles.into_iter().filter(|[a, b, c]| a != b && b != c && c != a).collect();
    if triangles.iter().all(|triangle| area(triangle) > 0) {
        return (triangles, true);
    }
    triangles = without_pairs(in_order(nodes.len(), triangles));
    flip_all(nodes.len(), &mut triangles, &area);
    let count = triangles.len();
    triangles.retain(|triangle| area(triangle) > 0);
    let is_unfolded = triangles.len() == count;
    (triangles, is_unfolded)
}

/// Leaves out triangles that lie on one another, back to back. All are in order.
fn without_pairs(triangles: Vec<[u32; 3]>) -> Vec<[u32; 3]> {
    let mut kept = Vec::with_capacity(triangles.len());
    for same_first in triangles.chunk_by(|a, b| a[0] == b[0]) {
        let has_back = |[a, b, c]: [u32; 3]| same_first.binary_search(&least_first([a, c, b])).is_ok();
        kept.extend(same_first.iter().filter(|&&triangle| !has_back(triangle)));
    }
    kept
}

/// Which triangle has an edge, by its ends in the direction of the triangle.
struct Owners {
    /// By the first end: the other end and the triangle, [`GONE`] for none any more.
    of_first: Groups<[u32; 2]>,
    /// Edges that are not among those.
    added: NumberMap<[u32; 2], u32>,
}

/// Stands for no triangle.
const GONE: u32 = u32::MAX;

impl Owners {
    fn new(vertices: usize, triangles: &[[u32; 3]]) -> Owners {
        let edges = (0u32..).zip(triangles).flat_map(|(t, &[a, b, c])| [(a, [b, t]), (b, [c, t]), (c, [a, t])]);
        Owners { of_first: Groups::new(vertices, edges), added: NumberMap::default() }
    }

    fn get(&self, [from, to]: [u32; 2]) -> Option<u32> {
        let group = self.of_first.of(from);
        let at = group.partition_point(|edge| edge[0] < to);
        match group.get(at) {
            Some(&[end, triangle]) if end == to && triangle != GONE => Some(triangle),
            _ => self.added.get(&[from, to]).copied(),
        }
    }

    /// Tells whether several triangles had the edge from the beginning.
    fn is_crowded(&self, [from, to]: [u32; 2]) -> bool {
        let group = self.of_first.of(from);
        let at = group.partition_point(|edge| edge[0] < to);
        group.get(at..).is_some_and(|rest| rest.iter().take_while(|edge| edge[0] == to).count() > 1)
    }

    /// Gives an edge to a triangle, or takes it from all with [`GONE`].
    fn set(&mut self, [from, to]: [u32; 2], triangle: u32) {
        let group = self.of_first.of_mut(from);
        let at = group.partition_point(|edge| edge[0] < to);
        match group.get_mut(at) {
            Some(edge) if edge[0] == to => edge[1] = triangle,
            _ if triangle == GONE => _ = self.added.remove(&[from, to]),
            _ => _ = self.added.insert([from, to], triangle),
        }
    }
}

/// Flips edges of triangles without area where both triangles that this makes have some.
fn flip_all(vertices: usize, triangles: &mut [[u32; 3]], area: &dyn Fn(&[u32; 3]) -> i64) {
    let mut owners = Owners::new(vertices, triangles);
    for _ in 0..MOST_ROUNDS {
        let flat: Vec<usize> = (0..triangles.len()).filter(|&t| area(&triangles[t]) <= 0).collect();
        let mut is_changed = false;
        for t in flat {
            let [a, b, c] = triangles[t];
            if area(&triangles[t]) > 0 {
                continue;
            }
            for [p, q, r] in [[a, b, c], [b, c, a], [c, a, b]] {
                let Some(beside) = owners.get([q, p]).map(|beside| beside as usize) else { continue };
                if owners.is_crowded([p, q]) || owners.is_crowded([q, p]) || beside == t {
                    continue;
                }
                let Some(&s) = triangles[beside].iter().find(|v| **v != p && **v != q) else { continue };
                let made = [[p, s, r], [s, q, r]];
                let is_new = owners.get([s, r]).is_none() && owners.get([r, s]).is_none();
                if is_new && made.iter().all(|triangle| area(triangle) > 0) {
                    owners.set([p, q], GONE);
                    owners.set([q, p], GONE);
                    for (number, [u, v, w]) in [(t, made[0]), (beside, made[1])] {
                        triangles[number] = [u, v, w];
                        for edge in [[u, v], [v, w], [w, u]] {
                            owners.set(edge, number as u32);
                        }
                    }
                    is_changed = true;
                    break;
                }
            }
        }
        if !is_changed {
            return;
        }
    }
}
