//! The acceptance check: whatever the steps before did, a mesh that passes is the canonical Delaunay triangulation.
//!
//! Checked of the finished mesh, with exact predicates and from the output alone:
//! 1. every triangle is strictly counterclockwise;
//! 2. twins are mutual and have the same two ends;
//! 3. the half-edges without twin form one closed loop that never turns right, never turns back, and turns round once;
//! 4. every site is a corner, and `T = 2 n - h - 2` for `T` triangles, `n` sites and `h` hull edges;
//! 5. no edge inside fails the canonical in-circle test.
//!
//! Why that is enough. Glue the triangles along their twins. Around a corner they form fans, closed ones inside and open ones
//! that start and end at hull edges. As all triangles are counterclockwise, the angles of a closed fan add up to `2 pi k` with
//! `k >= 1`, and those of an open one, at a hull vertex where the loop turns left by `0 <= a < pi`, to `pi - a + 2 pi k` with
//! `k >= 0`. The loop has one open fan at each of its `h` vertices, which are distinct as it turns only once, and the turns add
//! up to `2 pi`. With `c` closed fans the sum of all angles is therefore `pi T >= 2 pi c + pi h - 2 pi`, that is
//! `T >= 2 c + h - 2`. Every site has a fan, so `c + h >= n`; with (4), `2 n - h - 2 = T >= 2 c + h - 2`, so `c + h <= n`. Hence each site
//! has exactly one fan, each closed fan goes round exactly once, and no open fan goes round more than it must. So the map of the
//! glued surface to the plane is a local homeomorphism inside, and maps its one boundary onto a convex polygon. A
//! component without boundary would be compact and open in the plane, so there is none; and a point is covered as
//! often as the boundary winds round it: once inside the polygon, never outside. That is a triangulation of the convex hull with
//! all sites as corners. By (5) it is locally Delaunay, which by Delaunay's lemma (on the lifted surface, symbolically perturbed
//! as the tie rule says) makes it the canonical Delaunay triangulation.

use crate::geometry::Site;
use crate::geometry::predicates::orient2d;
use crate::mesh::half_edge::{HULL, HalfEdgeMesh};
use crate::voronoi::closed_mesh::{ClosedMesh, OUTSIDE};
use crate::voronoi::edge_tester::EdgeTester;
use crate::voronoi::rejection::Rejection;

/// Buffers of the check.
#[derive(Default)]
pub(super) struct AcceptanceCheck {
    used: Vec<bool>,
    successor: Vec<u32>,
    hull: Vec<[u32; 2]>,
    edges: EdgeTester,
    doubtful: Vec<u32>,
}

impl AcceptanceCheck {
    /// Checks the compacted triangles of `sphere` over `sites` and writes them to `mesh`, its corners being positions in the
    /// input by `order`.
    pub(super) fn accept(
        &mut self,
        sphere: &ClosedMesh,
        sites: &[Site],
        order: &[u32],
        mesh: &mut HalfEdgeMesh,
    ) -> Result<(), Rejection> {
        let sites = &sites[..order.len()];
        let (n, front, records) = (sites.len(), sphere.front() as usize, sphere.records());
        let triangles = (records.len() - front) / 8;
        self.used.clear();
        self.used.resize(n, false);
        self.hull.clear();
        mesh.triangles.resize(triangles, [0; 3]);
        mesh.twins.resize(3 * triangles, HULL);
        let mut links = 0;
        for start in (front..records.len()).step_by(EdgeTester::BLOCK) {
            let end = records.len().min(start + EdgeTester::BLOCK);
            let first = (start - front) / 8;
            self.write_triangles(&records[start..end], sites, order, &mut mesh.triangles[first..])?;
            self.write_twins(&records[start..end], front as u32, &mut mesh.twins[3 * first..]);
            links += self.check_edges(sphere, sites, start, end)?;
        }
        if 2 * links + self.hull.len() != 3 * triangles {
            return Err(Rejection::NotAccepted("twins do not fit"));
        }
        if triangles + self.hull.len() + 2 != 2 * n || !self.used.iter().all(|&used| used) {
            return Err(Rejection::NotAccepted("not every site is used once"));
        }
        self.check_hull(sites)
    }

