//! Step G2 on one leaf, exact, for the twin of `shaders/atlas/g2_voronoi_exact.wgsl`.

use crate::on_device::reference_kernels::label::{NONE, key, own};
use crate::on_device::texture_size::TextureSize;

/// Returns the label of every pixel of `texture`: the pixel of its nearest site, least (d^2, x, y), or [`NONE`] if there is no
/// site.
pub fn voronoi_exact(size: TextureSize, texture: &[u32]) -> Vec<u32> {
    let in_column = nearest_in_columns(size, texture);
    let mut labels = Vec::with_capacity(texture.len());
    for y in 0..size.height {
        // Along a row, the columns of the labels never decrease.
        let mut low = 0;
        for x in 0..size.width {
            let row = &in_column[(y * size.width) as usize..][..size.width as usize];
            let label = nearest(row, x, y, low);
            low = if label == NONE { 0 } else { label & 0xffff };
            labels.push(label);
        }
    }
    labels
}

/// Returns the nearest site of each pixel's own column, as a label. Of two at the same distance, the southern one wins.
fn nearest_in_columns(size: TextureSize, texture: &[u32]) -> Vec<u32> {
    let mut nearest = vec![NONE; texture.len()];
    let at = |x: u32, y: u32| (y * size.width + x) as usize;
    for x in 0..size.width {
        let mut last = NONE;
        for y in 0..size.height {
            if texture[at(x, y)] != 0 {
                last = own(x, y);
            }
            nearest[at(x, y)] = last;
        }
        last = NONE;
        for y in (0..size.height).rev() {
            if texture[at(x, y)] != 0 {
                last = own(x, y);
            }
            let south = nearest[at(x, y)];
            if last != NONE && (south == NONE || key(x, y, last) < key(x, y, south)) {
                nearest[at(x, y)] = last;
            }
        }
    }
    nearest
}

/// Returns the nearest of the sites of all columns from `low` on.
fn nearest(row: &[u32], x: u32, y: u32, low: u32) -> u32 {
    let mut best = NONE;
    for column in low..row.len() as u32 {
        if best != NONE && column > x && (column - x).pow(2) > key(x, y, best).0 {
            break;
        }
        let label = row[column as usize];
        if label != NONE && (best == NONE || key(x, y, label) < key(x, y, best)) {
            best = label;
        }
    }
    best
}
