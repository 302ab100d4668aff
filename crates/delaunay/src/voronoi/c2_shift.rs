//! Step C2: shift all sites from their pixels to their true places at once. The topology stays. Triangles that are no longer
//! counterclockwise are flipped away, or one of their corners is removed and inserted again in step C3.

use crate::geometry::Site;
use crate::geometry::predicates::orient2d;
use crate::voronoi::closed_mesh::{ClosedMesh, HoleFilling, OneRing};
use crate::voronoi::edge_tester::{Block, EdgeTester, sides as tested_sides};
use crate::voronoi::index::{ClosedEdge, VertexIndex};
use crate::voronoi::rejection::Rejection;

/// If a triangle is still inverted after this many rounds of repair, the leaf is rejected.
const ROUNDS: usize = 6;
/// The work that is allowed per site, in units of about a nanosecond.
const WORK_PER_SITE: usize = 1 << 12;
/// The work on a triangle, or on a hole with few sides.
const WORK: usize = 1 << 9;

/// What the shift leaves to repair.
#[derive(Default)]
pub(super) struct ShiftRepair {
    /// Triangles that are not counterclockwise.
    pub(super) inverted: Vec<ClosedEdge>,
    /// Edges that may not be Delaunay. All others are.
    pub(super) suspects: Vec<ClosedEdge>,
    /// Vertices that were removed, each with a half-edge nearby.
    pub(super) removed: Vec<(VertexIndex, ClosedEdge)>,
    tester: EdgeTester,
    work_left: usize,
}

impl ShiftRepair {
    /// Clears what another leaf has left; this one has `sites` sites.
    pub(super) fn reset(&mut self, sites: usize) {
        self.work_left = WORK_PER_SITE * (sites + 64);
        self.inverted.clear();
        self.suspects.clear();
        self.removed.clear();
    }

    /// Tests the triangles from record `start` on, and their edges to triangles before them, at the true places of `sites`. Unless
    /// `all`, it tests whole blocks only. Returns the first record that was not tested.
    #[inline(always)]
    pub(super) fn test(
        &mut self,
        mesh: &ClosedMesh,
        sites: &[Site],
        start: usize,
        all: bool,
        suspects: &mut Vec<ClosedEdge>,
    ) -> usize {
        let (mut first, records) = (start / 8, mesh.records().as_chunks::<8>().0);
        let mut padded = [[0; 8]; EdgeTester::TRIANGLES];
        while first + EdgeTester::TRIANGLES <= records.len() || (all && first < records.len()) {
            let block = Block::new(records, first, &mut padded);
            for (t, [a, b, c, ..]) in block.records.iter().enumerate() {
                self.tester.set_corners(t, [sites[*a as usize], sites[*b as usize], sites[*c as usize]]);
            }
            let uncertain = self.tester.test::<false>(records, mesh.front().get() / 8, first, &block, sites).uncertain;
            // The scan leaves no record free.
            self.inverted
                .extend(tested_sides(uncertain.orientation, first, 0).filter(|&t| is_inverted(mesh, sites, t)));
            for (i, side) in uncertain.sides.into_iter().enumerate() {
                suspects.extend(tested_sides(side, first, i));
            }
            first += block.count;
        }
        8 * first
    }

    /// Makes every triangle counterclockwise.
    pub(super) fn repair(&mut self, mesh: &mut ClosedMesh, sites: &[Site]) -> Result<(), Rejection> {
        for round in 0..ROUNDS {
            for t in std::mem::take(&mut self.inverted) {
                if !self.spend(WORK) {
                    return Err(Rejection::NotAccepted("too many triangles are inverted"));
                }
                if is_inverted(mesh, sites, t) && !self.repair_triangle(mesh, sites, t, round > 0) {
                    self.inverted.push(t);
                }
            }
            if self.inverted.is_empty() {
                return Ok(());
            }
        }
        Err(Rejection::NotAccepted("an inverted triangle stayed"))
    }

    /// Counts work, which is bounded; returns whether it may be done.
    fn spend(&mut self, work: usize) -> bool {
        let left = self.work_left.checked_sub(work);
        self.work_left = left.unwrap_or(0);
        left.is_some()
    }

    fn repair_triangle(
        &mut self,
        mesh: &mut ClosedMesh,
        sites: &[Site],
        t: ClosedEdge,
        even_if_inverted: bool,
    ) -> bool {
        let sides = t.sides();
        sides.iter().any(|&h| self.flip_if_good(mesh, sites, h))
            || sides.iter().any(|&h| self.peel_if_between(mesh, sites, h))
            || sides.iter().any(|&h| self.remove(mesh, sites, h, false))
            || sides.iter().any(|&h| self.peel(mesh, h))
            || even_if_inverted && sides.iter().any(|&h| self.remove(mesh, sites, h, true))
    }

    /// Flips edge `h` if both triangles are counterclockwise afterwards.
    fn flip_if_good(&mut self, mesh: &mut ClosedMesh, sites: &[Site], h: ClosedEdge) -> bool {
        let good = !mesh.quadrilateral(h).contains(&mesh.infinity()) && mesh.is_convex(sites, h);
        if good {
            self.flip(mesh, h);
        }
        good
    }

    fn flip(&mut self, mesh: &mut ClosedMesh, h: ClosedEdge) {
        let g = mesh.twin(h);
        mesh.flip(h);
        self.suspects.extend([h, h.next(), h.previous(), g, g.previous()]);
    }

