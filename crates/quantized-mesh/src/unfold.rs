//! Triangles that rounding has turned over or flattened become others by flips of edges.

use crate::mesh::{Node, double_area, in_order, least_first};
use crate::number_hash::{NumberMap, NumberSet};

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
    triangles = in_order(nodes.len(), &without_pairs(&triangles));
    flip_all(&mut triangles, &area);
    let count = triangles.len();
    triangles.retain(|triangle| area(triangle) > 0);
    let is_unfolded = triangles.len() == count;
    (triangles, is_unfolded)
}

/// Leaves out triangles that lie on one another, back to back.
fn without_pairs(triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let all: NumberSet<[u32; 3]> = triangles.iter().map(|&triangle| least_first(triangle)).collect();
    let has_back = |[a, b, c]: [u32; 3]| all.contains(&least_first([a, c, b]));
    triangles.iter().copied().filter(|&triangle| !has_back(triangle)).collect()
}

/// Flips edges of triangles without area where both triangles that this makes have some.
fn flip_all(triangles: &mut [[u32; 3]], area: &dyn Fn(&[u32; 3]) -> i64) {
    let mut owners: NumberMap<[u32; 2], usize> = NumberMap::default();
    let mut crowded: NumberSet<[u32; 2]> = NumberSet::default();
    for (t, &[a, b, c]) in triangles.iter().enumerate() {
        for edge in [[a, b], [b, c], [c, a]] {
            if owners.insert(edge, t).is_some() {
                crowded.insert(edge);
            }
        }
    }
    for _ in 0..MOST_ROUNDS {
        let flat: Vec<usize> = (0..triangles.len()).filter(|&t| area(&triangles[t]) <= 0).collect();
        let mut is_changed = false;
        for t in flat {
            let [a, b, c] = triangles[t];
            if area(&triangles[t]) > 0 {
                continue;
            }
            for [p, q, r] in [[a, b, c], [b, c, a], [c, a, b]] {
                let Some(&beside) = owners.get(&[q, p]) else { continue };
                if crowded.contains(&[p, q]) || crowded.contains(&[q, p]) || beside == t {
                    continue;
                }
                let Some(&s) = triangles[beside].iter().find(|v| **v != p && **v != q) else { continue };
                let made = [[p, s, r], [s, q, r]];
                let is_new = !owners.contains_key(&[s, r]) && !owners.contains_key(&[r, s]);
                if is_new && made.iter().all(|triangle| area(triangle) > 0) {
                    owners.remove(&[p, q]);
                    owners.remove(&[q, p]);
                    for (number, [u, v, w]) in [(t, made[0]), (beside, made[1])] {
                        triangles[number] = [u, v, w];
                        owners.extend([[u, v], [v, w], [w, u]].map(|edge| (edge, number)));
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
