//! Exact, canonical Delaunay triangulation of points in the plane.
//!
//! [`Delaunay`] takes points, and gives triangles, neighbours and the hull. All decisions are exact. Where more than three points lie on one
//! circle, one rule decides by their coordinates alone ([`geometry::predicates`]), so the triangulation does not depend on their order.
//!
//! The other modules are the parts of it: the discrete-Voronoi pipeline of Rong, Tan, Cao and Stephanus ([`voronoi`], "Computing
//! Two-dimensional Delaunay Triangulation Using Graphics Hardware", I3D 2008) on the CPU, which proves each mesh before it returns one, and
//! divide and conquer ([`triangulation::divide_and_conquer`]) for what does not suit it.

#![warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable)]

mod delaunay;
pub mod error;
pub mod geometry;
pub mod host;
pub mod mesh;
pub mod triangulation;
pub mod voronoi;

pub use delaunay::Delaunay;
pub use error::{Error, Result};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
