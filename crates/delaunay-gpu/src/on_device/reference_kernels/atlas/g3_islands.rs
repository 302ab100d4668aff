//! Step G3 on an atlas: the twin of `shaders/atlas/g3_islands.wgsl`. It looks at all pixels in every round, which gives the same.

use crate::on_device::atlas::{Atlas, AtlasLeaf, BLOCK_SIDE};
use crate::on_device::leaf_flags::ISLANDS_LEFT;
use crate::on_device::reference_kernels::atlas::{pixels_of, size_of};
use crate::on_device::reference_kernels::g3_islands::find;
use crate::on_device::steps::{ATLAS_ISLAND_ROUNDS, ISLANDS_PER_BLOCK};

/// Gives islands the colours around them, in several rounds. Returns the flags of the leaves.
pub fn remove_islands(atlas: &Atlas, labels: &mut [u32]) -> Vec<u32> {
    let flag = |leaf: &AtlasLeaf| {
        let mut own: Vec<u32> = pixels_of(leaf).map(|at| labels[at]).collect();
        for _ in 0..ATLAS_ISLAND_ROUNDS {
            for (pixel, colour) in first_of_each_block(leaf, find(size_of(leaf), &own)) {
                own[pixel] = colour;
            }
        }
        let has_islands = !find(size_of(leaf), &own).is_empty();
        pixels_of(leaf).zip(own).for_each(|(at, label)| labels[at] = label);
        if has_islands { ISLANDS_LEFT } else { 0 }
    };
    atlas.leaves.iter().map(flag).collect()
}

/// Returns those islands that are removed in one round.
fn first_of_each_block(leaf: &AtlasLeaf, islands: Vec<(usize, u32)>) -> Vec<(usize, u32)> {
    let mut counts = vec![0; (leaf.blocks_x() * leaf.blocks_y()) as usize];
    let is_first = |&(pixel, _): &(usize, u32)| {
        let [x, y] = [pixel as u32 % leaf.width, pixel as u32 / leaf.width].map(|c| c / BLOCK_SIDE);
        let count: &mut usize = &mut counts[(y * leaf.blocks_x() + x) as usize];
        *count += 1;
        *count <= ISLANDS_PER_BLOCK
    };
    islands.into_iter().filter(is_first).collect()
}
