//! Step C1: complete the convex hull. Where two hull edges leave a pocket between them, it is filled with a triangle, which
//! is the flip of an edge to infinity, until none is left: the paper's stack walk round the boundary.

use crate::geometry::Site;
use crate::geometry::predicates::orient2d;
use crate::voronoi::c2_shift::ShiftRepair;
use crate::voronoi::closed_mesh::{ClosedMesh, next, previous};
use crate::voronoi::rejection::Rejection;

/// How many hull vertices on either side of a pocket are tried for lying in it.
const NEAR: usize = 6;
/// How often the hull is mended before it is given up.
const ROUNDS: usize = 12;
/// Rounds in which vertices are taken out only where that leaves a clean hole.
const PATIENCE: usize = 4;

/// Makes the hull convex. What it changes is noted in `shift`, as are the vertices it takes out: where thin regions reach
/// the frame, vertices may hang on the hull that belong inside.
pub(super) fn complete_hull(sphere: &mut ClosedMesh, sites: &[Site], shift: &mut ShiftRepair) -> Result<(), Rejection> {
    for round in 0..ROUNDS {
        let spokes = all_spokes(sphere)?;
        let blocked = fill_pockets(sphere, sites, spokes, shift);
        let ring = HullLoop::new(sphere, &all_spokes(sphere)?);
        if blocked.is_empty() && ring.turns_once(sites) {
            return Ok(());
        }
        let before = shift.removed.len();
        for vertex in ring.sharp_corners(sites, round >= 2).chain(blocked) {
            take_out(sphere, sites, vertex, shift, round >= PATIENCE);
        }
        shift.repair(sphere, sites)?;
        if shift.removed.len() == before && round > PATIENCE {
            break;
        }
    }
    Err(Rejection::NotAccepted("the hull could not be completed"))
}

/// Fills pockets from `spokes` on; returns the vertices whose pockets were left because other hull vertices lie in them.
fn fill_pockets(sphere: &mut ClosedMesh, sites: &[Site], mut spokes: Vec<u32>, shift: &mut ShiftRepair) -> Vec<u32> {
    let mut blocked = Vec::new();
    while let Some(h) = spokes.pop() {
        // Flips let a half-edge change its place, so that one in the list need not be a spoke any more.
        if sphere.origin(h) != sphere.infinity() || !sphere.fails(sites, h) {
            continue;
        }
        if !is_empty(sphere, sites, h) {
            blocked.push(sphere.destination(h));
            continue;
        }
        let g = sphere.twin(h);
        sphere.flip(h);
        shift.suspects.extend([g, previous(g)]);
        spokes.extend([h, sphere.twin(previous(h))]);
    }
    blocked
}

/// Takes `vertex` out if it still is on the hull.
fn take_out(sphere: &mut ClosedMesh, sites: &[Site], vertex: u32, shift: &mut ShiftRepair, anyhow: bool) {
    let spokes = all_spokes(sphere).unwrap_or_default();
    if let Some(&h) = spokes.iter().find(|&&h| sphere.destination(h) == vertex) {
        shift.take_out(sphere, sites, next(h), anyhow);
    }
}

/// The vertices of the hull, counterclockwise.
struct HullLoop(Vec<u32>);

impl HullLoop {
    fn new(sphere: &ClosedMesh, spokes: &[u32]) -> HullLoop {
        HullLoop(spokes.iter().rev().map(|&h| sphere.destination(h)).collect())
    }

    /// Every vertex with the one before and the one after it.
    fn corners(&self) -> impl Iterator<Item = [u32; 3]> {
        let n = self.0.len();
        (0..n).map(move |i| [self.0[(i + n - 1) % n], self.0[i], self.0[(i + 1) % n]])
    }

    fn turns_once(&self, sites: &[Site]) -> bool {
        let upward = |p: Site, q: Site| q[1] > p[1] || (q[1] == p[1] && q[0] > p[0]);
        let starts_upward = |&[p, q, r]: &[Site; 3]| !upward(p, q) && upward(q, r);
        self.corners().map(|c| c.map(|v| sites[v as usize])).filter(starts_upward).count() == 1
    }

    /// The vertices at which the hull turns by more than a right angle, and maybe those beside them.
    fn sharp_corners(&self, sites: &[Site], and_beside: bool) -> impl Iterator<Item = u32> {
        let along = |a: Site, b: Site, i: usize| b[i] as i64 - a[i] as i64;
        let is_sharp = move |&[p, q, r]: &[u32; 3]| {
            let (p, q, r) = (sites[p as usize], sites[q as usize], sites[r as usize]);
            along(p, q, 0) * along(q, r, 0) + along(p, q, 1) * along(q, r, 1) < 0
        };
        let range = if and_beside { 0..3 } else { 1..2 };
        self.corners().filter(is_sharp).flat_map(move |corner| range.clone().map(move |i| corner[i]))
    }
}

/// All half-edges that start at infinity.
fn all_spokes(sphere: &ClosedMesh) -> Result<Vec<u32>, Rejection> {
    let infinity = sphere.infinity();
    let ghost = sphere.triangles().find(|&t| sphere.is_ghost(t)).ok_or(Rejection::NotAccepted("no hull"))?;
    let first = (ghost..ghost + 3).find(|&h| sphere.origin(h) == infinity).unwrap_or(ghost);
    let mut spokes = vec![first];
    loop {
        let spoke = sphere.twin(previous(*spokes.last().unwrap_or(&first)));
        if spoke == first {
            return Ok(spokes);
        }
        if spokes.len() > sphere.len() {
            return Err(Rejection::NotAccepted("the hull has no end"));
        }
        spokes.push(spoke);
    }
}

/// Whether no hull vertex nearby lies in the pocket at spoke `h`.
fn is_empty(sphere: &ClosedMesh, sites: &[Site], h: u32) -> bool {
    let at = |v: u32| sites[v as usize];
    let vertices = [sphere.destination(h), sphere.apex(h), sphere.apex(sphere.twin(h))];
    let [a, b, c] = vertices.map(at);
    let covers = |v: u32| {
        let p = at(v);
        !vertices.contains(&v) && orient2d(a, b, p) >= 0 && orient2d(b, c, p) >= 0 && orient2d(c, a, p) >= 0
    };
    let (mut back, mut forth) = (h, h);
    for _ in 0..NEAR {
        back = sphere.twin(previous(back));
        forth = next(sphere.twin(forth));
        if covers(sphere.destination(back)) || covers(sphere.destination(forth)) {
            return false;
        }
    }
    true
}
