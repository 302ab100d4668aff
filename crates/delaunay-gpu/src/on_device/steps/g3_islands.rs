//! Step G3 on an atlas.

use crate::on_device::atlas::{Atlas, BLOCK_SIDE};
use crate::on_device::buffer_id::BufferId;
use crate::on_device::buffer_id::BufferId::{Blocks, Flags, Labels, Leaves, North, South, Words};
use crate::on_device::recording::{GpuCommand, GpuStep, Recording, ShaderProgram, program};
use crate::on_device::steps::{BLOCK_BYTES, WORDS_BYTES, grid, pixel_bytes};

/// How often step G3 looks for islands and removes them. A leaf that has some left then goes to the CPU.
pub const ATLAS_ISLAND_ROUNDS: u32 = 4;
/// How many islands of a block a round removes: the first ones, row by row.
pub(crate) const ISLANDS_PER_BLOCK: usize = 32;

/// The bits of the islands take turns in two buffers.
const BITS: [BufferId; 2] = [Words, South];
const FIND_ALL: ShaderProgram = program!(
    "atlas/g3_islands", uses "atlas/leaf", uses "atlas/block", "find_all",
    &[(1, Leaves), (2, Blocks), (3, Labels), (5, BITS[0]), (6, North)]
);
const FIND_NEAR: [ShaderProgram; 2] = [
    program!(
        "atlas/g3_islands", uses "atlas/leaf", uses "atlas/block", "find_near",
        &[(1, Leaves), (2, Blocks), (3, Labels), (4, BITS[1]), (5, BITS[0]), (6, North)]
    ),
    program!(
        "atlas/g3_islands", uses "atlas/leaf", uses "atlas/block", "find_near",
        &[(1, Leaves), (2, Blocks), (3, Labels), (4, BITS[0]), (5, BITS[1]), (6, North)]
    ),
];
const RECOLOUR: [ShaderProgram; 2] = [
    program!(
        "atlas/g3_islands", uses "atlas/leaf", uses "atlas/block", "recolour",
        &[(1, Leaves), (2, Blocks), (4, BITS[0]), (7, North), (8, Labels)]
    ),
    program!(
        "atlas/g3_islands", uses "atlas/leaf", uses "atlas/block", "recolour",
        &[(1, Leaves), (2, Blocks), (4, BITS[1]), (7, North), (8, Labels)]
    ),
];
const FIND_LEFT: ShaderProgram = program!(
    "atlas/g3_islands", uses "atlas/leaf", uses "atlas/block", "find_left",
    &[(1, Leaves), (2, Blocks), (3, Labels), (4, BITS[(ATLAS_ISLAND_ROUNDS as usize + 1) % 2]), (9, Flags)]
);

impl Recording {
    /// Step G3: gives islands the colours around them, and flags the leaves that have islands left.
    pub fn remove_atlas_islands(&mut self, atlas: &Atlas) {
        let blocks = u64::from(atlas.blocks);
        self.commands.push(GpuCommand::Step(GpuStep::Islands));
        for id in [Words, South, North] {
            self.reserve(id, u64::from(BLOCK_SIDE) * blocks);
        }
        if atlas.blocks == 0 {
            return;
        }
        let (per_block, across) = grid(atlas.blocks);
        let (per_two, across_two) = grid(atlas.blocks.div_ceil(2));
        let bits = WORDS_BYTES * blocks;
        // How many islands there are is not known here.
        let all = pixel_bytes(atlas) + bits + BLOCK_BYTES * blocks;
        for round in 0..ATLAS_ISLAND_ROUNDS as usize {
            let (find, bytes) =
                if round == 0 { (FIND_ALL, all) } else { (FIND_NEAR[round % 2], 2 * bits + BLOCK_BYTES * blocks) };
            self.run_with_traffic(find, [atlas.blocks, across, 0, 0, 0], per_block, bytes);
            self.run_with_traffic(RECOLOUR[round % 2], [atlas.blocks, across_two, 0, 0, 0], per_two, bits);
        }
        self.run_with_traffic(FIND_LEFT, [atlas.blocks, across, 0, 0, 0], per_block, bits + BLOCK_BYTES * blocks);
    }
}
