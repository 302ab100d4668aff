//! Step G5, beside `shaders/g5_count.wgsl`.

use crate::gpu::steps::Size;

/// The number of triangles before every segment of 32 corners, given those of every corner; and the number of all.
pub fn count(size: Size, triangles: &[u32]) -> (Vec<u32>, u32) {
    let (mut before, mut total) = (Vec::new(), 0);
    for row in triangles.chunks((size.width as usize - 1).max(1)) {
        for segment in row.chunks(32) {
            before.push(total);
            total += segment.iter().sum::<u32>();
        }
    }
    (before, total)
}
