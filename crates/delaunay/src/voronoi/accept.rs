//! The acceptance check. Whatever the steps before it did, a mesh that passes is the canonical Delaunay triangulation.
//!
//! It checks the finished mesh with exact predicates, and from nothing but the output:
//! 1. every triangle is strictly counterclockwise;
//! 2. twins are mutual and have the same two ends;
//! 3. the half-edges without a twin form one closed loop that never turns right, never turns back, and turns around once;
//! 4. every site is a corner, and `T = 2 n - h - 2` for `T` triangles, `n` sites and `h` hull edges;
//! 5. no inner edge fails the canonical in-circle test.
//!
//! Why this is enough: glue the triangles along their twins. Around a corner they form fans: closed fans inside, and open fans that
//! start and end at hull edges. Because all triangles are counterclockwise, the angles of a closed fan add up to `2 pi k` with
//! `k >= 1`. The angles of an open fan, at a hull vertex where the loop turns left by `0 <= a < pi`, add up to `pi - a + 2 pi k` with
//! `k >= 0`. The loop has one open fan at each of its `h` vertices, which are distinct because the loop turns around only once, and
//! its turns add up to `2 pi`. If there are `c` closed fans, the sum of all angles is therefore `pi T >= 2 pi c + pi h - 2 pi`, that
//! is, `T >= 2 c + h - 2`. Every site has a fan, so `c + h >= n`. With (4), `2 n - h - 2 = T >= 2 c + h - 2`, so `c + h <= n`. Hence
//! each site has exactly one fan, each closed fan goes around exactly once, and no open fan goes around more than it must.
//!
//! So the map of the glued surface to the plane is a local homeomorphism inside, and it maps the one boundary of the surface onto a
//! convex polygon. A component without a boundary would be compact and open in the plane, so there is none. A point is covered as
//! often as the boundary winds around it: once inside the polygon, never outside. That is a triangulation of the convex hull with
//! all sites as corners. By (5) it is locally Delaunay. By Delaunay's lemma (on the lifted surface, symbolically perturbed as the
//! tie rule says) it is then the canonical Delaunay triangulation.

use crate::geometry::Site;
use crate::geometry::predicates::{Uncertain, orient2d};
use crate::mesh::half_edge::HalfEdgeMesh;
use crate::mesh::index::{HalfEdgeIndex, SiteIndex};
use crate::voronoi::closed_mesh::ClosedMesh;
use crate::voronoi::edge_tester::{Block, EdgeTester, sides};
use crate::voronoi::index::{ClosedEdge, VertexIndex};
use crate::voronoi::rejection::Rejection;
use multiversion::multiversion;

/// Buffers of the check.
#[derive(Default)]
pub(super) struct AcceptanceCheck {
    used: Vec<bool>,
    successor: Vec<VertexIndex>,
    hull: Vec<[VertexIndex; 2]>,
    tester: EdgeTester,
}

impl AcceptanceCheck {
    /// Checks the compacted triangles of `closed` over `sites` and writes them to `mesh`. The corners of `mesh` are positions in the
    /// input, which `order` lists by vertex unless they are the vertices' numbers.
    pub(super) fn accept(
        &mut self,
        closed: &ClosedMesh,
        sites: &[Site],
        order: Option<&[SiteIndex]>,
        mesh: &mut HalfEdgeMesh,
    ) -> Result<(), Rejection> {
        let n = sites.len();
        let triangles = (closed.records().len() - closed.front().get()) / 8;
        self.used.clear();
        self.used.resize(n, false);
        self.hull.clear();
        mesh.triangles.resize(triangles, [SiteIndex::default(); 3]);
        mesh.twins.resize(3 * triangles + 1, HalfEdgeIndex::HULL);
        let links = check_blocks(self, closed, sites, order, mesh)?;
        mesh.twins.truncate(3 * triangles);
        if 2 * links + self.hull.len() != 3 * triangles {
            return Err(Rejection::NotAccepted("twins do not fit"));
        }
        if triangles + self.hull.len() + 2 != 2 * n || !self.used.iter().all(|&used| used) {
            return Err(Rejection::NotAccepted("not every site is used once"));
        }
        self.check_hull(sites)
    }

