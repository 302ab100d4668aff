//! An order of triangles and vertices that viewers draw quickly and the codecs of meshoptimizer pack well.
//!
//! Vertices are numbered as they are met. Vertex after vertex, in that order, the triangles around it that are not there
//! yet follow as fans, counterclockwise: so the mesh is unrolled in rings, where every triangle shares an edge with the one
//! before, and its third corner is a new vertex or the next one of the ring before. The index codec has a code without
//! further bytes for both. It is made of whole numbers only, so the bytes do not depend on the machine.

/// Round a vertex with more triangles than this they are sorted rather than searched.
const SEARCHED: usize = 48;

/// Not numbered yet.
const NEW: u32 = u32::MAX;

/// The triangles in their new order, corners by new numbers, and for every new number the old one. Vertices without a
/// triangle come last.
pub(crate) fn rings(vertices: usize, triangles: &[[u32; 3]]) -> (Vec<[u32; 3]>, Vec<u32>) {
    let star = Star::new(vertices, triangles);
    let mut walk = Walk {
        numbers: vec![NEW; vertices],
        order: Vec::with_capacity(vertices),
        ordered: Vec::with_capacity(triangles.len()),
    };
    let mut left = Vec::new();
    let mut turn = 0;
    for seed in (0..vertices as u32).filter(|&v| !star.of(v).is_empty()) {
        walk.number(seed);
        while let Some(&v) = walk.order.get(turn) {
            // Triangles with a vertex whose turn has been are there.
            let is_left = |spoke: &&Spoke| spoke.iter().all(|&w| walk.numbers[w as usize] > turn as u32);
            left.extend(star.of(v).iter().filter(is_left));
            walk.fans(v, &mut left);
            turn += 1;
        }
    }
    let unused = (0..vertices as u32).filter(|&v| walk.numbers[v as usize] == NEW);
    walk.order.extend(unused);
    (walk.ordered, walk.order)
}

/// The other two corners of a triangle at a vertex, counterclockwise.
type Spoke = [u32; 2];

/// Triangles by their vertices.
struct Star {
    /// Those of vertex v are `spokes[start[v]..start[v + 1]]`.
    start: Vec<u32>,
    spokes: Vec<Spoke>,
}

impl Star {
    fn new(vertices: usize, triangles: &[[u32; 3]]) -> Star {
        // One place further than needed: filling moves every start to the next one's place.
        let mut start = vec![0u32; vertices + 2];
        for &v in triangles.as_flattened() {
            start[v as usize + 2] += 1;
        }
        for v in 2..start.len() {
            start[v] += start[v - 1];
        }
        let mut spokes = vec![[0; 2]; 3 * triangles.len()];
        for &[a, b, c] in triangles {
            for (v, spoke) in [(a, [b, c]), (b, [c, a]), (c, [a, b])] {
                let place = &mut start[v as usize + 1];
                spokes[*place as usize] = spoke;
                *place += 1;
            }
        }
        Star { start, spokes }
    }

    fn of(&self, v: u32) -> &[Spoke] {
        &self.spokes[self.start[v as usize] as usize..self.start[v as usize + 1] as usize]
    }
}

struct Walk {
    /// New numbers by old.
    numbers: Vec<u32>,
    /// Old numbers by new.
    order: Vec<u32>,
    ordered: Vec<[u32; 3]>,
}

impl Walk {
    /// Emits the triangles that are `left` around vertex `v`, one fan after the other, each from one that follows on no
    /// other; empties `left`.
    fn fans(&mut self, v: u32, left: &mut Vec<Spoke>) {
        if left.len() > SEARCHED {
            return self.many_fans(v, left);
        }
        while !left.is_empty() {
            let is_start = |spoke: &Spoke| left.iter().all(|other| other[1] != spoke[0]);
            let mut at = left.iter().position(is_start).or(Some(0));
            while let Some(i) = at {
                let [from, to] = left.swap_remove(i);
                let triangle = [v, from, to].map(|w| self.number(w));
                self.ordered.push(triangle);
                at = left.iter().position(|spoke| spoke[0] == to);
            }
        }
    }

    /// The same in little time round a hub of thousands.
    fn many_fans(&mut self, v: u32, left: &mut Vec<Spoke>) {
        left.sort_unstable();
        let mut ends: Vec<u32> = left.iter().map(|spoke| spoke[1]).collect();
        ends.sort_unstable();
        let mut done = vec![false; left.len()];
        // The fans that have a start, then what goes all the way round.
        let starts = (0..left.len()).filter(|&i| ends.binary_search(&left[i][0]).is_err());
        for start in starts.chain(0..left.len()) {
            let mut at = Some(start);
            while let Some(i) = at.filter(|&i| !done[i]) {
                done[i] = true;
                let triangle = [v, left[i][0], left[i][1]].map(|w| self.number(w));
                self.ordered.push(triangle);
                at = left.binary_search_by_key(&left[i][1], |spoke| spoke[0]).ok();
            }
        }
        left.clear();
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
    fn hubs_and_doubles_lose_nothing() {
        // Round vertex 0: a closed fan, an open one, one with a gap, and in the last the same triangle twice.
        for (count, gap) in [(300u32, 0), (300, 1), (30, 1), (300, 9)] {
            let mut triangles: Vec<[u32; 3]> = (1..=count).map(|v| [0, v, v % count + 1]).collect();
            triangles.truncate((count - gap) as usize);
            if gap == 9 {
                triangles.swap_remove(100);
                triangles.push(triangles[7]);
            }
            let (ordered, order) = rings(count as usize + 1, &triangles);
            let back = ordered.iter().map(|t| t.map(|v| order[v as usize])).collect();
            assert_eq!(canonical(back), canonical(triangles));
        }
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
