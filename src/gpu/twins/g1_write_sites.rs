//! Step G1, beside `shaders/g1_write_sites.wgsl`.

use crate::gpu::steps::Size;

/// The texture of the sites in `pixels` (each y << 16 | x): per pixel the complement of the number of the first site there, or 0.
pub fn write_sites(size: Size, pixels: &[u32]) -> Vec<u32> {
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