    /// Fetches the corners of a block of triangles and writes them. Notes them for point 4.
    #[inline(always)]
    fn write_triangles(
        &mut self,
        block: &Block,
        sites: &[Site],
        order: Option<&[SiteIndex]>,
        triangles: &mut [[SiteIndex; 3]],
    ) -> Result<(), Rejection> {
        let n = sites.len();
        let (used, order) = (&mut self.used[..n], order.map(|order| &order[..n]));
        for (t, (record, triangle)) in block.records.iter().zip(triangles).enumerate() {
            let [a, b, c] = [record[0] as usize, record[1] as usize, record[2] as usize];
            if a >= n || b >= n || c >= n {
                return Err(Rejection::NotAccepted("a corner is no site"));
            }
            self.tester.set_corners(t, [sites[a], sites[b], sites[c]]);
            (used[a], used[b], used[c]) = (true, true, true);
            *triangle = match order {
                Some(order) => [order[a], order[b], order[c]],
                None => [SiteIndex::new(a), SiteIndex::new(b), SiteIndex::new(c)],
            };
        }
        Ok(())
    }

    /// Numbers the twins as in a half-edge mesh, and notes the hull for point 3. One more number than there are twins is written.
    #[inline(always)]
    fn write_twins(&mut self, block: &[[u32; 8]], front: u32, twins: &mut [HalfEdgeIndex]) {
        for (t, record) in block.iter().enumerate() {
            // Four numbers, of which the next triangle overwrites the last, are computed at once.
            let twins = &mut twins[3 * t..3 * t + 4];
            let mut numbers = [HalfEdgeIndex::HULL; 4];
            for (number, &g) in numbers.iter_mut().zip(&record[4..]) {
                // Three times the number of the triangle, and the corner.
                let eight = g.wrapping_sub(front) & !7;
                *number = HalfEdgeIndex((eight >> 2).wrapping_add(eight >> 3).wrapping_add(g & 7));
            }
            twins.copy_from_slice(&numbers);
            if record[4].max(record[5]).max(record[6]) == ClosedEdge::OUTSIDE.0 {
                self.write_hull(record, twins);
            }
        }
    }

    #[cold]
    fn write_hull(&mut self, record: &[u32; 8], twins: &mut [HalfEdgeIndex]) {
        for i in (0..3).filter(|&i| record[4 + i] == ClosedEdge::OUTSIDE.0) {
            twins[i] = HalfEdgeIndex::HULL;
            self.hull.push([record[i], record[(i + 1) % 3]].map(VertexIndex));
        }
    }

    /// Decides points 1 and 5 exactly where a block from record `first` on is in doubt.
    #[cold]
    fn decide(closed: &ClosedMesh, sites: &[Site], first: usize, uncertain: Uncertain) -> Result<(), Rejection> {
        if sides(uncertain.orientation, first, 0).any(|t| {
            let [a, b, c] = closed.triangle_sites(sites, t);
            orient2d(a, b, c) <= 0
        }) {
            return Err(Rejection::NotAccepted("a triangle is not counterclockwise"));
        }
        for (i, side) in uncertain.sides.into_iter().enumerate() {
            if sides(side, first, i).any(|h| closed.fails(sites, h)) {
                return Err(Rejection::NotAccepted("an edge is not Delaunay"));
            }
        }
        Ok(())
    }

