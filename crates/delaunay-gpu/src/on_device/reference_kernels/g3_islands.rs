//! Step G3 on one leaf, for the twin of `shaders/atlas/g3_islands.wgsl`.

use crate::on_device::reference_kernels::label::{NONE, key};
use crate::on_device::texture_size::TextureSize;

/// Returns the pixels that have lost touch with their site, each with its new label.
pub(super) fn find(size: TextureSize, labels: &[u32]) -> Vec<(usize, u32)> {
    let mut islands = Vec::new();
    for y in 0..size.height {
        for x in 0..size.width {
            let pixel = (y * size.width + x) as usize;
            let label = labels[pixel];
            if label != NONE && is_island(size, labels, x, y, label) {
                let colour = other_colour(size, labels, x, y, label);
                islands.extend(colour.map(|colour| (pixel, colour)));
            }
        }
    }
    islands
}

fn is_island(size: TextureSize, labels: &[u32], x: u32, y: u32, label: u32) -> bool {
    let towards = |from: u32, to: u32| (i64::from(to) - i64::from(from)).signum();
    let (dx, dy) = (towards(x, label & 0xffff), towards(y, label >> 16));
    // If the site lies straight along an axis, only one of the three is a different pixel than (x, y).
    let neighbours = [(dx, 0), (dx, dy), (0, dy)].into_iter().filter(|&offset| offset != (0, 0));
    let at = |(i, j): (i64, i64)| labels[((i64::from(y) + j) * i64::from(size.width) + i64::from(x) + i) as usize];
    (dx, dy) != (0, 0) && neighbours.map(at).all(|other| other != label)
}

/// Returns the nearest site among the labels of the neighbours, other than `label`.
fn other_colour(size: TextureSize, labels: &[u32], x: u32, y: u32, label: u32) -> Option<u32> {
    let rows = y.saturating_sub(1)..(y + 2).min(size.height);
    let columns = x.saturating_sub(1)..(x + 2).min(size.width);
    let around = rows.flat_map(|q| columns.clone().map(move |p| (q * size.width + p) as usize));
    around.map(|at| labels[at]).filter(|&l| l != label && l != NONE).min_by_key(|&l| key(x, y, l))
}
