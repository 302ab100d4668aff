//! The mesh while it is being made: a triangulation of the sphere, in which the hull is closed by ghost triangles to a
//! vertex at infinity. Every half-edge has a twin, so that flips, insertions and removals need no special cases.
//!
//! A triangle is one record of eight numbers: three corners (counterclockwise) and a spare, three twins and a spare.
//! Half-edge `8 t + i` starts at corner `i` of record `t`, so that corner and twin are one load each. The first records are
//! *slots*, the open ends of Voronoi edges while the texture is scanned (see `g6_triangles`).

use crate::geometry::Site;
use crate::geometry::predicates::{in_circle, orient2d};

/// In a corner: the record is free.
pub(super) const FREE: u32 = u32::MAX;
/// In a twin, at the very end: there was a ghost triangle.
pub(super) const OUTSIDE: u32 = u32::MAX;

/// A closed triangulated surface over sites; see the module.
#[derive(Default)]
pub(super) struct ClosedMesh {
    /// Only as far as `end`; the rest is room, kept from leaf to leaf.
    records: Vec<u32>,
    end: usize,
    slots: usize,
    free: Vec<u32>,
    infinity: u32,
}

/// The half-edge after `h` in its triangle: by a table of two-bit numbers, since a branch would be wrong one time in three.
#[inline(always)]
pub(super) fn next(h: u32) -> u32 {
    (h & !3) | (0b00_10_01 >> (2 * (h & 3)) & 3)
}

/// The half-edge before `h` in its triangle.
#[inline(always)]
pub(super) fn previous(h: u32) -> u32 {
    (h & !3) | (0b01_00_10 >> (2 * (h & 3)) & 3)
}

impl ClosedMesh {
    /// Forgets everything; makes room for `slots` slots and the triangles of `sites` sites. Vertex `infinity` is the ghost.
    pub(super) fn reset(&mut self, slots: usize, sites: usize, infinity: u32) {
        self.slots = slots.div_ceil(4);
        self.end = 8 * self.slots;
        let room = self.end + 8 * (2 * sites + sites / 8 + 64);
        if self.records.len() < room {
            self.records.resize(room, FREE);
        }
        self.records[..self.end].fill(FREE);
        self.free.clear();
        self.infinity = infinity;
    }

    /// The half-edge that stands for slot `i`. Only its twin has a meaning.
    #[inline(always)]
    pub(super) const fn slot(i: usize) -> u32 {
        ((i >> 2) << 3 | (i & 3)) as u32
    }

    /// The vertex at infinity.
    #[inline(always)]
    pub(super) fn infinity(&self) -> u32 {
        self.infinity
    }

    /// The first half-edge of every record that may hold a triangle.
    pub(super) fn triangles(&self) -> impl Iterator<Item = u32> + use<> {
        (self.front()..self.end()).step_by(8)
    }

    /// All records, eight numbers each; half-edge h starts at `records[h]` and its twin is `records[h + 4]`.
    pub(super) fn records(&self) -> &[u32] {
        &self.records[..self.end]
    }

    /// The number of triangles, ghosts included.
    pub(super) fn len(&self) -> usize {
        self.end / 8 - self.slots - self.free.len()
    }

    /// The first half-edge of the next triangle that is added while none is free.
    #[inline(always)]
    pub(super) fn end(&self) -> u32 {
        self.end as u32
    }

    #[inline(always)]
    pub(super) fn origin(&self, h: u32) -> u32 {
        self.records[h as usize]
    }

    #[inline(always)]
    pub(super) fn destination(&self, h: u32) -> u32 {
        self.origin(next(h))
    }

    #[inline(always)]
    pub(super) fn apex(&self, h: u32) -> u32 {
        self.origin(previous(h))
    }

    #[inline(always)]
    pub(super) fn twin(&self, h: u32) -> u32 {
        self.records[h as usize + 4]
    }

    #[inline(always)]
    pub(super) fn set_twin(&mut self, h: u32, to: u32) {
        self.records[h as usize + 4] = to;
    }

    #[inline(always)]
    pub(super) fn link(&mut self, h: u32, g: u32) {
        self.records[h as usize + 4] = g;
        self.records[g as usize + 4] = h;
    }

    /// The corners of the triangle of `h`, or `None` for a free record.
    #[inline(always)]
    pub(super) fn corners(&self, h: u32) -> Option<[u32; 3]> {
        let at = (h & !7) as usize;
        let c = [self.records[at], self.records[at + 1], self.records[at + 2]];
        (c[0] != FREE).then_some(c)
    }

    #[inline(always)]
    pub(super) fn is_free(&self, h: u32) -> bool {
        self.records[(h & !7) as usize] == FREE
    }

