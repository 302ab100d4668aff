//! The steps as plain loops, one file for each shader. Read them side by side with the shaders: their numbers are compared with
//! those of the shaders one by one. They are written to be plain, not fast. Room `voronoi` has the steps that the CPU runs in jobs.

pub mod atlas;
pub mod c4_flip;
mod g1_write_sites;
mod g2_voronoi_exact;
mod g2_voronoi_jfa;
mod g3_islands;
mod g4_vertices;
mod g5_count;
mod g6_triangles;
mod label;
pub mod predicates;

pub use g1_write_sites::write_sites;
pub use g2_voronoi_exact::voronoi_exact;
pub use g2_voronoi_jfa::voronoi_jfa;
pub use g3_islands::remove_islands;
pub use g4_vertices::find_vertices;
pub use g5_count::count;
pub use g6_triangles::make_triangles;
pub use label::NONE;
