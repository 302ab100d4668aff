//! Step G2 on one leaf, 1+JFA, for the twin of `shaders/atlas/g2_voronoi_jfa.wgsl`.

use crate::on_device::reference_kernels::label::{NONE, key, own};
use crate::on_device::texture_size::TextureSize;

/// Returns the label that jump flooding finds for every pixel of `texture`.
pub fn voronoi_jfa(size: TextureSize, texture: &[u32]) -> Vec<u32> {
    let pixels = (0..size.height).flat_map(|y| (0..size.width).map(move |x| own(x, y)));
    let mut labels: Vec<u32> = pixels.zip(texture).map(|(pixel, &site)| if site == 0 { NONE } else { pixel }).collect();
    for step in size.jump_steps() {
        labels = flood(size, &labels, i64::from(step));
    }
    labels
}

fn flood(size: TextureSize, before: &[u32], step: i64) -> Vec<u32> {
    let mut after = Vec::with_capacity(before.len());
    for y in 0..size.height {
        for x in 0..size.width {
            let mut label = NONE;
            for j in -1..=1 {
                for i in -1..=1 {
                    let (p, q) = (i64::from(x) + step * i, i64::from(y) + step * j);
                    if p < 0 || q < 0 || p >= i64::from(size.width) || q >= i64::from(size.height) {
                        continue;
                    }
                    let other = before[(q * i64::from(size.width) + p) as usize];
                    if other != NONE && (label == NONE || key(x, y, other) < key(x, y, label)) {
                        label = other;
                    }
                }
            }
            after.push(label);
        }
    }
    after
}
