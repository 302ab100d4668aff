//! Packs triangles in the form of mode `TRIANGLES` of `EXT_meshopt_compression`, version 1.
//!
//! A triangle takes a byte, if it has an edge of one of the last triangles and its third corner was used lately or is new. The format
//! counts in two queues of 16: of edges, and of vertices. It leaves some choices to the packer. They are made as meshoptimizer makes
//! them, so the bytes are the same. Where that library searches the queue of vertices, every vertex has here the time at which it
//! came into the queue.

/// The first byte: triangles, in version 1.
const HEADER: u8 = 0xe1;

/// The length of both queues.
const QUEUE: u32 = 16;

/// Third corners this far back in the queue, and further, have no code.
const FAR_THIRD: u32 = 13;

/// The two corners of a triangle without a known edge that one byte stands for, at the end of the data. The last two are of no use.
const PAIRS: [u8; 16] =
    [0x00, 0x76, 0x87, 0x56, 0x67, 0x78, 0xa9, 0x86, 0x65, 0x89, 0x68, 0x98, 0x01, 0x69, 0x00, 0x00];

/// The number of those of use.
const USED_PAIRS: usize = 14;

/// Says that a corner follows as a number.
const FREE: u8 = 15;

/// Appends the packed `triangles` between vertices 0 to `vertices` to `packed`.
pub(crate) fn encode_triangles(triangles: &[[u32; 3]], vertices: usize, packed: &mut Vec<u8>) {
    let mut encoder = IndexEncoder::new(vertices);
    packed.reserve(1 + triangles.len() + PAIRS.len());
    packed.push(HEADER);
    packed.extend(triangles.iter().map(|&triangle| encoder.code(triangle)));
    packed.extend_from_slice(&encoder.data);
    packed.extend_from_slice(&PAIRS);
}

struct IndexEncoder {
    /// What follows the codes: corners as numbers.
    data: Vec<u8>,
    /// The lowest number that no triangle had.
    next: u32,
    /// The last corner that was written as a number.
    last: u32,
    /// The last edges, each as the next triangle on its other side has it, in a ring.
    edges: [u64; QUEUE as usize],
    /// How many edges came into the queue.
    edges_in: u32,
    /// When each vertex came into the queue the last time.
    came_in: Vec<u32>,
    /// When the last vertex came into the queue. A vertex that came `QUEUE` earlier is no more in it.
    now: u32,
}

impl IndexEncoder {
    fn new(vertices: usize) -> IndexEncoder {
        IndexEncoder {
            data: Vec::new(),
            next: 0,
            last: 0,
            edges: [u64::MAX; QUEUE as usize],
            edges_in: 0,
            came_in: vec![0; vertices],
            now: QUEUE,
        }
    }

    /// Returns the code of the next triangle.
    #[inline(always)]
    fn code(&mut self, triangle: [u32; 3]) -> u8 {
        match self.known_edge(triangle) {
            Some((back, corners)) => (back as u8) << 4 | self.third(corners),
            None => 0xf0 | self.lone(triangle),
        }
    }

    /// Returns how many edges came after the last one that the triangle has, and its corners from that edge on.
    #[inline(always)]
    fn known_edge(&self, [a, b, c]: [u32; 3]) -> Option<(u32, [u32; 3])> {
        let (ab, bc, ca) = (edge(a, b), edge(b, c), edge(c, a));
        // The code of the sixteenth says that there is no edge.
        for back in 0..QUEUE - 1 {
            let known = self.edges[(self.edges_in.wrapping_sub(1 + back) % QUEUE) as usize];
            if known == ab {
                return Some((back, [a, b, c]));
            }
            if known == bc {
                return Some((back, [b, c, a]));
            }
            if known == ca {
                return Some((back, [c, a, b]));
            }
        }
        None
    }

    /// Returns the code of corner `c` of a triangle whose edge from `a` to `b` is known.
    #[inline(always)]
    fn third(&mut self, [a, b, c]: [u32; 3]) -> u8 {
        let back = self.back(c);
        let code = if (1..FAR_THIRD).contains(&back) {
            back as u8
        } else {
            let code = self.new_third(c);
            self.push_vertex(c);
            code
        };
        self.push_edge(c, b);
        self.push_edge(a, c);
        code
    }

    /// Returns the code of a third corner that is not in the queue, or too far back.
    #[inline(always)]
    fn new_third(&mut self, c: u32) -> u8 {
        if c == self.next {
            self.next += 1;
            return 0;
        }
        let last = std::mem::replace(&mut self.last, c);
        if c.wrapping_add(1) == last {
            13
        } else if c == last.wrapping_add(1) {
            14
        } else {
            self.push_number(c, last);
            FREE
        }
    }

