//! Sites in, the canonical Delaunay mesh out, with its proof.

#![warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable)]

pub mod geometry;
pub mod mesh;
pub mod triangulation;
pub mod voronoi;
