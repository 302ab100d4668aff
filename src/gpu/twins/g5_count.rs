//! Step G5: the twin of `shaders/g5_count.wgsl`.

use crate::gpu::texture_size::TextureSize;

/// Takes the number of triangles of every corner; returns how many lie before each segment of 32 corners, and the total.
pub fn count(size: TextureSize, triangles: &[u32]) -> (Vec<u32>, u32) {
    let (mut before, mut total) = (Vec::new(), 0);
    for row in triangles.chunks((size.width as usize - 1).max(1)) {
        for segment in row.chunks(32) {
            before.push(total);
            total += segment.iter().sum::<u32>();
        }
    }
    (before, total)
}
