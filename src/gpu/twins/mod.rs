//! The steps as plain loops, one file for each shader: to be read beside it, and to be compared with it number by number.
//! Written to be plain, not fast; the steps as the CPU does them are in `voronoi`.

mod g1_write_sites;
mod g2_voronoi_exact;
mod g2_voronoi_jfa;
mod g3_islands;
mod g4_vertices;
mod g5_count;
mod g6_triangles;

pub use g1_write_sites::write_sites;
pub use g2_voronoi_exact::voronoi_exact;
pub use g2_voronoi_jfa::voronoi_jfa;
pub use g3_islands::remove_islands;
pub use g4_vertices::find_vertices;
pub use g5_count::count;
pub use g6_triangles::make_triangles;

/// A label that stands for "none".
pub const NONE: u32 = u32::MAX;

/// The square of the distance between a pixel and the site of `label`, then the site's x and y: what "nearest" compares.
fn key(x: u32, y: u32, label: u32) -> (u32, u32, u32) {
    let (site_x, site_y) = (label & 0xffff, label >> 16);
    (site_x.abs_diff(x).pow(2) + site_y.abs_diff(y).pow(2), site_x, site_y)
}

/// The label of the pixel itself.
fn own(x: u32, y: u32) -> u32 {
    y << 16 | x
}
