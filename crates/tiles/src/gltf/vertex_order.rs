//! An order of triangles and vertices that viewers draw quickly and the codecs of meshoptimizer pack well.
//!
//! Vertices are numbered when a triangle first uses them. For each vertex in that order, the triangles around it that are not in the
//! list yet are appended as fans, counterclockwise. This unrolls the mesh in rings: every triangle shares an edge with the one before,
//! and its third corner is a new vertex or the next one of the ring before. The index codec writes both cases without further bytes.
//! All of it is done in whole numbers, so the bytes do not depend on the machine, nor on the order in which triangles were found.
//!
//! What is left around a vertex when its turn comes is nearly always one fan. Its ends are known by then, because every triangle in the
//! list cuts what it takes off the fans of its corners. So the arcs in between follow from the first one, and nobody asks which of the
//! triangles around the vertex are in the list.

use multiversion::multiversion;

use crate::gltf::arcs_around::{ArcsAround, HELD, Number, SHORT};

/// Up to this many triangles around a vertex are searched one by one; more are sorted.
const SEARCHED: usize = 48;

/// The arcs of this many vertices are fetched together, so that the processor waits for the memory once.
const FETCHED: usize = 16;

/// Returns the triangles in their new order, with the new numbers of their corners, and the old number of every new one. Vertices
/// without a triangle come last.
pub(crate) fn order_vertices(vertices: usize, triangles: &[[u32; 3]]) -> (Vec<[u32; 3]>, Vec<u32>) {
    match vertices <= SHORT {
        true => VertexOrder::<u16>::new(vertices, triangles).finish(),
        false => VertexOrder::<u32>::new(vertices, triangles).finish(),
    }
}

/// A vertex while the order grows.
#[derive(Clone, Copy)]
struct Vertex<N> {
    /// The new number, or `NONE`.
    number: N,
    /// Where the fan begins that is left around the vertex: `NONE` if nothing has been taken from it, `LOST` if it has come apart.
    start: N,
    /// Where it ends.
    end: N,
    /// The number of arcs that are left.
    left: N,
}

impl<N: Number> Vertex<N> {
    /// Takes an arc from the fan.
    #[inline(always)]
    fn take(&mut self, from: N, to: N) {
        let (is_whole, is_first, is_last) = (self.start == N::NONE, self.start == from, self.end == to);
        // What is left of a closed fan begins where the first arc that is taken ends. If the fan was open, the gap shows in its turn.
        let start = N::either(is_whole | is_first, [to, self.start]);
        self.start = N::either(is_whole | is_first | is_last, [start, N::LOST]);
        self.end = N::either(is_whole | (is_last & !is_first), [from, self.end]);
        self.left = self.left.one_less();
    }

    /// Takes two arcs from the fan, of which the second begins where the first ends.
    #[inline(always)]
    fn take_two(&mut self, [from, over, to]: [N; 3]) {
        if self.start == N::NONE {
            *self = Vertex { start: to, end: from, left: self.left.one_less().one_less(), ..*self };
        } else {
            self.take(over, to);
            self.take(from, over);
        }
    }
}

/// The new order while it grows.
struct VertexOrder<N: Number> {
    arcs: ArcsAround<N>,
    vertices: Vec<Vertex<N>>,
    /// The old numbers of the vertices that have new ones, then room for the others and one more.
    old_numbers: Vec<u32>,
    /// The number of vertices that have new numbers.
    numbered: usize,
    triangles: Vec<[u32; 3]>,
    /// The new number of the vertex whose triangles are appended.
    turn: usize,
}

impl<N: Number> VertexOrder<N> {
    fn new(vertices: usize, triangles: &[[u32; 3]]) -> VertexOrder<N> {
        let vertex = Vertex { number: N::NONE, start: N::NONE, end: N::NONE, left: N::new(0) };
        let mut order = VertexOrder {
            arcs: ArcsAround::new(vertices),
            vertices: vec![vertex; vertices],
            old_numbers: vec![0; vertices + 1],
            numbered: 0,
            triangles: Vec::with_capacity(triangles.len()),
            turn: 0,
        };
        for &[a, b, c] in triangles {
            for (v, arc) in [(a, [b, c]), (b, [c, a]), (c, [a, b])] {
                let left = &mut order.vertices[v as usize].left;
                order.arcs.add(v, arc, left.get());
                *left = left.one_more();
            }
        }
        order.arcs.sort();
        order
    }

