//! The choice of backend for a leaf: the pipeline on the CPU, with a GPU, or the reference. What the pipeline rejects is divided and
//! conquered.

#[cfg(feature = "wgpu")]
use crate::executor::{Executor, GpuUse};
use crate::figures::GpuFigures;
#[cfg(not(feature = "wgpu"))]
use crate::no_device::{Executor, GpuUse};
use crate::options::GpuOptions;
use crate::triangulation_options::{Backend, TriangulationOptions};
use delaunay::geometry::Site;
use delaunay::host::Host;
use delaunay::mesh::half_edge::HalfEdgeMesh;
use delaunay::triangulation::canonical::with_buffers;
use delaunay::triangulation::counts::TriangulationCounts;
use delaunay::triangulation::{divide_and_conquer, reference};
use delaunay::voronoi;
use delaunay::voronoi::counts::PipelineCounts;
use delaunay::voronoi::mesh_reply::MeshReply;
use delaunay::voronoi::rejection::Rejection;
use std::sync::OnceLock;
use sys::interrupt;
use sys::threads::{own_cpu_seconds, unless_interrupted};
use sys::{Error, Result};

/// Triangulates leaves: with the pipeline on the worker's own thread, which a GPU may help, or with the reference.
pub struct Triangulator {
    pipeline: bool,
    gpu: OnceLock<Executor>,
    /// What a GPU gets that is opened once the job proves large enough.
    optional: Option<OptionalGpu>,
    /// Why a GPU that seems to be there was not opened.
    not_opened: OnceLock<String>,
}

/// See [`Triangulator::optional`].
struct OptionalGpu {
    options: GpuOptions,
    memory: u64,
}

/// The share of the memory that the CPU's side of a GPU may take.
const SHARE_FOR_GPU: u64 = 4;
/// "auto" uses no GPU if the whole job has less memory than this, because drivers would take too large a share of it.
const MIN_MEMORY: u64 = 1 << 30;
/// "auto" opens no GPU if a thread has fewer points to do: opening one takes some tenths of a second of processor time. With an H100, jobs of
/// 1.3 million points a thread took 1.01 and 1.12 of the time without, of 2.7 million 0.94 and 1.00, of 5.3 million 0.86 and 0.93
/// (BENCHMARKS.md).
pub const MIN_POINTS_PER_THREAD: u64 = 3_000_000;

impl Triangulator {
    /// Returns the triangulator that the configuration asks for, but for a GPU.
    pub fn without_gpu(config: &TriangulationOptions) -> Triangulator {
        delaunay::host::set(Host { is_stopped: interrupt::is_wanted, cpu_seconds: own_cpu_seconds });
        let pipeline = config.backend != Backend::Reference;
        Triangulator { pipeline, gpu: OnceLock::new(), optional: None, not_opened: OnceLock::new() }
    }

    /// Returns the triangulator that the configuration asks for, for a job that has `memory` bytes. A GPU that the job must have is opened
    /// here, any other by [`Triangulator::prepare`].
    ///
    /// # Errors
    /// [`Error::Config`] if the configuration requires a GPU and none is suitable.
    pub fn new(config: &TriangulationOptions, gpu: &GpuOptions, memory: u64) -> Result<Triangulator> {
        let mut triangulator = Triangulator::without_gpu(config);
        let memory_of_gpu = memory / SHARE_FOR_GPU;
        match config.backend {
            Backend::Gpu => {
                let executor = Executor::start(gpu, GpuUse::Required, memory_of_gpu).map_err(|why| {
                    Error::Config(format!(
                        "[triangulation] backend = \"gpu\": {why}; `gdt-batch gpu` lists the adapters, and backend = \"auto\" needs no GPU"
                    ))
                })?;
                triangulator.gpu = OnceLock::from(executor);
            }
            Backend::Auto if memory >= MIN_MEMORY => {
                triangulator.optional = Some(OptionalGpu { options: gpu.clone(), memory: memory_of_gpu });
            }
            _ => {}
        }
        Ok(triangulator)
    }

