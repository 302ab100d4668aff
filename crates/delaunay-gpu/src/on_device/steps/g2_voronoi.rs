//! Step G2 on an atlas.

use crate::on_device::atlas::{Atlas, AtlasLeaf, BLOCK_SIDE};
use crate::on_device::buffer_id::BufferId::{Blocks, Flood, Labels, Leaves, North, South, Texture, Words};
use crate::on_device::recording::{GpuCommand, GpuStep, Recording, ShaderProgram, line, program};
use crate::on_device::steps::{BLOCK_BYTES, WORDS_BYTES, grid, pixel_bytes};
use crate::on_device::texture_size::TextureSize;
use crate::options::VoronoiMethod;

const COLUMNS: ShaderProgram = program!(
    "atlas/g2_voronoi_exact", uses "atlas/leaf", uses "atlas/block", "columns",
    &[(1, Leaves), (2, Blocks), (3, Texture), (4, Words)]
);
const CARRY: ShaderProgram = program!(
    "atlas/g2_voronoi_exact", uses "atlas/leaf", uses "atlas/block", "carry",
    &[(1, Leaves), (2, Blocks), (5, Words), (6, South), (7, North)]
);
const SOME: ShaderProgram = program!(
    "atlas/g2_voronoi_exact", uses "atlas/leaf", uses "atlas/block", "some",
    &[(1, Leaves), (2, Blocks), (5, Words), (8, South), (9, North), (10, Labels)]
);
const ALL: ShaderProgram = program!(
    "atlas/g2_voronoi_exact", uses "atlas/leaf", uses "atlas/block", "all_pixels",
    &[(1, Leaves), (2, Blocks), (5, Words), (8, South), (9, North), (10, Labels)]
);
const SEED_LABELS: ShaderProgram = program!(
    "atlas/g2_voronoi_jfa", uses "atlas/leaf", uses "atlas/block", "seed",
    &[(1, Leaves), (2, Blocks), (3, Texture), (5, Labels)]
);
const SEED_FLOOD: ShaderProgram = program!(
    "atlas/g2_voronoi_jfa", uses "atlas/leaf", uses "atlas/block", "seed",
    &[(1, Leaves), (2, Blocks), (3, Texture), (5, Flood)]
);
const TO_FLOOD: ShaderProgram = program!(
    "atlas/g2_voronoi_jfa", uses "atlas/leaf", uses "atlas/block", "flood",
    &[(1, Leaves), (2, Blocks), (4, Labels), (5, Flood)]
);
const TO_LABELS: ShaderProgram = program!(
    "atlas/g2_voronoi_jfa", uses "atlas/leaf", uses "atlas/block", "flood",
    &[(1, Leaves), (2, Blocks), (4, Flood), (5, Labels)]
);

/// The distances between the pixels that the dispatches of the exact transform label before the last one labels all.
const STRIDES: [u32; 2] = [256, 16];

impl Recording {
    /// Step G2: computes the discrete Voronoi diagrams of all leaves. The frame has the label of infinity.
    pub fn atlas_voronoi(&mut self, atlas: &Atlas, voronoi: VoronoiMethod) {
        self.commands.push(GpuCommand::Step(GpuStep::Voronoi));
        self.reserve(Labels, u64::from(atlas.pixels));
        match voronoi {
            _ if atlas.blocks == 0 => {}
            VoronoiMethod::Auto | VoronoiMethod::Exact => self.atlas_voronoi_exact(atlas),
            VoronoiMethod::Jfa => self.atlas_voronoi_jfa(atlas),
        }
    }

    fn atlas_voronoi_exact(&mut self, atlas: &Atlas) {
        let (blocks, all) = (u64::from(atlas.blocks), pixel_bytes(atlas));
        for id in [Words, South, North] {
            self.reserve(id, u64::from(BLOCK_SIDE) * blocks);
        }
        let (workgroups, across) = grid(atlas.blocks);
        let bytes = all + (WORDS_BYTES + BLOCK_BYTES) * blocks;
        self.run_with_traffic(COLUMNS, [atlas.blocks, across, 0, 0, 0], workgroups, bytes);
        let (workgroups, across) = line(BLOCK_SIDE * atlas.blocks);
        // The words are read twice: southwards they may have left the cache.
        let bytes = (4 * WORDS_BYTES + BLOCK_BYTES) * blocks;
        self.run_with_traffic(CARRY, [atlas.blocks, across, 0, 0, 0], workgroups, bytes);
        let mut known = 0;
        for stride in STRIDES {
            let (workgroups, across) = line(BLOCK_SIDE * (BLOCK_SIDE / stride).max(1) * atlas.blocks);
            let bytes = all / u64::from(stride) + (3 * WORDS_BYTES + BLOCK_BYTES) * blocks;
            self.run_with_traffic(SOME, [atlas.blocks, across, stride, known, 0], workgroups, bytes);
            known = stride;
        }
        let (workgroups, across) = grid(4 * atlas.blocks);
        let bytes = all + all / u64::from(known) + (3 * WORDS_BYTES + BLOCK_BYTES) * blocks;
        self.run_with_traffic(ALL, [atlas.blocks, across, 1, known, 0], workgroups, bytes);
    }

    fn atlas_voronoi_jfa(&mut self, atlas: &Atlas) {
        self.reserve(Flood, u64::from(atlas.pixels));
        let jumps = &largest(atlas).jump_steps()[1..];
        let (workgroups, across) = grid(4 * atlas.blocks);
        let bytes = 2 * pixel_bytes(atlas) + BLOCK_BYTES * u64::from(atlas.blocks);
        let mut pass = |program, step| {
            self.run_with_traffic(program, [atlas.blocks, across, step, 0, 0], workgroups, bytes);
        };
        // Alternate between the two buffers so that the last pass writes to the labels.
        pass(if jumps.len().is_multiple_of(2) { SEED_LABELS } else { SEED_FLOOD }, 1);
        for (i, &step) in jumps.iter().enumerate() {
            pass(if (jumps.len() - i).is_multiple_of(2) { TO_FLOOD } else { TO_LABELS }, step);
        }
    }
}

/// Returns the greatest width and the greatest height of a leaf.
fn largest(atlas: &Atlas) -> TextureSize {
    let most = |side: fn(&AtlasLeaf) -> u32| atlas.leaves.iter().map(side).max().unwrap_or(1);
    TextureSize { width: most(|leaf| leaf.width), height: most(|leaf| leaf.height) }
}