    #[inline(always)]
    fn set_corners(&mut self, h: u32, corners: [u32; 3]) {
        let at = (h & !7) as usize;
        self.records[at..at + 3].copy_from_slice(&corners);
    }

    /// A new triangle without twins; its first half-edge.
    #[inline(always)]
    pub(super) fn push(&mut self, a: u32, b: u32, c: u32) -> u32 {
        let h = self.end;
        if h + 8 > self.records.len() {
            self.records.resize(2 * h + 8, FREE);
        }
        let record = &mut self.records[h..h + 8];
        (record[0], record[1], record[2]) = (a, b, c);
        self.end = h + 8;
        h as u32
    }

    fn add(&mut self, corners: [u32; 3]) -> u32 {
        match self.free.pop() {
            Some(h) => {
                self.set_corners(h, corners);
                h
            }
            None => self.push(corners[0], corners[1], corners[2]),
        }
    }

    fn release(&mut self, h: u32) {
        self.set_corners(h, [FREE; 3]);
        self.free.push(h & !7);
    }

    /// Whether the triangle of `h` has the vertex at infinity.
    #[inline(always)]
    pub(super) fn is_ghost(&self, h: u32) -> bool {
        self.corners(h).is_some_and(|c| c.contains(&self.infinity))
    }

    /// Replaces edge `h` by the other diagonal of its two triangles. With `g` the twin of `h`, the diagonal is then `next(h)`
    /// and `next(g)`, and the rim `h`, `previous(h)`, `g`, `previous(g)`.
    #[inline(always)]
    pub(super) fn flip(&mut self, h: u32) {
        let g = self.twin(h);
        let (h_next, g_next) = (next(h), next(g));
        let (h_apex, g_apex) = (self.apex(h), self.apex(g));
        let (outer_h, outer_g) = (self.twin(h_next), self.twin(g_next));
        self.records[h_next as usize] = g_apex;
        self.records[g_next as usize] = h_apex;
        self.link(h, outer_g);
        self.link(g, outer_h);
        self.link(h_next, g_next);
    }

    /// Splits the triangle of `h` at the new vertex `v`; returns the half-edges of the old triangle's sides.
    pub(super) fn split(&mut self, h: u32, v: u32) -> [u32; 3] {
        let h0 = h & !7;
        let (a, b, c) = (self.origin(h0), self.origin(h0 + 1), self.origin(h0 + 2));
        let (outer1, outer2) = (self.twin(h0 + 1), self.twin(h0 + 2));
        self.set_corners(h0, [a, b, v]);
        let h1 = self.add([b, c, v]);
        let h2 = self.add([c, a, v]);
        self.link(h1, outer1);
        self.link(h2, outer2);
        self.link(h0 + 1, h1 + 2);
        self.link(h1 + 1, h2 + 2);
        self.link(h2 + 1, h0 + 2);
        [h0, h1, h2]
    }

    /// Takes the vertex at the start of `h` out and fills the hole, `fill` listing the new triangles by the numbers of
    /// `star`'s sides. Calls `changed` with every half-edge of the new triangles.
    pub(super) fn replace_star(&mut self, star: &OneRing, fill: &HoleFilling, mut changed: impl FnMut(u32)) {
        for &side in &star.sides {
            self.release(side);
        }
        // The open half-edge of every side of the remaining hole: at first those outside.
        let mut open = star.outside.clone();
        for &[i, j, k] in &fill.ears {
            let corners = [star.vertices[i], star.vertices[j], star.vertices[k]];
            let h = self.add(corners);
            self.link(h, open[i]);
            self.link(h + 1, open[j]);
            open[i] = h + 2;
            (0..3).for_each(|e| changed(h + e));
        }
        let [i, j] = fill.seam;
        self.link(open[i], open[j]);
        changed(open[i]);
    }

    /// The triangles around the vertex at the start of `h`, or `None` if there are more than [`OneRing::MOST`], or they leave no hole
    /// that could be filled.
    pub(super) fn star(&self, h: u32) -> Option<OneRing> {
        let mut star = OneRing::default();
        let mut spoke = h;
        loop {
            let side = next(spoke);
            star.sides.push(side);
            star.vertices.push(self.origin(side));
            star.outside.push(self.twin(side));
            spoke = self.twin(previous(spoke));
            if spoke == h {
                return star.leaves_a_hole().then_some(star);
            }
            if star.sides.len() == OneRing::MOST {
                return None;
            }
        }
    }

