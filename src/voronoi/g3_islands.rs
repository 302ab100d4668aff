//! Step G3: islands. A thin Voronoi region can fall apart into pixels that do not touch, each of which then looks like a
//! region of its own: the scan makes a second fan of triangles around the same site, somewhere else.
//!
//! The paper recolours such pixels before it looks for corners. Here, where they are rare, the surplus fan is taken out of
//! the mesh, which is the same as if its pixels had taken the colours around them.

use super::Counts;
use super::Rejected;
use super::sphere::{Sphere, previous};
use crate::geometry::Site;
use crate::geometry::predicates::orient2d;

/// A sphere of `v` vertices has `2 v - 4` triangles; every island adds two.
pub(super) fn remove_islands(
    sphere: &mut Sphere,
    sites: &[Site],
    placed: usize,
    suspects: &mut Vec<u32>,
    counts: &mut Counts,
) -> Result<(), Rejected> {
    let expected = 2 * (placed + 1) - 4;
    if sphere.len() == expected {
        return Ok(());
    }
    for spoke in surplus_fans(sphere, sites) {
        let star = sphere.star(spoke).ok_or(Rejected::NotAccepted("an island with too many neighbours"))?;
        let fill = star.fill(sites, sphere.infinity(), true).ok_or(Rejected::NotAccepted("an island without shape"))?;
        sphere.replace_star(&star, &fill, |h| suspects.push(h));
        counts.islands += 1;
    }
    match sphere.len() == expected {
        true => Ok(()),
        false => Err(Rejected::NotAccepted("the discrete Voronoi diagram is not a sphere")),
    }
}

/// One half-edge of every fan but the best of each site.
fn surplus_fans(sphere: &Sphere, sites: &[Site]) -> Vec<u32> {
    let mut best = vec![None; sites.len()];
    let mut seen = vec![false; sphere.end() as usize];
    let mut surplus = Vec::new();
    for t in sphere.triangles() {
        for h in t..t + 3 {
            let vertex = sphere.origin(h);
            if seen[h as usize] || vertex == sphere.infinity() {
                continue;
            }
            let fan = (std::cmp::Reverse(badness(sphere, sites, h, &mut seen)), h);
            match best[vertex as usize] {
                Some(other) if other > fan => surplus.push(fan.1),
                Some((_, other)) => {
                    surplus.push(other);
                    best[vertex as usize] = Some(fan);
                }
                None => best[vertex as usize] = Some(fan),
            }
        }
    }
    surplus
}

/// How many triangles of the fan of `h` are not counterclockwise: around an island there is always one.
fn badness(sphere: &Sphere, sites: &[Site], h: u32, seen: &mut [bool]) -> usize {
    let mut bad = 0;
    let mut spoke = h;
    while !std::mem::replace(&mut seen[spoke as usize], true) {
        let corners = sphere.corners(spoke).unwrap_or_default();
        if !corners.contains(&sphere.infinity()) {
            let [a, b, c] = corners.map(|i| sites[i as usize]);
            bad += (orient2d(a, b, c) <= 0) as usize;
        }
        spoke = sphere.twin(previous(spoke));
    }
    bad
}
