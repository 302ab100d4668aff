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

use super::Rejected;
use super::sphere::{OUTSIDE, next, previous};
use crate::geometry::Site;
use crate::geometry::predicates::{in_circle, orient2d};
use crate::triangulation::mesh::{HULL, Mesh};

/// Buffers of the check.
#[derive(Default)]
pub(super) struct Acceptance {
    used: Vec<bool>,
    successor: Vec<u32>,
    hull: Vec<[u32; 2]>,
}

impl Acceptance {
    /// Checks the compacted triangles in `records` (see `sphere`; `front` is the number of the first) over `sites` and
    /// writes them to `mesh`, its corners being positions in the input by `order`.
    pub(super) fn accept(
        &mut self,
        records: &[u32],
        front: u32,
        sites: &[Site],
        order: &[u32],
        mesh: &mut Mesh,
    ) -> Result<(), Rejected> {
        let n = order.len();
        self.used.clear();
        self.used.resize(n, false);
        self.hull.clear();
        mesh.triangles.clear();
        mesh.twins.clear();
        mesh.triangles.reserve(records.len() / 8);
        mesh.twins.reserve(records.len() / 8 * 3);
        for at in (0..records.len()).step_by(8) {
            let triangle = self.check_triangle(records, at, front, &sites[..n], mesh)?;
            mesh.triangles.push(triangle.map(|v| order[v as usize]));
        }
        let (triangles, edges) = (mesh.triangles.len(), self.hull.len());
        if triangles + edges + 2 != 2 * n || !self.used.iter().all(|&used| used) {
            return Err(Rejected::NotAccepted("not every site is used once"));
        }
        self.check_hull(&sites[..n])
    }

    /// Points 1, 2 and 5 for the triangle at `at`; notes its corners and hull edges.
    #[inline(always)]
    fn check_triangle(
        &mut self,
        records: &[u32],
        at: usize,
        front: u32,
        sites: &[Site],
        mesh: &mut Mesh,
    ) -> Result<[u32; 3], Rejected> {
        let corners = [records[at], records[at + 1], records[at + 2]];
        let site = |v: u32| sites.get(v as usize).copied().ok_or(Rejected::NotAccepted("a corner is no site"));
        let [a, b, c] = [site(corners[0])?, site(corners[1])?, site(corners[2])?];
        if orient2d(a, b, c) <= 0 {
            return Err(Rejected::NotAccepted("a triangle is not counterclockwise"));
        }
        for i in 0..3 {
            self.used[corners[i] as usize] = true;
            let (h, twin) = (at as u32 + i as u32, records[at + 4 + i]);
            let ends = [corners[i], corners[(i + 1) % 3]];
            if twin == OUTSIDE {
                self.hull.push(ends);
                mesh.twins.push(HULL);
                continue;
            }
            let twin = twin.wrapping_sub(front);
            let (other, g) = ((twin & !7) as usize, (twin & 7) as usize);
            let fault = Rejected::NotAccepted("twins do not fit");
            let Some(record) = records.get(other..other + 8).filter(|r| g < 3 && r[g + 4] == h + front) else {
                return Err(fault);
            };
            if twin > h {
                let (end, apex) = (next(g as u32) as usize, previous(g as u32) as usize);
                if [record[end], record[g]] != ends {
                    return Err(fault);
                }
                if in_circle(a, b, c, site(record[apex])?) {
                    return Err(Rejected::NotAccepted("an edge is not Delaunay"));
                }
            }
            mesh.twins.push((twin >> 3) * 3 + (twin & 7));
        }
        Ok(corners)
    }

    /// Point 3.
    fn check_hull(&mut self, sites: &[Site]) -> Result<(), Rejected> {
        const NONE: u32 = u32::MAX;
        let fault = Rejected::NotAccepted("the hull is not convex");
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
