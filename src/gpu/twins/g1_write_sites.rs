//! Step G1: the twin of `shaders/g1_write_sites.wgsl`.

use crate::gpu::texture_size::TextureSize;

/// Returns the texture of the sites at `pixels` (each y << 16 | x). A pixel holds the complement of the number of its first site,
/// or 0.
pub fn write_sites(size: TextureSize, pixels: &[u32]) -> Vec<u32> {
    let mut texture = vec![0; size.pixels() as usize];
    for (site, pixel) in (0u32..).zip(pixels) {
        let (x, y) = (pixel & 0xffff, pixel >> 16);
        if x < size.width && y < size.height {
            let winner = &mut texture[(y * size.width + x) as usize];
            *winner = (*winner).max(!site);
        }
    }
    texture
}