    /// Takes the triangle of hull edge `h` off the mesh if its apex projects between the ends of the edge. The hull then passes
    /// through the apex.
    fn peel_if_between(&mut self, mesh: &mut ClosedMesh, sites: &[Site], h: ClosedEdge) -> bool {
        let [u, v, w] = [mesh.origin(h), mesh.destination(h), mesh.apex(h)].map(|vertex| vertex.site(sites));
        let towards = |p: Site, q: Site, r: Site| {
            (q[0] as i64 - p[0] as i64) * (r[0] as i64 - p[0] as i64)
                + (q[1] as i64 - p[1] as i64) * (r[1] as i64 - p[1] as i64)
                > 0
        };
        towards(u, v, w) && towards(v, u, w) && self.peel(mesh, h)
    }

    fn peel(&mut self, mesh: &mut ClosedMesh, h: ClosedEdge) -> bool {
        let outside = mesh.apex(mesh.twin(h)) == mesh.infinity();
        if outside {
            self.flip(mesh, h);
        }
        outside
    }

    /// Removes the vertex at which `h` starts if counterclockwise triangles can fill the hole, or in any case if `even_if_inverted`.
    /// Triangles that are inverted then are listed for the next round.
    pub(super) fn remove(
        &mut self,
        mesh: &mut ClosedMesh,
        sites: &[Site],
        h: ClosedEdge,
        even_if_inverted: bool,
    ) -> bool {
        let (vertex, first) = (mesh.origin(h), self.suspects.len());
        let done = self.remove_fan(mesh, sites, h, even_if_inverted);
        if done {
            self.removed.push((vertex, self.suspects[first]));
        }
        done
    }

    /// Removes the triangles around the origin of `h`. The vertex is still a corner of triangles elsewhere.
    pub(super) fn remove_island(&mut self, mesh: &mut ClosedMesh, sites: &[Site], h: ClosedEdge) -> bool {
        self.remove_fan(mesh, sites, h, true)
    }

    fn remove_fan(&mut self, mesh: &mut ClosedMesh, sites: &[Site], h: ClosedEdge, even_if_inverted: bool) -> bool {
        let Some(ring) = mesh.one_ring(h) else { return false };
        if !self.spend(WORK + 8 * ring.vertices.len().pow(2)) {
            return false;
        }
        let Some(fill) = ring.fill(sites, mesh.infinity(), even_if_inverted) else { return false };
        let first = self.suspects.len();
        mesh.fill_hole(&ring, &fill, |h| self.suspects.push(h));
        if even_if_inverted {
            let new = self.suspects[first..].iter().map(|h| h.triangle());
            self.inverted.extend(new.filter(|&t| is_inverted(mesh, sites, t)));
        }
        true
    }
}

/// Returns whether the triangle of `h` is finite and not counterclockwise. Ghosts and free records are not inverted.
#[inline(always)]
pub(super) fn is_inverted(mesh: &ClosedMesh, sites: &[Site], h: ClosedEdge) -> bool {
    let Some(corners) = mesh.corners(h).filter(|corners| !corners.contains(&mesh.infinity())) else { return false };
    let [a, b, c] = corners.map(|v| v.site(sites));
    orient2d(a, b, c) <= 0
}

impl OneRing {
    /// Cuts the hole into counterclockwise triangles. If one of its corners is at infinity, it cuts off as many of them as it can,
    /// and fills the rest with ghosts. Returns `None` if that is impossible, unless the hole must be filled `even_if_inverted`.
    fn fill(&self, sites: &[Site], infinity: VertexIndex, even_if_inverted: bool) -> Option<HoleFilling> {
        let mut sides: Vec<usize> = (0..self.vertices.len()).collect();
        let mut ears = Vec::with_capacity(sides.len());
        let at_infinity = self.vertices.iter().filter(|&&v| v == infinity).count();
        if at_infinity > 1 {
            return None;
        }
        while sides.len() > 2 {
            let n = sides.len();
            let triple = |i: usize| [sides[i], sides[(i + 1) % n], sides[(i + 2) % n]];
            let ear = (0..n).find(|&i| self.is_ear(sites, infinity, &sides, triple(i)));
            let last_resort = || match at_infinity {
                0 => even_if_inverted.then_some(0),
                _ => (0..n).find(|&i| self.vertices[triple(i)[2]] == infinity),
            };
            let i = ear.or_else(last_resort)?;
            ears.push(triple(i));
            sides.remove((i + 1) % n);
        }
        Some(HoleFilling { ears, seam: [sides[0], sides[1]] })
    }

    fn is_ear(&self, sites: &[Site], infinity: VertexIndex, sides: &[usize], triple: [usize; 3]) -> bool {
        let corners = triple.map(|i| self.vertices[i]);
        if corners.contains(&infinity) {
            return false;
        }
        let [a, b, c] = corners.map(|v| v.site(sites));
        let covers = |v: VertexIndex| {
            let p = v.site(sites);
            orient2d(a, b, p) >= 0 && orient2d(b, c, p) >= 0 && orient2d(c, a, p) >= 0
        };
        let others = sides.iter().map(|&i| self.vertices[i]).filter(|v| !corners.contains(v) && *v != infinity);
        orient2d(a, b, c) > 0 && !others.into_iter().any(covers)
    }
}
