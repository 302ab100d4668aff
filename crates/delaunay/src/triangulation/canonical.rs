//! The canonical triangulation on one thread, which keeps the pipeline's buffers from leaf to leaf.

use crate::error::Result;
use crate::geometry::Site;
use crate::mesh::half_edge::HalfEdgeMesh;
use crate::triangulation::divide_and_conquer;
use crate::voronoi;
use crate::voronoi::PipelineBuffers;
use std::cell::RefCell;

thread_local! {
    /// The pipeline's buffers that are not in use. They are kept from leaf to leaf, so that each thread faults in their pages only once.
    static BUFFERS: RefCell<Vec<PipelineBuffers>> = RefCell::default();
}

/// Lends `work` the buffers of this thread.
pub fn with_buffers<T>(work: impl FnOnce(&mut PipelineBuffers) -> T) -> T {
    let mut buffers = BUFFERS.with_borrow_mut(Vec::pop).unwrap_or_default();
    let outcome = work(&mut buffers);
    BUFFERS.with_borrow_mut(|unused| unused.push(buffers));
    outcome
}

/// Computes the canonical Delaunay triangulation of distinct `sites` on this thread alone.
///
/// # Errors
/// [`Error::Stopped`](crate::Error::Stopped), [`Error::Coincident`](crate::Error::Coincident), [`Error::OutOfReach`](crate::Error::OutOfReach).
pub fn canonical(sites: &[Site]) -> Result<HalfEdgeMesh> {
    match with_buffers(|buffers| voronoi::triangulate(sites, buffers)) {
        Ok((mesh, _)) => Ok(mesh),
        Err(_) => divide_and_conquer::triangulate(sites),
    }
}

/// Takes back a mesh that is no longer needed, so that this thread's next leaf uses its memory.
pub fn recycle(mesh: HalfEdgeMesh) {
    with_buffers(|buffers| buffers.recycle(mesh));
}
