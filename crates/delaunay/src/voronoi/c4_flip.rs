//! Step C4: flip edges until all are Delaunay (Lawson), by the canonical in-circle test.

use crate::geometry::Site;
use crate::geometry::predicates::{failing_edge, four_inside_or_uncertain};
use crate::voronoi::closed_mesh::ClosedMesh;
use crate::voronoi::index::ClosedEdge;
use crate::voronoi::rejection::Rejection;

/// Flips and steps that are allowed per site. If more are needed, the mesh is not a triangulation, or the pipeline does not suit the
/// leaf.
const STEPS_PER_SITE: u64 = 64;

/// The edges that are still to be tested, and the effort so far.
#[derive(Default)]
pub(super) struct FlipQueue {
    /// Edges that may not be Delaunay. All others are.
    pub(super) suspects: Vec<ClosedEdge>,
    /// Edges that could not be flipped during the scan.
    pub(super) later: Vec<ClosedEdge>,
    /// The number of flips done.
    pub(super) done: u64,
    steps_left: u64,
}

impl FlipQueue {
    /// Clears the queue for a leaf of `sites` sites.
    pub(super) fn reset(&mut self, sites: usize) {
        self.suspects.clear();
        self.later.clear();
        self.done = 0;
        self.steps_left = STEPS_PER_SITE * sites as u64 + 1024;
    }

    /// Counts one step of work, which is bounded.
    #[inline(always)]
    pub(super) fn step(&mut self) -> Result<(), Rejection> {
        self.steps_left = self.steps_left.checked_sub(1).ok_or(Rejection::NotAccepted("no end in sight"))?;
        Ok(())
    }

    /// Flips what can be flipped during the scan, while sites are not yet at their true places: only edges whose two triangles are
    /// counterclockwise afterwards. The others wait in `later`.
    #[inline(always)]
    pub(super) fn run_early(&mut self, mesh: &mut ClosedMesh, sites: &[Site]) -> Result<(), Rejection> {
        while let Some(h) = self.suspects.pop() {
            let g = mesh.twin(h);
            // An open edge is tested when its second triangle exists. Edges to infinity are left to step C1.
            if g < mesh.front() {
                continue;
            }
            let Some([u, v, w, z]) = mesh.finite_quadrilateral(sites, h) else { continue };
            let Some(is_convex) = failing_edge(u, v, w, z) else { continue };
            if !is_convex {
                self.later.push(h);
                continue;
            }
            self.step()?;
            self.done += 1;
            mesh.flip(h);
            self.suspect_outline(mesh, sites, [h, h.previous(), g, g.previous()], [[u, z, w], [v, w, z]]);
        }
        Ok(())
    }

    /// Adds those sides that may fail of the `outline` of two triangles whose common edge was flipped, two sides of each.
    #[inline(always)]
    fn suspect_outline(&mut self, mesh: &ClosedMesh, sites: &[Site], outline: [ClosedEdge; 4], [t, u]: [[Site; 3]; 2]) {
        // Written out: a map over the array would become calls.
        let [i, j, k, l] = outline;
        let beyond = [
            mesh.site_beyond(sites, i),
            mesh.site_beyond(sites, j),
            mesh.site_beyond(sites, k),
            mesh.site_beyond(sites, l),
        ];
        let uncertain = four_inside_or_uncertain([t, t, u, u], beyond);
        let mut found = [ClosedEdge::default(); 4];
        let mut count = 0;
        for (side, doubt) in outline.into_iter().zip(uncertain) {
            found[count % 4] = side;
            count += doubt as usize;
        }
        self.suspects.extend_from_slice(&found[..count]);
    }

    /// Flips edges until every edge is Delaunay.
    pub(super) fn run(&mut self, mesh: &mut ClosedMesh, sites: &[Site]) -> Result<(), Rejection> {
        while let Some(h) = self.suspects.pop() {
            if !mesh.is_free(h) && mesh.fails(sites, h) {
                self.flip(mesh, h)?;
            }
        }
        Ok(())
    }

    /// Flips edges until every edge is Delaunay. The suspects are the sides, opposite to a new vertex, of all its triangles. A flip
    /// gives the vertex one more edge, which is Delaunay because the mesh was Delaunay without the vertex. So only sides opposite to it
    /// are tested.
    pub(super) fn run_around(&mut self, mesh: &mut ClosedMesh, sites: &[Site]) -> Result<(), Rejection> {
        while let Some(h) = self.suspects.pop() {
            if mesh.fails(sites, h) {
                self.step()?;
                self.done += 1;
                let g = mesh.twin(h);
                mesh.flip(h);
                self.suspects.extend([h, g.previous()]);
            }
        }
        Ok(())
    }

    #[inline(always)]
    fn flip(&mut self, mesh: &mut ClosedMesh, h: ClosedEdge) -> Result<(), Rejection> {
        self.step()?;
        self.done += 1;
        let g = mesh.twin(h);
        mesh.flip(h);
        self.suspects.extend([h, h.previous(), g, g.previous()]);
        Ok(())
    }
}
