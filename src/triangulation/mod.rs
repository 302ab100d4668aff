//! The Delaunay triangulation of the sites of one tile, whoever computes it.

pub mod flip;
pub mod mesh;
pub mod reference;

use crate::Result;
use crate::config::Backend;
use crate::geometry::Site;
use crate::voronoi::{self, Counts, Rejected, Scratch};
use mesh::Mesh;
use serde::{Deserialize, Serialize};
use std::cell::RefCell;
use std::ops::AddAssign;

/// How leaves were triangulated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Outcome {
    /// Leaves that the discrete-Voronoi pipeline triangulated, and its result was accepted.
    pub pipeline: u64,
    /// Leaves that `spade` triangulated: all with `backend = "reference"`, else those too small for the pipeline.
    pub reference: u64,
    /// Leaves that the pipeline gave up and `spade` triangulated: too many sites shared a pixel.
    pub crowded: u64,
    /// Leaves that the pipeline got wrong, which showed, and `spade` triangulated.
    pub not_accepted: u64,
    /// What the pipeline met.
    pub counts: Counts,
}

impl AddAssign for Outcome {
    fn add_assign(&mut self, other: Outcome) {
        self.pipeline += other.pipeline;
        self.reference += other.reference;
        self.crowded += other.crowded;
        self.not_accepted += other.not_accepted;
        self.counts += other.counts;
    }
}

thread_local! {
    /// The pipeline's buffers, kept from leaf to leaf so that their pages are faulted in once a thread.
    static SCRATCH: RefCell<Scratch> = RefCell::default();
}

/// The canonical Delaunay triangulation of distinct `sites`, the same whichever `backend` computes it.
///
/// # Errors
/// [`crate::Error::Broken`] if even the reference triangulation fails.
pub fn triangulate(sites: &[Site], backend: Backend) -> Result<(Mesh, Outcome)> {
    let mut outcome = Outcome::default();
    if backend != Backend::Reference {
        match SCRATCH.with_borrow_mut(|scratch| voronoi::triangulate(sites, scratch)) {
            Ok((mesh, counts)) => return Ok((mesh, Outcome { pipeline: 1, counts, ..outcome })),
            Err(Rejected::Crowded) => outcome.crowded = 1,
            Err(Rejected::NotAccepted(_)) => outcome.not_accepted = 1,
            Err(Rejected::TooFew | Rejected::TooMany | Rejected::OutOfReach) => outcome.reference = 1,
        }
    } else {
        outcome.reference = 1;
    }
    Ok((reference::triangulate(sites)?, outcome))
}

/// Takes back the memory of a mesh that is no longer needed, for the next leaf of this thread.
pub fn recycle(mesh: Mesh) {
    SCRATCH.with_borrow_mut(|scratch| scratch.recycle(mesh));
}
