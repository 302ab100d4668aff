//! Step G6: the twin of `shaders/g6_triangles.wgsl`.

use crate::gpu::texture_size::TextureSize;
use crate::gpu::twins::g4_vertices::{around, find_vertices};

/// Returns the triangles of all corners, row by row, as triples of site numbers.
pub fn make_triangles(size: TextureSize, labels: &[u32], texture: &[u32]) -> Vec<[u32; 3]> {
    let site = |label: u32| !texture[((label >> 16) * size.width + (label & 0xffff)) as usize];
    let mut triangles = Vec::new();
    let counts = find_vertices(size, labels);
    let corners = (0..size.height - 1).flat_map(|y| (0..size.width - 1).map(move |x| (x, y)));
    for ((x, y), count) in corners.zip(counts) {
        let mut colours = around(size, labels, x, y).to_vec();
        colours.dedup();
        if colours.len() > 3 && colours[3] == colours[0] {
            colours.pop();
        }
        for i in 0..count as usize {
            triangles.push([colours[0], colours[i + 1], colours[i + 2]].map(site));
        }
    }
    triangles
}
