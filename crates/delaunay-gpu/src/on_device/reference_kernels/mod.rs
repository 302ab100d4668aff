//! The steps as plain loops, one file for each shader. Read them side by side with the shaders: their numbers are compared with
//! those of the shaders one by one. They are written to be plain, not fast. The module `voronoi` of the crate `delaunay` has the steps that the CPU runs in jobs.

pub mod atlas;
pub mod c4_flip;
mod g2_voronoi_exact;
mod g2_voronoi_jfa;
mod g3_islands;
mod label;
pub mod predicates;

pub use g2_voronoi_exact::voronoi_exact;
pub use g2_voronoi_jfa::voronoi_jfa;
pub use label::NONE;