    /// Returns the triangles and the old numbers.
    fn finish(mut self) -> (Vec<[u32; 3]>, Vec<u32>) {
        append_all(&mut self);
        self.old_numbers.truncate(self.numbered);
        let unused = (0..).zip(&self.vertices).filter(|(_, vertex)| vertex.number == N::NONE).map(|(v, _)| v);
        self.old_numbers.extend(unused);
        (self.triangles, self.old_numbers)
    }

    /// Appends the triangles that are left around the vertex whose turn it is, if they are one fan of its first `arcs`. Tells whether
    /// they are.
    #[inline(always)]
    fn append_known_fan(&mut self, arcs: &[N::Arc; HELD]) -> bool {
        let Vertex { start, end, left, .. } = self.vertices[self.old_numbers[self.turn] as usize];
        let mut fan = [start; HELD + 1];
        let Some(ends) = fan.get_mut(1..=left.get()) else { return false };
        let mut at = start;
        for to in &mut *ends {
            at = N::after(arcs, at);
            *to = at;
        }
        // Where a closed fan has been taken whole and others are left, both ends are the same.
        let is_fan = at == end && start != N::NONE && start != end;
        if is_fan && left.get() > 0 {
            self.append_fan(start, left.get(), |i| fan[i + 1]);
        }
        is_fan || left.get() == 0
    }

    /// Does the same for any triangles: appends one fan after the other, each from a triangle that follows on no other one. Fans begin in
    /// the order of the vertices, so the order of the mesh does not matter.
    #[inline(never)]
    fn append_fans(&mut self, left: &mut Vec<[u32; 2]>) {
        left.clear();
        self.arcs.all(self.old_numbers[self.turn], left);
        // A vertex whose turn is over has no triangle that is not in the list.
        left.retain(|arc| arc.iter().all(|&v| self.vertices[v as usize].number.get() >= self.turn));
        match left[..] {
            [] => (),
            // Fans of one or two need no search.
            [_] => self.append_arcs(left),
            [[a, b], [c, d]] if b == c && d != a => self.append_arcs(left),
            [[a, b], [c, d]] if d == a && b != c => self.append_arcs(&[[c, d], [a, b]]),
            _ if left.len() > SEARCHED => self.append_many_fans(left),
            _ => match is_one_fan(left) {
                true => self.append_arcs(left),
                false => self.append_some_fans(left),
            },
        }
    }

    fn append_some_fans(&mut self, mut left: &mut [[u32; 2]]) {
        while !left.is_empty() {
            let is_start = |&i: &usize| left.iter().all(|other| other[1] != left[i][0]);
            let starts = (0..left.len()).filter(is_start).min_by_key(|&i| left[i]);
            let start = starts.or_else(|| (0..left.len()).min_by_key(|&i| left[i])).unwrap_or(0);
            let count = follow(left, start);
            let (fan, others) = left.split_at_mut(count);
            self.append_arcs(fan);
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
                self.append_arcs(&[left[i]]);
                at = left.binary_search_by_key(&left[i][1], |edge| edge[0]).ok();
            }
        }
    }

    /// Appends the triangles between the vertex whose turn it is and arcs each of which begins where the one before ends.
    fn append_arcs(&mut self, fan: &[[u32; 2]]) {
        if let Some([start, _]) = fan.first() {
            self.append_fan(N::new(*start as usize), fan.len(), |i| N::new(fan[i][1] as usize));
        }
    }

    /// Does the same for arcs from `start` on, by the ends of all of them.
    #[inline(always)]
    fn append_fan(&mut self, start: N, arcs: usize, end: impl Fn(usize) -> N) {
        let hub = N::new(self.old_numbers[self.turn] as usize);
        let mut number = self.number(start);
        self.vertices[start.get()].take(end(0), hub);
        let (mut from, mut at) = (start, end(0));
        for i in 1..arcs {
            let to = end(i);
            number = self.append_triangle(number, at);
            self.vertices[at.get()].take_two([to, hub, from]);
            (from, at) = (at, to);
        }
        self.append_triangle(number, at);
        self.vertices[at.get()].take(hub, from);
    }

    /// Appends a triangle at the vertex whose turn it is, from the corner with this new number to vertex `to`. Returns the new number of
    /// that.
    #[inline(always)]
    fn append_triangle(&mut self, from: u32, to: N) -> u32 {
        let number = self.number(to);
        self.triangles.push([self.turn as u32, from, number]);
        number
    }

    /// Returns the new number of vertex `v`, and gives it the next one if it has none. Most ends of arcs have none, but too many have.
    #[inline(always)]
    fn number(&mut self, v: N) -> u32 {
        let number = &mut self.vertices[v.get()].number;
        let is_new = *number == N::NONE;
        *number = N::either(is_new, [N::new(self.numbered), *number]);
        self.old_numbers[self.numbered] = v.get() as u32;
        self.numbered += usize::from(is_new);
        number.get() as u32
    }
}

