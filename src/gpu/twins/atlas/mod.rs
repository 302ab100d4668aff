//! The twins of the shaders in `shaders/atlas/`.

mod corners;
mod g1_write_sites;
mod g2_voronoi;
mod g3_islands;
mod g4_vertices;
mod g5_count;
mod g6_triangles;
mod give_back;

pub use corners::AtlasDiagram;
pub use g1_write_sites::{WrittenSites, write_sites};
pub use g2_voronoi::voronoi;
pub use g3_islands::remove_islands;
pub use g4_vertices::find_vertices;
pub use g5_count::count;
pub use g6_triangles::make_triangles;
pub use give_back::{MeshOnDevice, give_back};

use crate::gpu::atlas::AtlasLeaf;
use crate::gpu::texture_size::TextureSize;

/// Returns the size of a leaf without its frame.
fn size_of(leaf: &AtlasLeaf) -> TextureSize {
    TextureSize { width: leaf.width, height: leaf.height }
}

/// Returns the numbers of a leaf's pixels in the atlas, row by row, without its frame.
fn pixels_of(leaf: &AtlasLeaf) -> impl Iterator<Item = usize> + use<> {
    let leaf = *leaf;
    (0..leaf.height).flat_map(move |y| (0..leaf.width).map(move |x| leaf.at(x, y) as usize))
}
