//! The mesh while it is being made: a triangulation of the sphere, in which ghost triangles join the hull to a vertex at
//! infinity. Every half-edge has a twin, so flips, insertions and removals need no special cases.
//!
//! A triangle is a record of eight numbers: three corners (counterclockwise) and an unused number, three twins and an unused
//! number. So a corner and a twin are one load each. A record without a triangle is *free*: its corners are at infinity, so that every
//! corner is a vertex. The first records hold *slots*, which stand for the open ends of Voronoi edges while the texture is scanned (see
//! `g6_triangles`).
//!
//! Nothing is written as a corner or twin but what was one before. So no index is ever out of bounds, even where the links of a mesh that
//! was made elsewhere are wrong.

use crate::geometry::Site;
use crate::geometry::predicates::{in_circle, orient2d};
use crate::voronoi::index::{ClosedEdge, VertexIndex};
use crate::voronoi::triangle_writer::TriangleWriter;

/// A corner in room that no triangle has used, in a slot, or in a record that [`ClosedMesh::compact`] takes away.
const NO_CORNER: u32 = VertexIndex::NONE.0;

/// A closed triangulated surface over sites; see the module.
#[derive(Default)]
pub(super) struct ClosedMesh {
    /// The records up to `end`. What follows is room that is kept from leaf to leaf.
    records: Vec<u32>,
    end: usize,
    /// The number of records whose room the slots take.
    slots: usize,
    /// The triangles whose records are free.
    free: Vec<ClosedEdge>,
    infinity: VertexIndex,
}

impl ClosedMesh {
    /// Clears the mesh, and makes room for `slots` slots and for the triangles of `sites` sites. Vertex `infinity` is the ghost.
    pub(super) fn reset(&mut self, slots: usize, sites: usize, infinity: VertexIndex) {
        // Slots have twins, four numbers on, but no origins. So they need no gaps between them.
        self.slots = (slots + 4).div_ceil(8);
        self.end = 8 * self.slots;
        let room = self.end + 8 * (2 * sites + sites / 8 + 64);
        if self.records.len() < room {
            self.records.resize(room, NO_CORNER);
        }
        self.records[..self.end].fill(NO_CORNER);
        self.free.clear();
        self.infinity = infinity;
    }

    /// Clears the mesh, and returns room for the records of a mesh without slots that was made elsewhere: `length` numbers. Vertex
    /// `infinity` is the ghost.
    pub(super) fn start_with(&mut self, length: usize, infinity: VertexIndex) -> &mut [u32] {
        self.reset(0, length / 16, infinity);
        self.slots = 0;
        self.end = length;
        &mut self.records[..length]
    }

    /// Takes away the triangle of `h`.
    pub(super) fn release(&mut self, h: ClosedEdge) {
        self.set_corners(h, [self.infinity; 3]);
        self.free.push(h.triangle());
    }

    /// Takes away the triangle of `h`, whose twins may be anything. Other triangles may lead to it.
    pub(super) fn isolate(&mut self, h: ClosedEdge) {
        for side in h.triangle().sides() {
            self.set_twin(side, side);
        }
        self.release(h);
    }

    /// Returns the half-edge that stands for slot `i`. It has a twin, but no origin.
    #[inline(always)]
    pub(super) const fn slot(i: usize) -> ClosedEdge {
        ClosedEdge(i as u32)
    }

