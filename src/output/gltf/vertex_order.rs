//! An order of triangles and vertices that viewers draw quickly and the codecs of meshoptimizer pack well.
//!
//! Vertices are numbered when a triangle first uses them. For each vertex in that order, the triangles around it that are not in the
//! list yet are appended as fans, counterclockwise. This unrolls the mesh in rings: every triangle shares an edge with the one before,
//! and its third corner is a new vertex or the next one of the ring before. The index codec writes both cases without further bytes.
//! All of it is done in whole numbers, so the bytes do not depend on the machine, nor on the order in which triangles were found.

/// Up to this many triangles around a vertex are searched one by one; more are sorted.
const SEARCHED: usize = 48;

/// The number of a vertex that has none yet.
const NEW: u32 = u32::MAX;

/// Returns the triangles in their new order, with the new numbers of their corners, and the old number of every new one. Vertices
/// without a triangle come last.
pub(crate) fn order_vertices(vertices: usize, triangles: &[[u32; 3]]) -> (Vec<[u32; 3]>, Vec<u32>) {
    let around = TrianglesAround::new(vertices, triangles);
    let mut order = VertexOrder {
        numbers: vec![NEW; vertices],
        old_numbers: Vec::with_capacity(vertices),
        triangles: Vec::with_capacity(triangles.len()),
        turn: 0,
    };
    let mut is_done = vec![false; triangles.len()];
    let mut left = Vec::new();
    for seed in (0..vertices as u32).filter(|&v| !around.of(v).is_empty()) {
        order.number(seed);
        while let Some(&v) = order.old_numbers.get(order.turn as usize) {
            for &t in around.of(v) {
                if !std::mem::replace(&mut is_done[t as usize], true) {
                    left.push(opposite(triangles[t as usize], v));
                }
            }
            order.append_fans(&mut left);
            order.turn += 1;
        }
    }
    let unused = (0..vertices as u32).filter(|&v| order.numbers[v as usize] == NEW);
    order.old_numbers.extend(unused);
    (order.triangles, order.old_numbers)
}

/// Returns the edge of a triangle opposite its corner `v`.
#[inline(always)]
fn opposite([a, b, c]: [u32; 3], v: u32) -> [u32; 2] {
    if a == v {
        [b, c]
    } else if b == v {
        [c, a]
    } else {
        [a, b]
    }
}

/// The triangles around each vertex. Unlike [`crate::mesh::adjacency::VertexAdjacency`] it has only their numbers: two thirds of the
/// triangles around a vertex are in the list when its turn comes, and nobody asks for their corners.
struct TrianglesAround {
    /// The triangles at vertex v are `triangles[starts[v]..starts[v + 1]]`. There is one entry more than that needs.
    starts: Vec<u32>,
    triangles: Vec<u32>,
}

impl TrianglesAround {
    fn new(vertices: usize, triangles: &[[u32; 3]]) -> TrianglesAround {
        // One place further than needed: filling moves every start to the next one's place.
        let mut starts = vec![0u32; vertices + 2];
        for &v in triangles.as_flattened() {
            starts[v as usize + 2] += 1;
        }
        let mut sum = 0;
        for start in &mut starts {
            sum += *start;
            *start = sum;
        }
        let mut numbers = vec![0; 3 * triangles.len()];
        for (t, corners) in (0..).zip(triangles) {
            for &v in corners {
                let place = &mut starts[v as usize + 1];
                numbers[*place as usize] = t;
                *place += 1;
            }
        }
        TrianglesAround { starts, triangles: numbers }
    }

    #[inline(always)]
    fn of(&self, v: u32) -> &[u32] {
        &self.triangles[self.starts[v as usize] as usize..self.starts[v as usize + 1] as usize]
    }
}

/// The new order while it grows.
struct VertexOrder {
    /// The new number of every vertex by its old one.
    numbers: Vec<u32>,
    old_numbers: Vec<u32>,
    triangles: Vec<[u32; 3]>,
    /// The new number of the vertex whose triangles are appended.
    turn: u32,
}

impl VertexOrder {
    /// Appends the triangles between the vertex whose turn it is and the edges in `left`, one fan after the other, each from a triangle
    /// that follows on no other one; empties `left`. Fans begin in the order of the vertices, so the order of the mesh does not matter.
    fn append_fans(&mut self, left: &mut Vec<[u32; 2]>) {
        match left[..] {
            [] => return,
            // Fans of one or two need no search.
            [_] => self.append_fan(left),
            [[a, b], [c, d]] if b == c && d != a => self.append_fan(left),
            [[a, b], [c, d]] if d == a && b != c => self.append_fan(&[[c, d], [a, b]]),
            _ if left.len() > SEARCHED => self.append_many_fans(left),
            _ => match is_one_fan(left) {
                true => self.append_fan(left),
                false => self.append_some_fans(left),
            },
        }
        left.clear();
    }

    fn append_some_fans(&mut self, mut left: &mut [[u32; 2]]) {
        while !left.is_empty() {
            let is_start = |&i: &usize| left.iter().all(|other| other[1] != left[i][0]);
            let starts = (0..left.len()).filter(is_start).min_by_key(|&i| left[i]);
            let start = starts.or_else(|| (0..left.len()).min_by_key(|&i| left[i])).unwrap_or(0);
            let count = follow(left, start);
            let (fan, others) = left.split_at_mut(count);
            self.append_fan(fan);
            left = others;
        }
    }

    /// Does the same quickly around a vertex with thousands of triangles.
    fn append_many_fans(&mut self, left: &mut [[u32; 2]]) {
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
                self.append_fan(&[left[i]]);
                at = left.binary_search_by_key(&left[i][1], |edge| edge[0]).ok();
            }
        }
    }

    /// Appends the triangles between the vertex whose turn it is and edges each of which begins where the one before ends.
    #[inline(always)]
    fn append_fan(&mut self, fan: &[[u32; 2]]) {
        let Some([first, _]) = fan.first() else { return };
        let mut from = self.number(*first);
        for &[_, to] in fan {
            let to = self.number(to);
            self.triangles.push([self.turn, from, to]);
            from = to;
        }
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

/// Tells whether the edges make one fan that does not go all the way round, as they do at most vertices; if so, puts them in order.
#[inline(always)]
fn is_one_fan(left: &mut [[u32; 2]]) -> bool {
    let mut start = 0;
    // Back as long as there is an edge before.
    for _ in 1..left.len() {
        match left.iter().position(|edge| edge[1] == left[start][0]) {
            Some(before) => start = before,
            None => break,
        }
    }
    let count = left.len();
    let (Some(first), true) = (left.get(start).copied(), follow(left, start) == count) else { return count == 0 };
    left[count - 1][1] != first[0]
}

/// Puts the edge at `start` first and after each edge the one that begins where it ends. Returns the number of edges that follow one
/// another so.
#[inline(always)]
fn follow(left: &mut [[u32; 2]], start: usize) -> usize {
    let mut at = Some(start);
    for count in 0..left.len() {
        let Some(next) = at else { return count };
        left.swap(count, next);
        let to = left[count][1];
        at = left[count + 1..].iter().position(|edge| edge[0] == to).map(|next| count + 1 + next);
    }
    left.len()
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