    /// Checks point 3.
    fn check_hull(&mut self, sites: &[Site]) -> Result<(), Rejection> {
        let rejection = Rejection::NotAccepted("the hull is not convex");
        self.successor.clear();
        self.successor.resize(sites.len(), VertexIndex::NONE);
        for &[u, v] in &self.hull {
            if std::mem::replace(&mut self.successor[u.get()], v) != VertexIndex::NONE {
                return Err(rejection);
            }
        }
        let Some(&[first, second]) = self.hull.first() else { return Err(rejection) };
        let (mut u, mut v) = (first, second);
        let mut rounds = 0;
        for _ in 0..self.hull.len() {
            let w = self.successor[v.get()];
            if w == VertexIndex::NONE {
                return Err(rejection);
            }
            let [p, q, r] = [u, v, w].map(|vertex| vertex.site(sites));
            if !turns_left_or_continues(p, q, r) {
                return Err(rejection);
            }
            rounds += (!is_upward(p, q) && is_upward(q, r)) as usize;
            (u, v) = (v, w);
            if u == first && rounds == 0 {
                return Err(rejection);
            }
        }
        match u == first && rounds == 1 {
            true => Ok(()),
            false => Err(rejection),
        }
    }
}

/// Checks points 1, 2 and 5, a block of triangles at a time, and writes the triangles to `mesh`. Returns the number of pairs of twins: every
/// pair is found once, from its greater half-edge. So all half-edges are paired if there are half as many pairs as half-edges.
// With the instructions of today's processors this takes less time.
#[multiversion(targets("x86_64+avx2+bmi1+bmi2+lzcnt+popcnt"))]
fn check_blocks(
    check: &mut AcceptanceCheck,
    closed: &ClosedMesh,
    sites: &[Site],
    order: Option<&[SiteIndex]>,
    mesh: &mut HalfEdgeMesh,
) -> Result<usize, Rejection> {
    let (front, records) = (closed.front().get() / 8, closed.records().as_chunks::<8>().0);
    let (mut links, mut padded) = (0, [[0; 8]; EdgeTester::TRIANGLES]);
    for first in (front..records.len()).step_by(EdgeTester::TRIANGLES) {
        let block = Block::new(records, first, &mut padded);
        let triangles = &mut mesh.triangles[first - front..][..block.count];
        match order {
            Some(order) => check.write_triangles(&block, sites, Some(order), triangles)?,
            None => check.write_triangles(&block, sites, None, triangles)?,
        }
        let tested = check.tester.test::<true>(records, front, first, &block, sites);
        if tested.broken {
            return Err(Rejection::NotAccepted("twins do not fit"));
        }
        if tested.uncertain != Uncertain::default() {
            AcceptanceCheck::decide(closed, sites, first, tested.uncertain)?;
        }
        links += tested.edges;
        check.write_twins(&block.records[..block.count], 8 * front as u32, &mut mesh.twins[3 * (first - front)..]);
    }
    Ok(links)
}

/// Returns whether the path p, q, r turns left or continues straight ahead.
fn turns_left_or_continues(p: Site, q: Site, r: Site) -> bool {
    let turn = orient2d(p, q, r);
    let [dx, dy] = [0, 1].map(|i| (q[i] as i64 - p[i] as i64) * (r[i] as i64 - q[i] as i64));
    turn > 0 || (turn == 0 && dx + dy > 0)
}

/// Returns whether the direction from p to q has an angle in [0, pi).
fn is_upward(p: Site, q: Site) -> bool {
    q[1] > p[1] || (q[1] == p[1] && q[0] > p[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A kite whose diagonal, between its far corners, is not Delaunay. One of its halves leads to the unused number of a record, where the
    /// test of the circle would see nothing.
    #[test]
    fn a_half_edge_that_leads_to_no_corner_is_found() {
        let (sites, out) = ([[0, 0], [50, -5], [100, 0], [50, 5]], u32::MAX);
        for (diagonal, unused) in [(2, 0), (3, 2)] {
            let records = [0, 1, 2, unused, out, out, 8, 4 * unused, 0, 2, 3, 0, diagonal, out, out, 0];
            let mut mesh = ClosedMesh::default();
            mesh.start_with(16, VertexIndex(4)).copy_from_slice(&records);
            let checked = AcceptanceCheck::default().accept(&mesh, &sites, None, &mut HalfEdgeMesh::default());
            assert!(checked.is_err(), "{diagonal}");
        }
    }
}
