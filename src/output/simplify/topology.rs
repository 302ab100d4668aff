//! The triangles of a terrain and which of them share an edge, while vertices go.
//!
//! A record of eight numbers a triangle: its three corners and whether it is gone, then the half-edges beyond its three edges. A
//! half-edge is the place of its first corner.

/// No half-edge: beyond the outline, or nowhere.
pub(super) const NONE: u32 = u32::MAX;

/// In a record in place of a fourth corner.
const GONE: u32 = 1;

pub(super) struct Topology {
    records: Vec<u32>,
    /// For every vertex inside a half-edge that starts there; [`NONE`] for those of the outline.
    starts: Vec<u32>,
    count: usize,
}

/// The half-edge after `h` in its triangle.
#[inline(always)]
pub(super) fn next(h: u32) -> u32 {
    if h & 3 == 2 { h - 2 } else { h + 1 }
}

/// The half-edge before `h` in its triangle.
#[inline(always)]
pub(super) fn previous(h: u32) -> u32 {
    if h & 3 == 0 { h + 2 } else { h - 1 }
}

impl Topology {
    pub(super) fn new(vertices: usize, triangles: &[[u32; 3]]) -> Topology {
        let mut records = vec![NONE; 8 * triangles.len()];
        for (record, triangle) in records.chunks_exact_mut(8).zip(triangles) {
            record[..3].copy_from_slice(triangle);
        }
        let mut topology = Topology { records, starts: vec![NONE; vertices], count: triangles.len() };
        topology.link(vertices);
        topology.find_starts();
        topology
    }

    /// Every half-edge to its reverse.
    fn link(&mut self, vertices: usize) {
        let mut ends = vec![0u32; vertices + 1];
        let edges = || (0..self.count as u32).flat_map(|t| [8 * t, 8 * t + 1, 8 * t + 2]);
        edges().for_each(|h| ends[self.origin(h) as usize] += 1);
        let mut end = 0;
        for e in &mut ends {
            end += *e;
            *e = end;
        }
        // What starts at each vertex: its other end and the half-edge.
        let mut out = vec![[0u32; 2]; 3 * self.count];
        for h in edges() {
            let e = &mut ends[self.origin(h) as usize];
            *e -= 1;
            out[*e as usize] = [self.origin(next(h)), h];
        }
        for t in 0..self.count as u32 {
            for h in [8 * t, 8 * t + 1, 8 * t + 2] {
                let (from, to) = (self.origin(h), self.origin(next(h)) as usize);
                let reverse = out[ends[to] as usize..ends[to + 1] as usize].iter().find(|edge| edge[0] == from);
                self.records[h as usize + 4] = reverse.map_or(NONE, |edge| edge[1]);
            }
        }
    }

    fn find_starts(&mut self) {
        let mut on_outline = vec![false; self.starts.len()];
        for h in (0..self.count as u32).flat_map(|t| [8 * t, 8 * t + 1, 8 * t + 2]) {
            let v = self.origin(h);
            self.starts[v as usize] = h;
            if self.twin(h) == NONE {
                on_outline[v as usize] = true;
                on_outline[self.origin(next(h)) as usize] = true;
            }
        }
        for (start, _) in self.starts.iter_mut().zip(on_outline).filter(|(_, outline)| *outline) {
            *start = NONE;
        }
    }

    /// How many triangles are left.
    pub(super) fn count(&self) -> usize {
        self.count
    }

    pub(super) fn is_inside(&self, v: u32) -> bool {
        self.starts[v as usize] != NONE
    }

    /// The vertex at which half-edge `h` starts.
    #[inline(always)]
    pub(super) fn origin(&self, h: u32) -> u32 {
        self.records[h as usize]
    }

    #[inline(always)]
    fn twin(&self, h: u32) -> u32 {
        self.records[h as usize + 4]
    }

    /// The half-edges that start at `v`, which is inside, counterclockwise.
    pub(super) fn around(&self, v: u32) -> impl Iterator<Item = u32> {
        let first = self.starts[v as usize];
        let following = move |h: u32| Some(self.twin(previous(h))).filter(|&h| h != first);
        std::iter::successors(Some(first), move |&h| following(h))
    }

    /// Moves the vertex inside at which `along` starts to where it ends. Two triangles go.
    pub(super) fn collapse(&mut self, along: u32) {
        let (v, u) = (self.origin(along), self.origin(next(along)));
        let mut h = along;
        loop {
            self.records[h as usize] = u;
            h = self.twin(previous(h));
            if h == along {
                break;
            }
        }
        let back = self.twin(along);
        let (left, right) = (self.twin(previous(along)), self.twin(next(back)));
        self.marry(left, self.twin(next(along)));
        self.marry(right, self.twin(previous(back)));
        for (vertex, start) in [(u, left), (self.origin(next(left)), next(left)), (self.origin(right), right)] {
            if self.starts[vertex as usize] != NONE {
                self.starts[vertex as usize] = start;
            }
        }
        self.starts[v as usize] = NONE;
        for gone in [along, back] {
            self.records[(gone & !7) as usize + 3] = GONE;
        }
        self.count -= 2;
    }

    fn marry(&mut self, h: u32, other: u32) {
        self.records[h as usize + 4] = other;
        if other != NONE {
            self.records[other as usize + 4] = h;
        }
    }

    /// Those that are left, in their order.
    pub(super) fn triangles(&self) -> Vec<[u32; 3]> {
        let left = self.records.chunks_exact(8).filter(|record| record[3] != GONE);
        left.map(|record| [record[0], record[1], record[2]]).collect()
    }
}
