//! The Delaunay triangulation of the sites of one tile, whoever computes it.

pub mod options;
pub mod reference;

use crate::geometry::Site;
use crate::gpu::device::{Wish, hardware_is_likely};
use crate::gpu::executor::{Executor, Order};
use crate::gpu::options::GpuOptions;
use crate::mesh::half_edge::HalfEdgeMesh;
use crate::triangulation::options::{Backend, TriangulationOptions};
use crate::voronoi::{self, DiagramBackend, PipelineBuffers, PipelineCounts, Rejection};
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::cell::RefCell;
use std::ops::AddAssign;

/// How leaves were triangulated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TriangulationCounts {
    /// Leaves that the discrete-Voronoi pipeline triangulated, and its result was accepted.
    pub pipeline: u64,
    /// Leaves that `spade` triangulated: all with `backend = "reference"`, else those too small for the pipeline.
    pub reference: u64,
    /// Leaves that the pipeline gave up and `spade` triangulated: too many sites shared a pixel.
    pub crowded: u64,
    /// Leaves that the pipeline got wrong, which showed, and `spade` triangulated.
    pub not_accepted: u64,
    /// What the pipeline met.
    pub counts: PipelineCounts,
}

impl AddAssign for TriangulationCounts {
    fn add_assign(&mut self, other: TriangulationCounts) {
        self.pipeline += other.pipeline;
        self.reference += other.reference;
        self.crowded += other.crowded;
        self.not_accepted += other.not_accepted;
        self.counts += other.counts;
    }
}

thread_local! {
    /// The pipeline's buffers, kept from leaf to leaf so that their pages are faulted in once a thread.
    static BUFFERS: RefCell<PipelineBuffers> = RefCell::default();
}

/// Who triangulates leaves: the pipeline on the worker's own thread, with a GPU's help where there is one, or the reference.
pub struct Triangulator {
    pipeline: bool,
    gpu: Option<Executor>,
}

/// Bytes on the CPU's side that a pixel of a GPU's texture takes: its label, where its site is listed, and its turn in a buffer.
const BYTES_PER_PIXEL: u64 = 12;
/// With less memory than this for the whole job, drivers take too large a share of it for "auto".
const LEAST_MEMORY: u64 = 1 << 30;

impl Triangulator {
    /// The triangulator that the configuration asks for, for leaves on `threads` threads at once within `memory` bytes.
    ///
    /// # Errors
    /// [`Error::Config`] if a GPU is asked for and there is none that will do. A GPU that may be used, but cannot, is none.
    pub fn new(config: &TriangulationOptions, gpu: &GpuOptions, memory: u64, threads: usize) -> Result<Triangulator> {
        let pipeline = config.backend != Backend::Reference;
        let required = config.backend == Backend::Gpu;
        let allowed = || config.backend == Backend::Auto && memory >= LEAST_MEMORY && hardware_is_likely();
        if !required && !allowed() {
            return Ok(Triangulator { pipeline, gpu: None });
        }
        let order = Order {
            wish: Wish::new(gpu.adapter.as_deref(), required),
            voronoi: gpu.voronoi,
            texture: gpu.texture,
            most_pixels: memory / 4 / threads as u64 / BYTES_PER_PIXEL,
            shared: !required,
        };
        match Executor::start(&order) {
            Ok(gpu) => Ok(Triangulator { pipeline, gpu: Some(gpu) }),
            Err(_) if !required => Ok(Triangulator { pipeline, gpu: None }),
            Err(why) => Err(Error::Config(format!(
                "[triangulation] backend = \"gpu\": {why}; `gdt-batch gpu` lists what there is, and \"auto\" does without a GPU"
            ))),
        }
    }

    /// The name of the GPU that helps.
    pub fn gpu(&self) -> Option<&str> {
        self.gpu.as_ref().map(|gpu| gpu.adapter.as_str())
    }

    /// Seconds that every step has taken on the GPU itself, where it tells.
    pub fn gpu_steps(&self) -> Vec<(&'static str, f64)> {
        self.gpu.as_ref().map(Executor::step_seconds).unwrap_or_default()
    }

    /// The canonical Delaunay triangulation of distinct `sites`, the same whoever computes it.
    ///
    /// # Errors
    /// [`Error::Broken`] if even the reference triangulation fails.
    pub fn triangulate(&self, sites: &[Site]) -> Result<(HalfEdgeMesh, TriangulationCounts)> {
        let mut outcome = TriangulationCounts::default();
        if self.pipeline {
            let gpu = self.gpu.as_ref().map(|gpu| gpu as &dyn DiagramBackend);
            match BUFFERS.with_borrow_mut(|buffers| voronoi::triangulate_with(sites, gpu, buffers)) {
                Ok((mesh, counts)) => return Ok((mesh, TriangulationCounts { pipeline: 1, counts, ..outcome })),
                Err(Rejection::Crowded) => outcome.crowded = 1,
                Err(Rejection::NotAccepted(_)) => outcome.not_accepted = 1,
                Err(Rejection::TooFew | Rejection::TooMany | Rejection::OutOfReach) => outcome.reference = 1,
            }
        } else {
            outcome.reference = 1;
        }
        Ok((reference::triangulate(sites)?, outcome))
    }
}

/// The canonical Delaunay triangulation of distinct `sites`, by this thread alone.
///
/// # Errors
/// As [`Triangulator::triangulate`].
pub fn canonical(sites: &[Site]) -> Result<HalfEdgeMesh> {
    match BUFFERS.with_borrow_mut(|buffers| voronoi::triangulate(sites, buffers)) {
        Ok((mesh, _)) => Ok(mesh),
        Err(_) => reference::triangulate(sites),
    }
}

/// Takes back the memory of a mesh that is no longer needed, for the next leaf of this thread.
pub fn recycle(mesh: HalfEdgeMesh) {
    BUFFERS.with_borrow_mut(|buffers| buffers.recycle(mesh));
}
