//! Step C1: complete the convex hull. Where two hull edges leave a pocket between them, it is filled with a triangle, which
//! is the flip of an edge to infinity, until none is left: the paper's stack walk round the boundary.

use super::Rejected;
use super::sphere::{Sphere, next, previous};
use crate::geometry::Site;
use crate::geometry::predicates::orient2d;

/// How many hull vertices on either side of a pocket are tried for lying in it.
const NEAR: usize = 6;

/// Makes the hull convex. Edges that the new triangles put in doubt go to `suspects`.
pub(super) fn complete_hull(sphere: &mut Sphere, sites: &[Site], suspects: &mut Vec<u32>) -> Result<(), Rejected> {
    let mut spokes = all_spokes(sphere)?;
    while let Some(h) = spokes.pop() {
        // Flips let a half-edge change its place, so that one in the list need not be a spoke any more.
        if sphere.origin(h) != sphere.infinity() || !sphere.fails(sites, h) || !is_empty(sphere, sites, h) {
            continue;
        }
        let g = sphere.twin(h);
        sphere.flip(h);
        suspects.extend([next(g), previous(g)]);
        spokes.extend([previous(h), sphere.twin(next(h))]);
    }
    Ok(())
}

/// All half-edges that start at infinity.
fn all_spokes(sphere: &Sphere) -> Result<Vec<u32>, Rejected> {
    let infinity = sphere.infinity();
    let ghost = sphere.triangles().find(|&t| sphere.is_ghost(t)).ok_or(Rejected::NotAccepted("no hull"))?;
    let first = (ghost..ghost + 3).find(|&h| sphere.origin(h) == infinity).unwrap_or(ghost);
    let mut spokes = vec![first];
    loop {
        let spoke = sphere.twin(previous(*spokes.last().unwrap_or(&first)));
        if spoke == first {
            return Ok(spokes);
        }
        spokes.push(spoke);
    }
}

/// Whether no hull vertex nearby lies in the pocket at spoke `h`.
fn is_empty(sphere: &Sphere, sites: &[Site], h: u32) -> bool {
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
