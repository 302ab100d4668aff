//! Step C2: shift all sites from their pixels to their true places, all at once. The topology stays; triangles that are
//! then not counterclockwise are flipped away, or a corner is taken out, to be inserted again in step C3.

use crate::geometry::Site;
use crate::geometry::predicates::orient2d;
use crate::voronoi::closed_mesh::{ClosedMesh, HoleFilling, OneRing, next, previous};
use crate::voronoi::edge_tester::EdgeTester;
use crate::voronoi::rejection::Rejection;

/// Rounds of repair; what is still bad after them goes another way.
const ROUNDS: usize = 6;

/// What the shift leaves behind.
#[derive(Default)]
pub(super) struct ShiftRepair {
    /// Triangles that are not counterclockwise.
    pub(super) inverted: Vec<u32>,
    /// Edges that may not be Delaunay. All others are.
    pub(super) suspects: Vec<u32>,
    /// Vertices taken out, each with a half-edge nearby.
    pub(super) removed: Vec<[u32; 2]>,
    edges: EdgeTester,
}

impl ShiftRepair {
    pub(super) fn clear(&mut self) {
        self.inverted.clear();
        self.suspects.clear();
        self.removed.clear();
    }

    /// Tests the triangles from record `start` to the last, unless `all` in whole blocks only, and their edges to
    /// triangles before them, at the true places of `sites`. Returns the first record that was not tested.
    pub(super) fn test(
        &mut self,
        sphere: &ClosedMesh,
        sites: &[Site],
        start: usize,
        all: bool,
        suspects: &mut Vec<u32>,
    ) -> usize {
        let records = sphere.records();
        let mut start = start;
        while start + EdgeTester::BLOCK <= records.len() || (all && start < records.len()) {
            let end = records.len().min(start + EdgeTester::BLOCK);
            for t in (start as u32..end as u32).step_by(8) {
                if orientation(sphere, sites, t).is_some_and(|area| area <= 0) {
                    self.inverted.push(t);
                }
            }
            self.edges.test::<false>(sphere, sites, start, end, suspects);
            start = end;
        }
        start
    }

    /// Makes every triangle counterclockwise.
    pub(super) fn repair(&mut self, sphere: &mut ClosedMesh, sites: &[Site]) -> Result<(), Rejection> {
        for round in 0..ROUNDS {
            for t in std::mem::take(&mut self.inverted) {
                if orientation(sphere, sites, t).is_some_and(|area| area <= 0)
                    && !self.mend(sphere, sites, t, round > 0)
                {
                    self.inverted.push(t);
                }
            }
            if self.inverted.is_empty() {
                return Ok(());
            }
        }
        Err(Rejection::NotAccepted("an inverted triangle stayed"))
    }

    fn mend(&mut self, sphere: &mut ClosedMesh, sites: &[Site], t: u32, anyhow: bool) -> bool {
        (t..t + 3).any(|h| self.flip_if_good(sphere, sites, h))
            || (t..t + 3).any(|h| self.peel_if_between(sphere, sites, h))
            || (t..t + 3).any(|h| self.take_out(sphere, sites, h, false))
            || (t..t + 3).any(|h| self.peel(sphere, h))
            || anyhow && (t..t + 3).any(|h| self.take_out(sphere, sites, h, true))
    }

    /// Flips edge `h` if both triangles are counterclockwise then.
    fn flip_if_good(&mut self, sphere: &mut ClosedMesh, sites: &[Site], h: u32) -> bool {
        let g = sphere.twin(h);
        let quad = [sphere.origin(h), sphere.origin(g), sphere.apex(h), sphere.apex(g)];
        if quad.contains(&sphere.infinity()) {
            return false;
        }
        let [u, v, w, z] = quad.map(|i| sites[i as usize]);
        let good = orient2d(z, w, u) > 0 && orient2d(w, z, v) > 0;
        if good {
            self.flip(sphere, h);
        }
        good
    }

    fn flip(&mut self, sphere: &mut ClosedMesh, h: u32) {
        let g = sphere.twin(h);
        sphere.flip(h);
        self.suspects.extend([h, next(h), previous(h), g, previous(g)]);
    }

    /// Takes the triangle of hull edge `h` off the mesh if its apex lies beside the edge: the hull then goes by it.
    fn peel_if_between(&mut self, sphere: &mut ClosedMesh, sites: &[Site], h: u32) -> bool {
        let [u, v, w] = [sphere.origin(h), sphere.destination(h), sphere.apex(h)].map(|i| sites[i as usize]);
        let towards = |p: Site, q: Site, r: Site| {
            (q[0] as i64 - p[0] as i64) * (r[0] as i64 - p[0] as i64)
                + (q[1] as i64 - p[1] as i64) * (r[1] as i64 - p[1] as i64)
                > 0
        };
        towards(u, v, w) && towards(v, u, w) && self.peel(sphere, h)
    }