    /// Makes room for so many more triangles, and returns what writes them.
    #[inline(always)]
    pub(super) fn writer(&mut self, triangles: usize) -> TriangleWriter<'_> {
        let needed = self.end + 8 * triangles;
        if needed > self.records.len() {
            self.records.resize(2 * needed, NO_CORNER);
        }
        let front = self.front();
        TriangleWriter::new(&mut self.records, &mut self.end, front)
    }

    /// Returns the vertex at infinity.
    #[inline(always)]
    pub(super) fn infinity(&self) -> VertexIndex {
        self.infinity
    }

    /// Returns the first half-edge of every record that may hold a triangle.
    pub(super) fn triangles(&self) -> impl Iterator<Item = ClosedEdge> + use<> {
        (self.front().0..self.end().0).step_by(8).map(ClosedEdge)
    }

    /// Returns all records, eight numbers each. Half-edge `h` starts at vertex `records[h]`, and its twin is `records[h + 4]`.
    pub(super) fn records(&self) -> &[u32] {
        &self.records[..self.end]
    }

    /// Returns the number of triangles, including ghosts.
    pub(super) fn len(&self) -> usize {
        self.end / 8 - self.slots - self.free.len()
    }

    /// Returns the first half-edge of the first triangle.
    #[inline(always)]
    pub(super) fn front(&self) -> ClosedEdge {
        ClosedEdge((8 * self.slots) as u32)
    }

    /// Returns the first half-edge of the next triangle that is added at the end.
    #[inline(always)]
    pub(super) fn end(&self) -> ClosedEdge {
        ClosedEdge(self.end as u32)
    }

    #[inline(always)]
    pub(super) fn origin(&self, h: ClosedEdge) -> VertexIndex {
        VertexIndex(self.records[h.get()])
    }

    #[inline(always)]
    pub(super) fn destination(&self, h: ClosedEdge) -> VertexIndex {
        self.origin(h.next())
    }

    #[inline(always)]
    pub(super) fn apex(&self, h: ClosedEdge) -> VertexIndex {
        self.origin(h.previous())
    }

    #[inline(always)]
    pub(super) fn twin(&self, h: ClosedEdge) -> ClosedEdge {
        ClosedEdge(self.records[h.get() + 4])
    }

    #[inline(always)]
    fn set_twin(&mut self, h: ClosedEdge, to: ClosedEdge) {
        self.records[h.get() + 4] = to.0;
    }

    /// Makes two half-edges each other's twins.
    #[inline(always)]
    pub(super) fn link(&mut self, h: ClosedEdge, g: ClosedEdge) {
        self.set_twin(h, g);
        self.set_twin(g, h);
    }

    /// Returns the corners of the triangle of `h`, or `None` if its record is free.
    #[inline(always)]
    pub(super) fn corners(&self, h: ClosedEdge) -> Option<[VertexIndex; 3]> {
        let corners = h.triangle().sides().map(|side| self.origin(side));
        (!self.are_free(corners)).then_some(corners)
    }

    #[inline(always)]
    fn are_free(&self, [a, b, _]: [VertexIndex; 3]) -> bool {
        (a == self.infinity) & (b == self.infinity)
    }

    #[inline(always)]
    pub(super) fn is_free(&self, h: ClosedEdge) -> bool {
        self.are_free(h.triangle().sides().map(|side| self.origin(side)))
    }

    #[inline(always)]
    fn set_corners(&mut self, h: ClosedEdge, [a, b, c]: [VertexIndex; 3]) {
        let at = h.triangle().get();
        self.records[at..at + 3].copy_from_slice(&[a.0, b.0, c.0]);
    }

    /// Adds a triangle without twins at the end; returns its first half-edge.
    #[inline(always)]
    pub(super) fn push(&mut self, [a, b, c]: [VertexIndex; 3]) -> ClosedEdge {
        let h = self.end;
        if h + 8 > self.records.len() {
            self.records.resize(2 * h + 8, NO_CORNER);
        }
        let record = &mut self.records[h..h + 8];
        (record[0], record[1], record[2]) = (a.0, b.0, c.0);
        self.end = h + 8;
        ClosedEdge(h as u32)
    }

    /// Adds a triangle without twins, in a free record if there is one; returns its first half-edge.
    fn add(&mut self, corners: [VertexIndex; 3]) -> ClosedEdge {
        match self.free.pop() {
            Some(h) => {
                self.set_corners(h, corners);
                h
            }
            None => self.push(corners),
        }
    }

    /// Returns whether the vertex at infinity is a corner of the triangle of `h`.
    #[inline(always)]
    pub(super) fn is_ghost(&self, h: ClosedEdge) -> bool {
        self.corners(h).is_some_and(|c| c.contains(&self.infinity))
    }

    /// Replaces edge `h` by the other diagonal of its two triangles. If `g` is the twin of `h`, the diagonal is then `h.next()` and
    /// `g.next()`, and the outline of the two triangles is `h`, `h.previous()`, `g`, `g.previous()`.
    #[inline(always)]
    pub(super) fn flip(&mut self, h: ClosedEdge) {
        let g = self.twin(h);
        let (h_next, g_next) = (h.next(), g.next());
        let (h_apex, g_apex) = (self.apex(h), self.apex(g));
        let (outer_h, outer_g) = (self.twin(h_next), self.twin(g_next));
        self.records[h_next.get()] = g_apex.0;
        self.records[g_next.get()] = h_apex.0;
        self.link(h, outer_g);
        self.link(g, outer_h);
        self.link(h_next, g_next);
    }

    /// Splits the triangle of `h` at the new vertex `v`; returns the half-edges of the old triangle's sides.
    pub(super) fn split(&mut self, h: ClosedEdge, v: VertexIndex) -> [ClosedEdge; 3] {
        let h0 = h.triangle();
        let [a, b, c] = h0.sides().map(|side| self.origin(side));
        let (outer1, outer2) = (self.twin(h0.side(1)), self.twin(h0.side(2)));
        self.set_corners(h0, [a, b, v]);
        let h1 = self.add([b, c, v]);
        let h2 = self.add([c, a, v]);
        self.link(h1, outer1);
        self.link(h2, outer2);
        self.link(h0.side(1), h1.side(2));
        self.link(h1.side(1), h2.side(2));
        self.link(h2.side(1), h0.side(2));
        [h0, h1, h2]
    }

    /// Removes the triangles of `ring` and fills the hole with the triangles of `fill`. Calls `changed` with every half-edge of the
    /// new triangles.
    pub(super) fn fill_hole(&mut self, ring: &OneRing, fill: &HoleFilling, mut changed: impl FnMut(ClosedEdge)) {
        for &side in &ring.sides {
            self.release(side);
        }
        // The half-edge on the other side of each side of the remaining hole.
        let mut open = ring.outside.clone();
        for &[i, j, k] in &fill.ears {
            let h = self.add([i, j, k].map(|side| ring.vertices[side]));
            self.link(h, open[i]);
            self.link(h.side(1), open[j]);
            open[i] = h.side(2);
            h.sides().into_iter().for_each(&mut changed);
        }
        let [i, j] = fill.seam;
        self.link(open[i], open[j]);
        changed(open[i]);
    }

    /// Returns the triangles around the origin of `h`, or `None` if there are more than [`OneRing::MAX_TRIANGLES`] or they leave no
    /// hole that can be filled.
    pub(super) fn one_ring(&self, h: ClosedEdge) -> Option<OneRing> {
        let mut ring = OneRing::default();
        let mut outgoing = h;
        loop {
            let side = outgoing.next();
            ring.sides.push(side);
            ring.vertices.push(self.origin(side));
            ring.outside.push(self.twin(side));
            outgoing = self.twin(outgoing.previous());
            if outgoing == h {
                return ring.leaves_a_hole().then_some(ring);
            }
            if ring.sides.len() == OneRing::MAX_TRIANGLES {
                return None;
            }
        }
    }

    /// Returns whether edge `h` of a valid triangulation should be flipped: because it fails the canonical in-circle test, or, if it
    /// leads to infinity, because the hull has a pocket there.
    #[inline(always)]
    pub(super) fn fails(&self, sites: &[Site], h: ClosedEdge) -> bool {
        let [u, v, w, z] = self.quadrilateral(h);
        if u.0.max(v.0).max(w.0).max(z.0) == self.infinity.0 {
            return self.is_pocket(sites, [u, v, w, z]);
        }
        in_circle(u.site(sites), v.site(sites), w.site(sites), z.site(sites))
    }

    /// Returns the sites of the [`ClosedMesh::quadrilateral`] of edge `h`, if it lies between two finite triangles.
    #[inline(always)]
    pub(super) fn finite_quadrilateral(&self, sites: &[Site], h: ClosedEdge) -> Option<[Site; 4]> {
        let [u, v, w, z] = self.quadrilateral(h);
        if u.0.max(v.0).max(w.0).max(z.0) == self.infinity.0 {
            return None;
        }
        Some([u.site(sites), v.site(sites), w.site(sites), z.site(sites)])
    }

    /// Returns whether both triangles are counterclockwise after a flip of edge `h` between two finite triangles.
    #[inline(always)]
    pub(super) fn is_convex(&self, sites: &[Site], h: ClosedEdge) -> bool {
        let [u, v, w, z] = self.quadrilateral(h);
        let (u, v, w, z) = (u.site(sites), v.site(sites), w.site(sites), z.site(sites));
        orient2d(z, w, u) > 0 && orient2d(w, z, v) > 0
    }

    /// Returns the sites of the triangle of `h`.
    #[inline(always)]
    pub(super) fn triangle_sites(&self, sites: &[Site], h: ClosedEdge) -> [Site; 3] {
        let t = h.triangle();
        [self.origin(t).site(sites), self.origin(t.side(1)).site(sites), self.origin(t.side(2)).site(sites)]
    }

    /// Returns the site opposite to edge `h` in the triangle beyond it. If that is a slot, it returns any site.
    #[inline(always)]
    pub(super) fn site_beyond(&self, sites: &[Site], h: ClosedEdge) -> Site {
        let g = self.twin(h).max(self.front());
        self.apex(g).site(sites)
    }

    /// Returns the two ends of edge `h`, the apex of its triangle and the apex of its twin's triangle.
    #[inline(always)]
    pub(super) fn quadrilateral(&self, h: ClosedEdge) -> [VertexIndex; 4] {
        let g = self.twin(h);
        [self.origin(h), self.origin(g), self.apex(h), self.apex(g)]
    }

    #[cold]
    fn is_pocket(&self, sites: &[Site], [u, v, w, z]: [VertexIndex; 4]) -> bool {
        let infinity = self.infinity;
        if w == z || w == infinity || z == infinity {
            false
        } else if u == infinity {
            orient2d(v.site(sites), w.site(sites), z.site(sites)) > 0
        } else {
            orient2d(u.site(sites), z.site(sites), w.site(sites)) > 0
        }
    }

    /// Removes the ghosts around the hull and the free records, and marks the hull.
    pub(super) fn compact(&mut self) {
        let mut holes = std::mem::take(&mut self.free);
        let mut outsides = Vec::new();
        if let Some(first) = self.triangles().find(|&t| self.is_ghost(t)).and_then(|t| self.ray(t)) {
            let mut ray = first;
            for _ in self.triangles() {
                outsides.push(self.twin(ray.next()));
                holes.push(ray.triangle());
                ray = self.twin(ray.previous());
                if ray == first {
                    break;
                }
            }
        }
        // Nothing is marked before the walk has ended, because marks lead nowhere.
        for outside in outsides {
            if self.corners(outside).is_some_and(|c| !c.contains(&self.infinity)) {
                self.set_twin(outside, ClosedEdge::OUTSIDE);
            }
        }
        self.close_gaps(&mut holes);
        self.free = holes;
        self.free.clear();
    }

    /// Returns the half-edge of the ghost `t` that starts at infinity.
    pub(super) fn ray(&self, t: ClosedEdge) -> Option<ClosedEdge> {
        t.triangle().sides().into_iter().find(|&h| self.origin(h) == self.infinity)
    }

    /// Moves triangles from the end into the records `holes`, until none of them is left in between.
    fn close_gaps(&mut self, holes: &mut [ClosedEdge]) {
        for &hole in holes.iter() {
            self.records[hole.get()] = NO_CORNER;
        }
        holes.sort_unstable();
        for &hole in holes.iter() {
            while self.end > 8 * self.slots && self.records[self.end - 8] == NO_CORNER {
                self.end -= 8;
            }
            if hole.get() >= self.end {
                break;
            }
            self.end -= 8;
            self.records.copy_within(self.end..self.end + 8, hole.get());
            for side in hole.sides() {
                let twin = self.twin(side);
                if twin != ClosedEdge::OUTSIDE && twin.get() < self.end {
                    self.set_twin(twin, side);
                }
            }
        }
    }
}

