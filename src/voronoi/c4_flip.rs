//! Step C4: flip edges until all are Delaunay (Lawson), by the canonical in-circle test.

use crate::geometry::Site;
use crate::voronoi::closed_mesh::{ClosedMesh, previous};
use crate::voronoi::rejection::Rejection;

/// Flips and steps allowed per site; more are a sign of a mesh that is no triangulation, or of a leaf that this is no
/// way to do.
const STEPS_PER_SITE: u64 = 64;

/// The edges still to be tested, and the effort so far.
#[derive(Default)]
pub(super) struct FlipQueue {
    /// Edges that may not be Delaunay. All others are.
    pub(super) suspects: Vec<u32>,
    /// Edges that could not be flipped while the scan went on.
    pub(super) later: Vec<u32>,
    /// Flips done.
    pub(super) done: u64,
    left: u64,
}

impl FlipQueue {
    /// Starts anew for a leaf of `sites` sites.
    pub(super) fn reset(&mut self, sites: usize) {
        self.suspects.clear();
        self.later.clear();
        self.done = 0;
        self.left = STEPS_PER_SITE * sites as u64 + 1024;
    }

    /// Counts one step of bounded work.
    #[inline(always)]
    pub(super) fn step(&mut self) -> Result<(), Rejection> {
        self.left = self.left.checked_sub(1).ok_or(Rejection::NotAccepted("no end in sight"))?;
        Ok(())
    }

    /// Flips what can be flipped while the scan goes on and sites are not yet where they belong: only where both triangles
    /// are counterclockwise afterwards. The others wait in `later`.
    pub(super) fn run_early(&mut self, sphere: &mut ClosedMesh, sites: &[Site]) -> Result<(), Rejection> {
        while let Some(h) = self.suspects.pop() {
            let g = sphere.twin(h);
            // An open edge is tested when its other triangle comes; those to infinity are for step C1.
            if g < sphere.front() || !sphere.fails_inside(sites, h) {
                continue;
            }
            if !sphere.is_convex(sites, h) {
                self.later.push(h);
                continue;
            }
            self.flip(sphere, h)?;
        }
        Ok(())
    }

    /// Flips until every edge is Delaunay.
    pub(super) fn run(&mut self, sphere: &mut ClosedMesh, sites: &[Site]) -> Result<(), Rejection> {
        while let Some(h) = self.suspects.pop() {
            if !sphere.is_free(h) && sphere.fails(sites, h) {
                self.flip(sphere, h)?;
            }
        }
        Ok(())
    }

    #[inline(always)]
    fn flip(&mut self, sphere: &mut ClosedMesh, h: u32) -> Result<(), Rejection> {
        self.step()?;
        self.done += 1;
        let g = sphere.twin(h);
        sphere.flip(h);
        self.suspects.extend([h, previous(h), g, previous(g)]);
        Ok(())
    }
}