    fn peel(&mut self, sphere: &mut ClosedMesh, h: u32) -> bool {
        let outside = sphere.apex(sphere.twin(h)) == sphere.infinity();
        if outside {
            self.flip(sphere, h);
        }
        outside
    }

    /// Takes the vertex at which `h` starts out if the hole can be filled with counterclockwise triangles, or `anyhow`; what is
    /// inverted then will be seen to.
    pub(super) fn take_out(&mut self, sphere: &mut ClosedMesh, sites: &[Site], h: u32, anyhow: bool) -> bool {
        let (vertex, first) = (sphere.origin(h), self.suspects.len());
        let done = self.remove_fan(sphere, sites, h, anyhow);
        if done {
            self.removed.push([vertex, self.suspects[first]]);
        }
        done
    }

    /// Removes the triangles around the start of `h`, which stays a corner elsewhere.
    pub(super) fn dissolve(&mut self, sphere: &mut ClosedMesh, sites: &[Site], h: u32) -> bool {
        self.remove_fan(sphere, sites, h, true)
    }

    fn remove_fan(&mut self, sphere: &mut ClosedMesh, sites: &[Site], h: u32, anyhow: bool) -> bool {
        let Some(star) = sphere.star(h) else { return false };
        let Some(fill) = star.fill(sites, sphere.infinity(), anyhow) else { return false };
        let first = self.suspects.len();
        sphere.replace_star(&star, &fill, |h| self.suspects.push(h));
        if anyhow {
            let inverted = |t: &u32| orientation(sphere, sites, *t).is_some_and(|area| area <= 0);
            self.inverted.extend(self.suspects[first..].iter().map(|h| h & !7).filter(inverted));
        }
        true
    }
}

/// Twice the area of the triangle with first half-edge `t`, or `None` for ghosts and free records.
#[inline(always)]
pub(super) fn orientation(sphere: &ClosedMesh, sites: &[Site], t: u32) -> Option<i64> {
    let corners = sphere.corners(t)?;
    if corners.contains(&sphere.infinity()) {
        return None;
    }
    let at = |v: u32| sites[v as usize];
    Some(orient2d(at(corners[0]), at(corners[1]), at(corners[2])))
}

impl OneRing {
    /// Cuts the hole into counterclockwise triangles; where one of its corners is at infinity, into as many as there is room for,
    /// and ghosts. `None` if that is impossible, unless it is to be filled `anyhow`.
    pub(super) fn fill(&self, sites: &[Site], infinity: u32, anyhow: bool) -> Option<HoleFilling> {
        let mut sides: Vec<usize> = (0..self.vertices.len()).collect();
        let mut ears = Vec::with_capacity(sides.len());
        let ghosts = self.vertices.iter().filter(|&&v| v == infinity).count();
        if ghosts > 1 {
            return None;
        }
        while sides.len() > 2 {
            let n = sides.len();
            let triple = |i: usize| [sides[i], sides[(i + 1) % n], sides[(i + 2) % n]];
            let ear = (0..n).find(|&i| self.is_ear(sites, infinity, &sides, triple(i)));
            let last_resort = || match ghosts {
                0 => anyhow.then_some(0),
                _ => (0..n).find(|&i| self.vertices[triple(i)[2]] == infinity),
            };
            let i = ear.or_else(last_resort)?;
            ears.push(triple(i));
            sides.remove((i + 1) % n);
        }
        Some(HoleFilling { ears, seam: [sides[0], sides[1]] })
    }

    fn is_ear(&self, sites: &[Site], infinity: u32, sides: &[usize], triple: [usize; 3]) -> bool {
        let corners = triple.map(|i| self.vertices[i]);
        if corners.contains(&infinity) {
            return false;
        }
        let at = |v: u32| sites[v as usize];
        let [a, b, c] = corners.map(at);
        let covers = |v: u32| {
            let p = at(v);
            orient2d(a, b, p) >= 0 && orient2d(b, c, p) >= 0 && orient2d(c, a, p) >= 0
        };
        let others = sides.iter().map(|&i| self.vertices[i]).filter(|v| !corners.contains(v) && *v != infinity);
        orient2d(a, b, c) > 0 && !others.into_iter().any(covers)
    }
}