/// The triangles around one vertex, counterclockwise, and the hole that they would leave.
#[derive(Default)]
pub(super) struct OneRing {
    /// The side of each triangle that is opposite to the vertex.
    sides: Vec<ClosedEdge>,
    /// The vertex at which each side starts.
    pub(super) vertices: Vec<VertexIndex>,
    /// The twin of each side.
    outside: Vec<ClosedEdge>,
}

impl OneRing {
    const MAX_TRIANGLES: usize = 48;

    /// Returns whether no triangle occurs twice, and no two triangles share a side opposite to the vertex. Where the diagram was
    /// wrong, a triangle may have its vertex twice, or may be its own neighbour.
    fn leaves_a_hole(&self) -> bool {
        let is_new = |(at, side): (usize, &ClosedEdge)| {
            self.sides[..at].iter().all(|before| before.triangle() != side.triangle())
        };
        self.sides.len() > 1
            && self.sides.iter().enumerate().all(is_new)
            && self.outside.iter().all(|outside| !self.sides.contains(outside))
    }
}

/// How to fill the hole of a [`OneRing`]: the triangles in the order in which they are cut off, by the numbers of the ring's sides.
/// Cutting off (i, j, k) joins sides i and j to one side, which keeps the number i. At the end the two sides of the seam are left.
pub(super) struct HoleFilling {
    pub(super) ears: Vec<[usize; 3]>,
    pub(super) seam: [usize; 2],
}