    /// Returns the lower half of the code of a triangle without a known edge.
    #[inline(never)]
    fn lone(&mut self, triangle: [u32; 3]) -> u8 {
        let [x, y, z] = triangle;
        let corners = if y == self.next {
            [y, z, x]
        } else if z == self.next {
            [z, x, y]
        } else {
            triangle
        };
        // These codes say that numbers begin again at 0.
        let is_reset = corners == [0, 1, 2] && self.next > 0;
        if is_reset {
            self.next = 0;
            self.now += QUEUE;
        }
        let [a, b, c] = corners;
        let back = [b, c].map(|v| self.back(v));
        let first = if self.take_next(a) { 0 } else { FREE };
        let [second, third] = [(b, back[0]), (c, back[1])].map(|(v, back)| {
            // Codes 1 to 14 are places in the queue.
            if back < 14 {
                back as u8 + 1
            } else if self.take_next(v) {
                0
            } else {
                FREE
            }
        });
        let pair = second << 4 | third;
        let listed = PAIRS[..USED_PAIRS].iter().position(|&listed| listed == pair);
        let code = match listed {
            Some(listed) if first == 0 && !is_reset => listed as u8,
            _ => {
                self.data.push(pair);
                14 | first
            }
        };
        for (v, code) in corners.into_iter().zip([first, second, third]) {
            if code == FREE {
                let last = std::mem::replace(&mut self.last, v);
                self.push_number(v, last);
            }
            if code == 0 || code == FREE {
                self.push_vertex(v);
            }
        }
        self.push_edge(b, a);
        self.push_edge(c, b);
        self.push_edge(a, c);
        code
    }

    /// Tells whether `v` is the next new vertex, and counts it if so.
    fn take_next(&mut self, v: u32) -> bool {
        let is_next = v == self.next;
        self.next += u32::from(is_next);
        is_next
    }

    /// Returns how many vertices came into the queue after `v`.
    #[inline(always)]
    fn back(&self, v: u32) -> u32 {
        self.now - self.came_in[v as usize]
    }

    #[inline(always)]
    fn push_vertex(&mut self, v: u32) {
        self.now += 1;
        self.came_in[v as usize] = self.now;
    }

    #[inline(always)]
    fn push_edge(&mut self, from: u32, to: u32) {
        self.edges[(self.edges_in % QUEUE) as usize] = edge(from, to);
        self.edges_in = self.edges_in.wrapping_add(1);
    }

    /// Writes `v` by its distance to `last`, in groups of seven bits.
    fn push_number(&mut self, v: u32, last: u32) {
        let distance = v.wrapping_sub(last) as i32;
        let mut rest = (distance << 1 ^ distance >> 31) as u32;
        while rest > 0x7f {
            self.data.push(rest as u8 | 0x80);
            rest >>= 7;
        }
        self.data.push(rest as u8);
    }
}

#[inline(always)]
fn edge(from: u32, to: u32) -> u64 {
    u64::from(from) << 32 | u64::from(to)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn packed(triangles: &[[u32; 3]], vertices: usize) -> Vec<u8> {
        let mut packed = vec![7];
        encode_triangles(triangles, vertices, &mut packed);
        assert_eq!(packed[0], 7);
        packed.split_off(1)
    }

    /// The bytes are those of meshoptimizer, and it reads the same triangles from them.
    fn check(triangles: &[[u32; 3]], vertices: usize) {
        let ours = packed(triangles, vertices);
        assert_eq!(ours, meshopt::encode_index_buffer(triangles.as_flattened(), vertices).unwrap());
        let read: Vec<u32> = meshopt::decode_index_buffer(&ours, 3 * triangles.len()).unwrap();
        let turned = |t: &[u32]| [[t[0], t[1], t[2]], [t[1], t[2], t[0]], [t[2], t[0], t[1]]];
        assert!(read.chunks_exact(3).zip(triangles).all(|(theirs, ours)| turned(theirs).contains(ours)));
    }

    #[test]
    fn the_least_meshes_pack() {
        check(&[], 0);
        check(&[[0, 1, 2]], 3);
        check(&[[2, 1, 0], [0, 1, 2], [0, 1, 2]], 3);
        check(&[[70_000, 1, 2], [0, 1, 2], [1, 0, 3]], 70_001);
    }

    #[test]
    fn numbers_that_begin_again_pack() {
        let fan: Vec<[u32; 3]> = (1..40).map(|v| [0, v, v + 1]).collect();
        check(&[fan.clone(), vec![[0, 1, 2]], fan, vec![[5, 3, 4], [0, 1, 2]]].concat(), 41);
    }

    proptest! {
        #[test]
        fn bytes_are_those_of_meshoptimizer(
            triangles in prop::sample::select(vec![6u32, 20, 200, 100_000]).prop_flat_map(|vertices| {
                prop::collection::vec([0..vertices, 0..vertices, 0..vertices], 0..300)
            }),
        ) {
            let different: Vec<_> = triangles.into_iter().filter(|[a, b, c]| a != b && b != c && c != a).collect();
            check(&different, 100_000);
        }

        #[test]
        fn strips_of_any_turn_are_those_of_meshoptimizer(steps in prop::collection::vec((0u32..3, 0u32..12), 1..400)) {
            let mut triangles = vec![[0, 1, 2]];
            let mut next = 3u32;
            for (turn, back) in steps {
                let [a, b, c] = triangles[triangles.len() - 1];
                // Now and then a corner that was there, else a new one.
                let d = if back < 6 { next } else { next.saturating_sub(back) };
                if ![a, b, c].contains(&d) {
                    next = next.max(d + 1);
                    triangles.push([[c, b, d], [d, a, c], [b, d, a]][turn as usize]);
                }
            }
            check(&triangles, next as usize);
        }
    }
}
