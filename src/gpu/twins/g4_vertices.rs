//! Step G4: the twin of `shaders/g4_vertices.wgsl`.

use crate::gpu::texture_size::TextureSize;

/// Returns how many triangles (0, 1 or 2) the corner to the northeast of each pixel makes. Corners on the frame are left out.
pub fn find_vertices(size: TextureSize, labels: &[u32]) -> Vec<u32> {
    let mut triangles = Vec::new();
    for y in 0..size.height - 1 {
        for x in 0..size.width - 1 {
            let [sw, se, ne, nw] = around(size, labels, x, y);
            let sides = [sw != se, se != ne, ne != nw, nw != sw].iter().filter(|&&differ| differ).count();
            triangles.push(match sides {
                _ if sw == ne || se == nw => 0,
                3 => 1,
                4 => 2,
                _ => 0,
            });
        }
    }
    triangles
}

/// Returns the labels of the four pixels around the corner, counterclockwise from the southwest.
pub(super) fn around(size: TextureSize, labels: &[u32], x: u32, y: u32) -> [u32; 4] {
    [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| labels[((y + j) * size.width + x + i) as usize])
}