    /// Opens the GPU that the configuration allows, on a thread of its own, if there seems to be one and `points` are so many that it is worth
    /// while for so many `threads`. Without one, the CPU does everything.
    pub fn prepare(&self, points: u64, threads: usize) {
        let Some(OptionalGpu { options, memory }) = &self.optional else { return };
        let is_large = points / threads.max(1) as u64 >= MIN_POINTS_PER_THREAD;
        if !Executor::is_wanted_by_test() && !Executor::is_likely() {
            return;
        }
        if !is_large && !Executor::is_wanted_by_test() {
            self.not_opened.get_or_init(|| {
                format!(
                    "it was not opened, because that takes longer than it saves where a thread has fewer than {} million points to do",
                    MIN_POINTS_PER_THREAD / 1_000_000
                )
            });
        } else if self.gpu.get().is_none()
            && let Ok(gpu) = Executor::start(options, GpuUse::Optional, *memory)
        {
            self.gpu.get_or_init(|| gpu);
        }
    }

    /// Returns the name of the GPU that helps, once it is open.
    pub fn gpu(&self) -> Option<&str> {
        self.gpu.get().and_then(Executor::adapter)
    }

    /// Returns what the GPU did so far, or why it was not opened; `None` without one.
    pub fn gpu_figures(&self) -> Option<GpuFigures> {
        let not_opened = || {
            let given_up = Some(self.not_opened.get()?.clone());
            Some(GpuFigures { given_up, ..GpuFigures::default() })
        };
        self.gpu.get().filter(|gpu| gpu.adapter().is_some()).map(Executor::figures).or_else(not_opened)
    }

    /// Returns the seconds that every step has taken on the GPU itself; nothing if the GPU has no timestamps.
    pub fn gpu_steps(&self) -> Vec<(&'static str, f64)> {
        self.gpu.get().map(Executor::step_seconds).unwrap_or_default()
    }

    /// Computes the canonical Delaunay triangulation of distinct `sites`.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if the process was asked to stop, [`Error::Broken`] if two sites coincide or one is out of reach.
    pub fn triangulate(&self, sites: &[Site]) -> Result<(HalfEdgeMesh, TriangulationCounts)> {
        let mut outcome = TriangulationCounts::default();
        if !self.pipeline {
            outcome.reference = 1;
            // `spade` takes quadratic time on some sites, and cannot be stopped.
            let sites = sites.to_vec();
            return Ok((unless_interrupted(move || reference::triangulate(&sites).map_err(failed))?, outcome));
        }
        match self.by_pipeline(sites) {
            Ok((mesh, counts)) => return Ok((mesh, TriangulationCounts { pipeline: 1, counts, ..outcome })),
            Err(Rejection::Crowded) => outcome.crowded = 1,
            Err(Rejection::NotAccepted(_)) => outcome.not_accepted = 1,
            Err(Rejection::TooFew | Rejection::TooMany | Rejection::OutOfReach) => outcome.small = 1,
        }
        Ok((divide_and_conquer::triangulate(sites).map_err(failed)?, outcome))
    }

    fn by_pipeline(&self, sites: &[Site]) -> std::result::Result<(HalfEdgeMesh, PipelineCounts), Rejection> {
        let Some(gpu) = self.gpu.get() else { return with_buffers(|buffers| voronoi::triangulate(sites, buffers)) };
        let asked = gpu.is_worth_asking(sites.len());
        let begun = own_cpu_seconds();
        // A leaf that waits has no buffers yet: meanwhile its thread may do many others.
        let reply = if asked { gpu.mesh(sites) } else { MeshReply::Unavailable };
        let done = with_buffers(|buffers| voronoi::triangulate_with(sites, &reply, buffers));
        let is_helped = done.as_ref().is_ok_and(|(_, counts)| counts.on_gpu > 0);
        match done.is_ok() {
            // It has cost more than a leaf alone.
            true if asked && !is_helped => gpu.note_in_vain(&reply),
            true => gpu.note(is_helped, sites.len(), own_cpu_seconds() - begun),
            // The leaf does not suit the pipeline, with a GPU or without.
            false => {}
        }
        done
    }
}

fn failed(error: delaunay::Error) -> Error {
    Error::of_triangulation(error.is_stopped(), error)
}
