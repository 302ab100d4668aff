//! Streams point clouds of any size into one exact Delaunay triangulation and writes it as glTF terrain.
//!
//! Start reading at [`job::run()`], which lists the steps of a job in order; ARCHITECTURE.md follows the data.

#![warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable)]

pub mod cli;
pub mod completions;
pub mod config;
#[cfg(feature = "gpu")]
pub mod gpu_trial;
pub mod init;
pub mod manual;
pub mod sample;
mod shell_word;
pub mod submit;
#[cfg(feature = "viewer")]
pub mod view;

pub use breaklines;
pub use delaunay::{mesh, voronoi};
pub use delaunay_gpu as gpu;
pub use job;
pub use points as input;
pub use sys::{Error, Result, Warnings, error, interrupt, positional_io, say, shortage, terminal, threads};
pub use tiles as output;
pub use verify;

/// Sites, and the lattice that they lie on.
pub mod geometry {
    pub use ::lattice;
    pub use ::lattice::VertexDigest;
    pub use delaunay::geometry::*;
}

/// Triangulation of leaves.
pub mod triangulation {
    pub use delaunay::triangulation::*;
    pub use delaunay_gpu::triangulation_options as options;
    pub use delaunay_gpu::triangulator::Triangulator;
}
