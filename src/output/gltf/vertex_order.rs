//! An order of triangles and vertices that viewers draw quickly and the codecs of meshoptimizer pack well.
//!
//! Vertices are numbered when a triangle first uses them. For each vertex in that order, the triangles around it that are not in the
//! list yet are appended as fans, counterclockwise. This unrolls the mesh in rings: every triangle shares an edge with the one before,
//! and its third corner is a new vertex or the next one of the ring before. The index codec writes both cases without further bytes.
//! All of it is done in whole numbers, so the bytes do not depend on the machine, nor on the order in which triangles were found.

use crate::mesh::adjacency::VertexAdjacency;

/// Up to this many triangles around a vertex are searched one by one; more are sorted.
const SEARCHED: usize = 48;

/// The number of a vertex that has none yet.
const NEW: u32 = u32::MAX;

/// Returns the triangles in their new order, with the new numbers of their corners, and the old number of every new one. Vertices
/// without a triangle come last.
pub(crate) fn order_vertices(vertices: usize, triangles: &[[u32; 3]]) -> (Vec<[u32; 3]>, Vec<u32>) {
    let adjacency = VertexAdjacency::new(vertices, triangles);
    let mut order = VertexOrder {
        numbers: vec![NEW; vertices],
        old_numbers: Vec::with_capacity(vertices),
        triangles: Vec::with_capacity(triangles.len()),
    };
    let mut left = Vec::new();
    let mut next = 0;
    for seed in (0..vertices as u32).filter(|&v| !adjacency.around(v).is_empty()) {
        order.number(seed);
        while let Some(&v) = order.old_numbers.get(next) {
            // Triangles with a corner of a lower number are in the list.
            let is_left = |edge: &&[u32; 2]| edge.iter().all(|&w| order.numbers[w as usize] > next as u32);
            left.extend(adjacency.around(v).iter().filter(is_left));
            order.append_fans(v, &mut left);
            next += 1;
        }
    }
    let unused = (0..vertices as u32).filter(|&v| order.numbers[v as usize] == NEW);
    order.old_numbers.extend(unused);
    (order.triangles, order.old_numbers)
}

/// The new order while it grows.
struct VertexOrder {
    /// The new number of every vertex by its old one.
    numbers: Vec<u32>,
    old_numbers: Vec<u32>,
    triangles: Vec<[u32; 3]>,
}

impl VertexOrder {
    /// Appends the triangles between vertex `v` and the edges in `left`, one fan after the other, each from a triangle that follows on
    /// no other one; empties `left`. Fans begin in the order of the vertices, so the order of the mesh does not matter.
    fn append_fans(&mut self, v: u32, left: &mut Vec<[u32; 2]>) {
        if left.len() > SEARCHED {
            return self.append_many_fans(v, left);
        }
        while !left.is_empty() {
            let is_start = |edge: &[u32; 2]| left.iter().all(|other| other[1] != edge[0]);
            let starts = (0..left.len()).filter(|&i| is_start(&left[i]));
            let mut at = starts.min_by_key(|&i| left[i]).or_else(|| (0..left.len()).min_by_key(|&i| left[i]));
            while let Some(i) = at {
                let [from, to] = left.swap_remove(i);
                self.append([v, from, to]);
                at = left.iter().position(|edge| edge[0] == to);
            }
        }
    }

    /// Does the same quickly around a vertex with thousands of triangles.
    fn append_many_fans(&mut self, v: u32, left: &mut Vec<[u32; 2]>) {
        left.sort_unstable();
        let mut ends: Vec<u32> = left.iter().map(|edge| edge[1]).collect();
        ends.sort_unstable();
        let mut done = vec![false; left.len()];
        // The fans that have a start, then those that go all the way round.
        let starts = (0..left.len()).filter(|&i| ends.binary_search(&left[i][0]).is_err());
        for start in starts.chain(0..left.len()) {
            let mut at = Some(start);
            while let Some(i) = at.filter(|&i| !done[i]) {
                done[i] = true;
                self.append([v, left[i][0], left[i][1]]);
                at = left.binary_search_by_key(&left[i][1], |edge| edge[0]).ok();
            }
        }
        left.clear();
    }

