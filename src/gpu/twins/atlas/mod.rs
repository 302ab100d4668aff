//! The steps on an atlas as plain loops; see [`crate::gpu::twins`].

mod corners;
mod g4_vertices;
mod g5_count;
mod g6_triangles;
mod give_back;

pub use corners::AtlasDiagram;
pub use g4_vertices::find_vertices;
pub use g5_count::count;
pub use g6_triangles::make_triangles;
pub use give_back::{MeshOnDevice, give_back};