/// Appends all triangles.
#[multiversion(targets("x86_64+avx2"))]
fn append_all<N: Number>(order: &mut VertexOrder<N>) {
    let mut left = Vec::new();
    let mut fetched = [[N::Arc::default(); HELD]; FETCHED];
    let (mut first, mut end) = (0, 0);
    for seed in 0..order.vertices.len() {
        let Vertex { number, left: triangles, .. } = order.vertices[seed];
        if number != N::NONE || triangles.get() == 0 {
            continue;
        }
        order.number(N::new(seed));
        while order.turn < order.numbered {
            if order.turn == end {
                let next = &order.old_numbers[end..order.numbered];
                fetched.iter_mut().zip(next).for_each(|(fetched, &v)| *fetched = order.arcs.held(v));
                (first, end) = (end, end + next.len().min(FETCHED));
            }
            if !order.append_known_fan(&fetched[order.turn - first]) {
                order.append_fans(&mut left);
            }
            order.turn += 1;
        }
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
    use proptest::prelude::*;

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

    /// Does what the module says, step by step.
    fn by_search(vertices: usize, triangles: &[[u32; 3]]) -> (Vec<[u32; 3]>, Vec<u32>) {
        let (mut ordered, mut order, mut left) = (Vec::new(), Vec::<u32>::new(), triangles.to_vec());
        let number = |order: &mut Vec<u32>, v: u32| {
            order.iter().position(|&old| old == v).unwrap_or_else(|| {
                order.push(v);
                order.len() - 1
            }) as u32
        };
        let mut turn = 0;
        while let Some(seed) = left.iter().flatten().min().copied() {
            number(&mut order, seed);
            while let Some(&v) = order.get(turn) {
                let turned =
                    |t: &[u32; 3]| t.iter().position(|&corner| corner == v).map(|k| [t[(k + 1) % 3], t[(k + 2) % 3]]);
                let mut arcs: Vec<[u32; 2]> = left.iter().filter_map(turned).collect();
                left.retain(|t| !t.contains(&v));
                let mut last = None;
                while !arcs.is_empty() {
                    let follows = arcs.iter().position(|arc| Some(arc[0]) == last);
                    let starts = arcs.iter().filter(|arc| arcs.iter().all(|other| other[1] != arc[0])).min();
                    let start = *starts.or(arcs.iter().min()).unwrap();
                    let [from, to] =
                        arcs.remove(follows.unwrap_or_else(|| arcs.iter().position(|arc| *arc == start).unwrap()));
                    let [from, new] = [from, to].map(|v| number(&mut order, v));
                    ordered.push([turn as u32, from, new]);
                    last = Some(to);
                }
                turn += 1;
            }
        }
        order.extend((0..vertices as u32).filter(|v| !triangles.as_flattened().contains(v)));
        (ordered, order)
    }

    proptest! {
        /// Lattices with gaps and with hubs, their vertices in any order.
        #[test]
        fn known_fans_are_those_that_a_search_finds(
            gaps in prop::collection::vec(0u32..100, 2 * 9 * 9),
            share in 0u32..40,
            hubs in prop::collection::vec(0u32..100, 0..12),
            names in Just((0..100u32).collect::<Vec<_>>()).prop_shuffle(),
        ) {
            let merged = |v: u32| if hubs.contains(&v) && v % 10 < 9 { v + 1 } else { v };
            let whole = lattice(10).into_iter().zip(gaps).filter(|(_, gap)| *gap >= share).map(|(t, _)| t.map(merged));
            let triangles: Vec<[u32; 3]> =
                whole.filter(|[a, b, c]| a != b && b != c && c != a).map(|t| t.map(|v| names[v as usize])).collect();
            let expected = by_search(100, &triangles);
            prop_assert_eq!(&order_vertices(100, &triangles), &expected);
            prop_assert_eq!(VertexOrder::<u32>::new(100, &triangles).finish(), expected);
        }
    }
}