    /// Point 1, and notes the corners for point 4.
    fn write_triangles(
        &mut self,
        block: &[u32],
        sites: &[Site],
        order: &[u32],
        triangles: &mut [[u32; 3]],
    ) -> Result<(), Rejection> {
        let n = sites.len();
        let (order, used) = (&order[..n], &mut self.used[..n]);
        let mut inverted = false;
        for (record, triangle) in block.chunks_exact(8).zip(triangles) {
            let corners = [record[0], record[1], record[2]];
            if corners[0].max(corners[1]).max(corners[2]) >= n as u32 {
                return Err(Rejection::NotAccepted("a corner is no site"));
            }
            let [a, b, c] = [corners[0] as usize, corners[1] as usize, corners[2] as usize];
            inverted |= orient2d(sites[a], sites[b], sites[c]) <= 0;
            (used[a], used[b], used[c]) = (true, true, true);
            *triangle = [order[a], order[b], order[c]];
        }
        match inverted {
            true => Err(Rejection::NotAccepted("a triangle is not counterclockwise")),
            false => Ok(()),
        }
    }

    /// Numbers the twins as in a mesh, and notes the hull for point 3.
    fn write_twins(&mut self, block: &[u32], front: u32, twins: &mut [u32]) {
        for (record, twins) in block.chunks_exact(8).zip(twins.chunks_exact_mut(3)) {
            for i in 0..3 {
                let g = record[4 + i];
                twins[i] = (g.wrapping_sub(front) >> 3).wrapping_mul(3).wrapping_add(g & 7);
                if g == OUTSIDE {
                    twins[i] = HULL;
                    self.hull.push([record[i], record[(i + 1) % 3]]);
                }
            }
        }
    }

    /// Points 2 and 5 for the edges of a block; returns how many pairs of twins there are. As every pair is found once, from
    /// its greater half-edge, all half-edges are paired if the pairs are half as many as they.
    fn check_edges(
        &mut self,
        sphere: &ClosedMesh,
        sites: &[Site],
        start: usize,
        end: usize,
    ) -> Result<usize, Rejection> {
        self.doubtful.clear();
        let links = self.edges.test::<true>(sphere, sites, start, end, &mut self.doubtful);
        if links.broken {
            return Err(Rejection::NotAccepted("twins do not fit"));
        }
        match self.doubtful.iter().any(|&h| sphere.fails(sites, h)) {
            true => Err(Rejection::NotAccepted("an edge is not Delaunay")),
            false => Ok(links.count),
        }
    }

    /// Point 3.
    fn check_hull(&mut self, sites: &[Site]) -> Result<(), Rejection> {
        const NONE: u32 = u32::MAX;
        let fault = Rejection::NotAccepted("the hull is not convex");
        self.successor.clear();
        self.successor.resize(sites.len(), NONE);
        for &[u, v] in &self.hull {
            if std::mem::replace(&mut self.successor[u as usize], v) != NONE {
                return Err(fault);
            }
        }
        let Some(&[first, second]) = self.hull.first() else { return Err(fault) };
        let (mut u, mut v) = (first, second);
        let mut rounds = 0;
        for _ in 0..self.hull.len() {
            let w = self.successor[v as usize];
            if w == NONE {
                return Err(fault);
            }
            let [p, q, r] = [u, v, w].map(|i| sites[i as usize]);
            if !goes_on(p, q, r) {
                return Err(fault);
            }
            rounds += (!is_upward(p, q) && is_upward(q, r)) as usize;
            (u, v) = (v, w);
            if u == first && rounds == 0 {
                return Err(fault);
            }
        }
        match u == first && rounds == 1 {
            true => Ok(()),
            false => Err(fault),
        }
    }
}

/// Whether the path p, q, r turns left or goes straight on.
fn goes_on(p: Site, q: Site, r: Site) -> bool {
    let turn = orient2d(p, q, r);
    let [dx, dy] = [0, 1].map(|i| (q[i] as i64 - p[i] as i64) * (r[i] as i64 - q[i] as i64));
    turn > 0 || (turn == 0 && dx + dy > 0)
}

/// Whether the direction from p to q has an angle in [0, pi).
fn is_upward(p: Site, q: Site) -> bool {
    q[1] > p[1] || (q[1] == p[1] && q[0] > p[0])
}