    /// Whether edge `h` should be flipped: in a valid triangulation, by the canonical in-circle test, or, for an
    /// edge to infinity, because the hull has a pocket there.
    #[inline(always)]
    pub(super) fn fails(&self, sites: &[Site], h: u32) -> bool {
        let g = self.twin(h);
        let (u, v, w, z) = (self.origin(h), self.origin(g), self.apex(h), self.apex(g));
        let most = u.max(v).max(w).max(z);
        if most == self.infinity {
            return self.pocket(sites, u, v, w, z);
        }
        let at = |i: u32| sites[i as usize];
        in_circle(at(u), at(v), at(w), at(z))
    }

    /// Whether edge `h` between two finite triangles should be flipped.
    #[inline(always)]
    pub(super) fn fails_inside(&self, sites: &[Site], h: u32) -> bool {
        let g = self.twin(h);
        let (u, v, w, z) = (self.origin(h), self.origin(g), self.apex(h), self.apex(g));
        let at = |i: u32| sites[i as usize];
        u.max(v).max(w).max(z) != self.infinity && in_circle(at(u), at(v), at(w), at(z))
    }

    /// Whether flipping edge `h`, its triangles finite, leaves two counterclockwise triangles.
    #[inline(always)]
    pub(super) fn is_convex(&self, sites: &[Site], h: u32) -> bool {
        let g = self.twin(h);
        let at = |i: u32| sites[i as usize];
        let (u, v, w, z) = (at(self.origin(h)), at(self.origin(g)), at(self.apex(h)), at(self.apex(g)));
        orient2d(z, w, u) > 0 && orient2d(w, z, v) > 0
    }

    #[cold]
    fn pocket(&self, sites: &[Site], u: u32, v: u32, w: u32, z: u32) -> bool {
        let at = |i: u32| sites[i as usize];
        let infinity = self.infinity;
        if w == z || w == infinity || z == infinity {
            false
        } else if u == infinity {
            orient2d(at(v), at(w), at(z)) > 0
        } else {
            orient2d(at(u), at(z), at(w)) > 0
        }
    }

    /// Moves the finite triangles to the front and marks the hull.
    pub(super) fn compact(&mut self) {
        let infinity = self.infinity;
        let mut holes = std::mem::take(&mut self.free);
        for h in self.triangles() {
            let Some(corners) = self.corners(h) else { continue };
            if let Some(i) = corners.iter().position(|&c| c == infinity) {
                let outside = self.twin(next(h + i as u32));
                if self.corners(outside).is_some_and(|c| !c.contains(&infinity)) {
                    self.set_twin(outside, OUTSIDE);
                }
                holes.push(h);
            }
        }
        self.fill_holes(&mut holes);
        self.free = holes;
        self.free.clear();
    }

    /// Moves triangles from the end into `holes`, so that no hole is left.
    fn fill_holes(&mut self, holes: &mut [u32]) {
        for &hole in holes.iter() {
            self.records[hole as usize] = FREE;
        }
        holes.sort_unstable();
        for &hole in holes.iter() {
            while self.end > 8 * self.slots && self.records[self.end - 8] == FREE {
                self.end -= 8;
            }
            if hole as usize >= self.end {
                break;
            }
            self.end -= 8;
            self.records.copy_within(self.end..self.end + 8, hole as usize);
            for e in 0..3 {
                let twin = self.twin(hole + e);
                if twin != OUTSIDE && (twin as usize) < self.end {
                    self.set_twin(twin, hole + e);
                }
            }
        }
    }

    /// The first half-edge of the first triangle.
    pub(super) fn front(&self) -> u32 {
        (8 * self.slots) as u32
    }
}

/// The triangles around one vertex, counterclockwise, and the hole they would leave.
#[derive(Default)]
pub(super) struct OneRing {
    /// The side of each triangle that faces the vertex.
    sides: Vec<u32>,
    /// The vertex at which the side starts.
    pub(super) vertices: Vec<u32>,
    /// The twin of the side.
    outside: Vec<u32>,
}

impl OneRing {
    const MOST: usize = 48;

    /// No triangle is there twice, and no two of them share a side opposite to the vertex: where the diagram was wrong, a triangle
    /// may have its vertex twice, or be glued to itself.
    fn leaves_a_hole(&self) -> bool {
        let is_new = |(at, side): (usize, &u32)| self.sides[..at].iter().all(|before| before & !7 != side & !7);
        self.sides.len() > 1
            && self.sides.iter().enumerate().all(is_new)
            && self.outside.iter().all(|outside| !self.sides.contains(outside))
    }
}

/// How to fill the hole of a [`OneRing`]: triangles in the order they are cut off, by side numbers. Cutting off (i, j, k) joins
/// sides i and j to one that keeps the number i. At the end two sides are left.
pub(super) struct HoleFilling {
    pub(super) ears: Vec<[usize; 3]>,
    pub(super) seam: [usize; 2],
}
