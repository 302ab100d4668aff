//! Step G3: islands. A thin Voronoi region can fall apart into pixels that do not touch, each of which then looks like a
//! region of its own: the scan makes a second fan of triangles around the same site, somewhere else.
//!
//! The paper recolours such pixels before it looks for corners. Here, where they are rare, the surplus fan is taken out of
//! the mesh, which is the same as if its pixels had taken the colours around them. As the site lies outside its island, some
//! triangle around it is not counterclockwise, so that only those need to be looked at.

use crate::geometry::Site;
use crate::voronoi::c2_shift::{ShiftRepair, orientation};
use crate::voronoi::closed_mesh::{ClosedMesh, next, previous};
use crate::voronoi::counts::PipelineCounts;
use crate::voronoi::rejection::Rejection;
use std::cmp::Reverse;

/// Fans with more triangles than this are not followed.
const MOST: usize = 64;

/// Buffers of the search.
#[derive(Default)]
pub(super) struct IslandSearch {
    /// By site, how many triangles have it as a corner.
    degrees: Vec<u16>,
    fans: Vec<TriangleFan>,
}

/// A closed fan of triangles around a site that has more than one; the least of them is most likely the one that holds the site.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct TriangleFan {
    site: u32,
    /// Triangles that are not counterclockwise.
    inverted: usize,
    degree: Reverse<usize>,
    /// The least half-edge that starts at the site.
    spoke: u32,
}

impl IslandSearch {
    /// Takes out what surplus fans there are. A sphere of `v` vertices has `2 v - 4` triangles, and every island adds two.
    pub(super) fn remove(
        &mut self,
        sphere: &mut ClosedMesh,
        sites: &[Site],
        placed: usize,
        shift: &mut ShiftRepair,
        counts: &mut PipelineCounts,
    ) -> Result<(), Rejection> {
        // Nothing has been taken out yet.
        let mut expected = 2 * placed - 2;
        while sphere.len() > expected {
            let before = sphere.len();
            self.remove_apart(sphere, sites, shift, counts);
            expected = 2 * (placed - shift.removed.len()) - 2;
            if sphere.len() == before {
                return Err(Rejection::NotAccepted("an island could not be removed"));
            }
        }
        match sphere.len() == expected {
            true => Ok(()),
            false => Err(Rejection::NotAccepted("the discrete Voronoi diagram is not a sphere")),
        }
    }

    /// Takes out those surplus fans that have no other fan within. An island may lie within an island, and so may a whole region.
    fn remove_apart(
        &mut self,
        sphere: &mut ClosedMesh,
        sites: &[Site],
        shift: &mut ShiftRepair,
        counts: &mut PipelineCounts,
    ) {
        self.count_degrees(sphere, sites.len());
        self.find_fans(sphere, sites, &shift.inverted);
        for fans in self.fans.chunk_by(|a, b| a.site == b.site) {
            // If every fan of the site is listed, the best is the first.
            let listed: usize = fans.iter().map(|fan| fan.degree.0).sum();
            let all = listed == self.degrees[fans[0].site as usize] as usize;
            for found in &fans[all as usize..] {
                // One beside it may have gone.
                if fan(sphere, sites, found.spoke).as_ref() != Some(found) {
                    continue;
                }
                if shift.dissolve(sphere, sites, found.spoke) {
                    counts.islands += 1;
                } else if let Some(h) = self.enclosed(sphere, found) {
                    shift.take_out(sphere, sites, h, true);
                }
            }
        }
    }

    /// A half-edge that starts at a site whose only triangles are two of `fan`.
    fn enclosed(&self, sphere: &ClosedMesh, fan: &TriangleFan) -> Option<u32> {
        let around = |spoke: &u32| Some(sphere.twin(previous(*spoke)));
        let sides = std::iter::successors(Some(fan.spoke), around).take(fan.degree.0).map(next);
        let mut behind = sides.map(|side| sphere.twin(side));
        behind.find(|&h| sphere.origin(h) != sphere.infinity() && self.degrees[sphere.origin(h) as usize] == 2)
    }

    fn count_degrees(&mut self, sphere: &ClosedMesh, sites: usize) {
        self.degrees.clear();
        self.degrees.resize(sites, 0);
        for corners in sphere.triangles().filter_map(|t| sphere.corners(t)) {
            for vertex in corners {
                let degree = &mut self.degrees[vertex as usize];
                *degree = degree.saturating_add(1);
            }
        }
    }

    /// Lists the fans that have an inverted triangle and are not all there is around their site.
    fn find_fans(&mut self, sphere: &ClosedMesh, sites: &[Site], inverted: &[u32]) {
        self.fans.clear();
        for h in inverted.iter().flat_map(|&t| t..t + 3) {
            let fan = fan(sphere, sites, h).filter(|fan| fan.degree.0 < self.degrees[fan.site as usize] as usize);
            self.fans.extend(fan);
        }
        self.fans.sort_unstable();
        self.fans.dedup();
    }
}

/// The fan around the start of `h`, if its triangle is still there.
fn fan(sphere: &ClosedMesh, sites: &[Site], h: u32) -> Option<TriangleFan> {
    if sphere.is_free(h) {
        return None;
    }
    let mut fan = TriangleFan { site: sphere.origin(h), inverted: 0, degree: Reverse(0), spoke: h };
    let mut spoke = h;
    while fan.degree.0 < MOST {
        fan.inverted += orientation(sphere, sites, spoke & !7).is_some_and(|area| area <= 0) as usize;
        fan.degree.0 += 1;
        fan.spoke = fan.spoke.min(spoke);
        spoke = sphere.twin(previous(spoke));
        if spoke == h {
            return Some(fan);
        }
    }
    None
}