    fn append(&mut self, triangle: [u32; 3]) {
        let triangle = triangle.map(|v| self.number(v));
        self.triangles.push(triangle);
    }

    /// Returns the new number of vertex `v`, and gives it the next one if it has none.
    fn number(&mut self, v: u32) -> u32 {
        let number = &mut self.numbers[v as usize];
        if *number == NEW {
            *number = self.old_numbers.len() as u32;
            self.old_numbers.push(v);
        }
        *number
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square lattice with `side` vertices a side, every cell cut in two.
    fn lattice(side: u32) -> Vec<[u32; 3]> {
        let cell = |i: u32| {
            let v = i / (side - 1) * side + i % (side - 1);
            [[v, v + 1, v + side], [v + 1, v + side + 1, v + side]]
        };
        (0..(side - 1) * (side - 1)).flat_map(cell).collect()
    }

    fn canonical(mut triangles: Vec<[u32; 3]>) -> Vec<[u32; 3]> {
        for t in &mut triangles {
            let least = (0..3).min_by_key(|&k| t[k]).unwrap_or(0);
            t.rotate_left(least);
        }
        triangles.sort_unstable();
        triangles
    }

    #[test]
    fn triangles_are_the_same_in_another_order() {
        let mut triangles = lattice(20);
        // Two pieces, and a vertex that is in neither.
        triangles.extend(lattice(5).iter().map(|t| t.map(|v| v + 401)));
        let (ordered, order) = order_vertices(426, &triangles);
        let mut all = order.clone();
        all.sort_unstable();
        assert!(all.into_iter().eq(0..426));
        assert_eq!(order.last(), Some(&400));
        let back = ordered.iter().map(|t| t.map(|v| order[v as usize])).collect();
        assert_eq!(canonical(back), canonical(triangles));
    }

    #[test]
    fn the_order_of_the_mesh_does_not_matter() {
        let mut triangles = lattice(20);
        // A hub, and two pieces that meet in a vertex.
        triangles.extend((400..500).map(|v| [399, v, v + 1]));
        triangles.extend([[20, 501, 502], [20, 503, 504]]);
        let expected = order_vertices(505, &triangles);
        for step in [1, 7, 111, 400] {
            let turned = |(i, t): (usize, &[u32; 3])| [t[i % 3], t[(i + 1) % 3], t[(i + 2) % 3]];
            let count = triangles.len();
            let mut shuffled: Vec<_> = triangles.iter().enumerate().map(turned).collect();
            (0..count).for_each(|i| shuffled.swap(i, (i * 31 + step) % count));
            assert!(order_vertices(505, &shuffled) == expected, "{step}");
        }
    }

    #[test]
    fn hubs_and_repeated_triangles_lose_nothing() {
        // Around vertex 0: a closed fan, an open one, one with a gap, and one that has the same triangle twice.
        for (count, gap) in [(300u32, 0), (300, 1), (30, 1), (300, 9)] {
            let mut triangles: Vec<[u32; 3]> = (1..=count).map(|v| [0, v, v % count + 1]).collect();
            triangles.truncate((count - gap) as usize);
            if gap == 9 {
                triangles.swap_remove(100);
                triangles.push(triangles[7]);
            }
            let (ordered, order) = order_vertices(count as usize + 1, &triangles);
            let back = ordered.iter().map(|t| t.map(|v| order[v as usize])).collect();
            assert_eq!(canonical(back), canonical(triangles));
        }
    }

    #[test]
    fn numbers_come_in_the_order_of_use_and_a_triangle_costs_a_byte() {
        let (ordered, order) = order_vertices(100 * 100, &lattice(100));
        let mut next = 0;
        for &v in ordered.as_flattened() {
            assert!(v <= next);
            next = next.max(v + 1);
        }
        let bytes = meshopt::encode_index_buffer(ordered.as_flattened(), order.len()).unwrap().len();
        assert!(bytes < ordered.len() * 11 / 10, "{bytes} bytes for {} triangles", ordered.len());
    }
}
