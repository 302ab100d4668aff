//! The last steps, C2 to C3 and the proof, which are the same whoever has made the mesh.

use crate::geometry::Site;
use crate::mesh::half_edge::HalfEdgeMesh;
use crate::mesh::index::SiteIndex;
use crate::voronoi::accept::AcceptanceCheck;
use crate::voronoi::c1_hull;
use crate::voronoi::c2_shift::ShiftRepair;
use crate::voronoi::c3_insert;
use crate::voronoi::c3_insert::MissingSite;
use crate::voronoi::c4_flip::FlipQueue;
use crate::voronoi::closed_mesh::ClosedMesh;
use crate::voronoi::counts::{PipelineCounts, StepTimer};
use crate::voronoi::index::ClosedEdge;
use crate::voronoi::rejection::Rejection;

/// A mesh that is nearly done. What is left to do is listed in `shift` and `flips`.
pub(super) struct Completion<'a> {
    pub(super) closed: &'a mut ClosedMesh,
    /// The site of every vertex, with one more entry for the vertex at infinity.
    pub(super) sites: &'a [Site],
    pub(super) shift: &'a mut ShiftRepair,
    pub(super) flips: &'a mut FlipQueue,
    pub(super) counts: PipelineCounts,
    pub(super) timer: StepTimer,
}

impl Completion<'_> {
    /// Does steps C2, C1 and C4.
    pub(super) fn repair(&mut self) -> Result<(), Rejection> {
        let Completion { closed, sites, shift, flips, counts, timer } = self;
        // C2 comes before C1, so that the hull is completed only once, at its true place.
        shift.repair(closed, sites)?;
        timer.finish(counts, 3);
        c1_hull::complete_hull(closed, sites, shift)?;
        counts.removed = shift.removed.len() as u64;
        timer.finish(counts, 4);
        // C4 comes before C3, so that sites are inserted into a Delaunay mesh, in which walks are short and sure to end.
        std::mem::swap(&mut flips.suspects, &mut shift.suspects);
        flips.run(closed, sites)?;
        timer.finish(counts, 5);
        Ok(())
    }

    /// Does step C3.
    pub(super) fn insert(
        &mut self,
        missing: impl Iterator<Item = MissingSite>,
        start_near: impl Fn(u32) -> ClosedEdge,
    ) -> Result<(), Rejection> {
        let Completion { closed, sites, shift, flips, counts, timer } = self;
        c3_insert::insert_all(closed, sites, &shift.removed, missing, start_near, flips)?;
        counts.flips = flips.done;
        timer.finish(counts, 6);
        Ok(())
    }

    /// Proves the mesh and writes it to `mesh`; `order` is that of [`AcceptanceCheck::accept`].
    pub(super) fn prove(
        self,
        order: Option<&[SiteIndex]>,
        acceptance: &mut AcceptanceCheck,
        mesh: &mut HalfEdgeMesh,
    ) -> Result<PipelineCounts, Rejection> {
        let Completion { closed, sites, mut counts, mut timer, .. } = self;
        closed.compact();
        acceptance.accept(closed, &sites[..sites.len() - 1], order, mesh)?;
        timer.finish(&mut counts, 7);
        Ok(counts)
    }
}
