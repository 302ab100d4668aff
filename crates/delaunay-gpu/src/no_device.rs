//! What takes the place of the executor in a build without the feature `wgpu`: there is never one.

use crate::figures::GpuFigures;
use crate::options::GpuOptions;
use delaunay::geometry::Site;
use delaunay::voronoi::mesh_reply::MeshReply;

/// Whether a job needs the GPU or only profits from it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum GpuUse {
    /// The user asked for a GPU.
    Required,
    /// The job can do without.
    Optional,
}

/// A GPU that makes meshes. There is none.
pub(crate) enum Executor {}

impl Executor {
    /// Returns a sentence about this build.
    ///
    /// # Errors
    /// Always.
    pub(crate) fn start(_: &GpuOptions, _: GpuUse, _: u64) -> Result<Executor, String> {
        Err("this build of gdt-batch uses no GPU: build it with the feature gpu".into())
    }

    pub(crate) fn is_likely() -> bool {
        false
    }

    pub(crate) fn is_wanted_by_test() -> bool {
        false
    }

    pub(crate) fn adapter(&self) -> Option<&str> {
        match *self {}
    }

    pub(crate) fn step_seconds(&self) -> Vec<(&'static str, f64)> {
        match *self {}
    }

    pub(crate) fn figures(&self) -> GpuFigures {
        match *self {}
    }

    pub(crate) fn note(&self, _: bool, _: usize, _: f64) {
        match *self {}
    }

    pub(crate) fn note_in_vain(&self, _: &MeshReply) {
        match *self {}
    }

    pub(crate) fn is_worth_asking(&self, _: usize) -> bool {
        match *self {}
    }

    pub(crate) fn mesh(&self, _: &[Site]) -> MeshReply {
        match *self {}
    }
}
