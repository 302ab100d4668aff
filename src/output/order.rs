//! An order of triangles and vertices that viewers draw quickly and the codecs of meshoptimizer pack well.
//!
//! Vertices are numbered as they are met. Vertex after vertex, in that order, the triangles around it that are not there
//! yet follow as fans, counterclockwise: so the mesh is unrolled in rings, where every triangle shares an edge with the one
//! before, and its third corner is a new vertex or the next one of the ring before. The index codec has a code without
//! further bytes for both. It is made of whole numbers only, so the bytes do not depend on the machine.

/// Not numbered yet.
const NEW: u32 = u32::MAX;

/// The triangles in their new order, corners by new numbers, and for every new number the old one. Vertices without a
/// triangle come last.
pub(super) fn rings(vertices: usize, triangles: &[[u32; 3]]) -> (Vec<[u32; 3]>, Vec<u32>) {
    let mut walk = Walk {
        triangles,
        corners: Corners::new(vertices, triangles),
        done: vec![false; triangles.len()],
        numbers: vec![NEW; vertices],
        order: Vec::with_capacity(vertices),
        ordered: Vec::with_capacity(triangles.len()),
    };
    let mut turn = 0;
    for seed in 0..triangles.len() {
        if !walk.done[seed] {
            walk.emit(seed, 0);
            while turn < walk.order.len() {
                walk.around(walk.order[turn]);
                turn += 1;
            }
        }
    }
    let unused = (0..vertices as u32).filter(|&v| walk.numbers[v as usize] == NEW);
    walk.order.extend(unused);
    (walk.ordered, walk.order)
}

/// The corners of triangles, three times the triangle and the place in it, by their vertex.
struct Corners {
    /// Those of vertex v are `all[start[v]..start[v + 1]]`.
    start: Vec<u32>,
    all: Vec<u32>,
}

impl Corners {
    fn new(vertices: usize, triangles: &[[u32; 3]]) -> Corners {
        // One place further than needed: filling moves every start to the next one's place.
        let mut start = vec![0u32; vertices + 2];
        for &v in triangles.as_flattened() {
            start[v as usize + 2] += 1;
        }
        for v in 2..start.len() {
            start[v] += start[v - 1];
        }
        let mut all = vec![0; 3 * triangles.len()];
        for (corner, &v) in triangles.as_flattened().iter().enumerate() {
            let place = &mut start[v as usize + 1];
            all[*place as usize] = corner as u32;
            *place += 1;
        }
        Corners { start, all }
    }

    fn of(&self, v: u32) -> &[u32] {
        &self.all[self.start[v as usize] as usize..self.start[v as usize + 1] as usize]
    }
}

struct Walk<'a> {
    triangles: &'a [[u32; 3]],
    corners: Corners,
    /// Triangles that are in `ordered`.
    done: Vec<bool>,
    /// New numbers by old.
    numbers: Vec<u32>,
    /// Old numbers by new.
    order: Vec<u32>,
    ordered: Vec<[u32; 3]>,
}

impl Walk<'_> {
    /// Emits what is left around vertex `v`, one fan after the other.
    fn around(&mut self, v: u32) {
        while let Some((mut triangle, mut corner)) = self.fan_start(v) {
            loop {
                let last = self.emit(triangle, corner);
                match self.left_at(v).find(|&(t, c)| self.triangles[t][(c + 1) % 3] == last) {
                    Some(next) => (triangle, corner) = next,
                    None => break,
                }
            }
        }
    }

    /// The triangles at `v` that are not emitted, and which corner `v` is.
    fn left_at(&self, v: u32) -> impl Iterator<Item = (usize, usize)> {
        let split = |&corner: &u32| (corner as usize / 3, corner as usize % 3);
        self.corners.of(v).iter().map(split).filter(|&(t, _)| !self.done[t])
    }

    /// One that follows on no other around `v`, if there is one.
    fn fan_start(&self, v: u32) -> Option<(usize, usize)> {
        let first = |&(t, c): &(usize, usize)| {
            let from = self.triangles[t][(c + 1) % 3];
            self.left_at(v).all(|(s, d)| self.triangles[s][(d + 2) % 3] != from)
        };
        self.left_at(v).find(first).or_else(|| self.left_at(v).next())
    }

    /// Emits triangle `t` from its corner number `corner` on; its third corner's old number.
    fn emit(&mut self, t: usize, corner: usize) -> u32 {
        self.done[t] = true;
        let corners = [0, 1, 2].map(|k| self.triangles[t][(corner + k) % 3]);
        let renumbered = corners.map(|v| self.number(v));
        self.ordered.push(renumbered);
        corners[2]
    }

    fn number(&mut self, v: u32) -> u32 {
        let number = &mut self.numbers[v as usize];
        if *number == NEW {
            *number = self.order.len() as u32;
            self.order.push(v);
        }
        *number
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square lattice of so many vertices a side, every cell cut in two.
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
    fn the_same_triangles_in_another_order() {
        let mut triangles = lattice(20);
        // Two pieces, and a vertex of neither.
        triangles.extend(lattice(5).iter().map(|t| t.map(|v| v + 401)));
        let (ordered, order) = rings(426, &triangles);
        let mut all = order.clone();
        all.sort_unstable();
        assert!(all.into_iter().eq(0..426));
        assert_eq!(order.last(), Some(&400));
        let back = ordered.iter().map(|t| t.map(|v| order[v as usize])).collect();
        assert_eq!(canonical(back), canonical(triangles));
    }

    #[test]
    fn numbers_come_in_the_order_of_use_and_a_triangle_costs_a_byte() {
        let (ordered, order) = rings(100 * 100, &lattice(100));
        let mut next = 0;
        for &v in ordered.as_flattened() {
            assert!(v <= next);
            next = next.max(v + 1);
        }
        let bytes = meshopt::encode_index_buffer(ordered.as_flattened(), order.len()).unwrap().len();
        assert!(bytes < ordered.len() * 11 / 10, "{bytes} bytes for {} triangles", ordered.len());
    }
}
