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

use crate::on_device::atlas::{Atlas, AtlasLeaf};
use crate::on_device::mesh_steps::FLIP_ROUNDS;
use crate::on_device::reference_kernels::c4_flip::{FlipState, flip_round};
use crate::on_device::texture_size::TextureSize;
use crate::options::VoronoiMethod;
use delaunay::geometry::Site;

/// Does all steps on the leaves of `atlas`, and returns what comes back to the CPU; see [`crate::on_device::returned`]. `sites` has those of all
/// leaves, each followed by one at infinity.
pub fn mesh(atlas: &Atlas, sites: &[Site], method: VoronoiMethod) -> Vec<u32> {
    let written = write_sites(atlas, sites);
    let mut labels = voronoi(atlas, &written.texture, method);
    let mut flags = remove_islands(atlas, &mut labels);
    let diagram = AtlasDiagram { atlas, labels: &labels, texture: &written.texture, sites };
    let (_, counts) = find_vertices(diagram);
    let starts = count(&counts);
    let mut flipped = FlipState::new(make_triangles(diagram, &mut flags));
    (1..=FLIP_ROUNDS).for_each(|round| flip_round(&mut flipped, sites, round));
    let (records, marks) = (&flipped.records, &flipped.marks);
    give_back(atlas, MeshOnDevice { records, marks, missing: &written.missing, starts: &starts, flags: &flags })
}

/// Returns the size of a leaf without its frame.
fn size_of(leaf: &AtlasLeaf) -> TextureSize {
    TextureSize { width: leaf.width, height: leaf.height }
}

/// Returns the numbers of a leaf's pixels in the atlas, row by row, without its frame.
fn pixels_of(leaf: &AtlasLeaf) -> impl Iterator<Item = usize> + use<> {
    let leaf = *leaf;
    (0..leaf.height).flat_map(move |y| (0..leaf.width).map(move |x| leaf.at(x, y) as usize))
}
