//! Step G5 in an atlas.

use crate::on_device::atlas::Atlas;
use crate::on_device::buffer_id::BufferId::BlockStarts;
use crate::on_device::recording::{GpuCommand, GpuStep, Recording, ShaderProgram, program};
use crate::on_device::steps::{bytes, grid};

const SUM: ShaderProgram = program!("atlas/g5_count", "sum", &[(1, BlockStarts)]);
const SPREAD: ShaderProgram = program!("atlas/g5_count", "spread", &[(1, BlockStarts)]);
/// Blocks that a workgroup adds up.
const GROUP: u32 = 1024;

impl Recording {
    /// Turns the number of triangles of each block into the number of those before it.
    pub fn atlas_count(&mut self, atlas: &Atlas) {
        self.commands.push(GpuCommand::Step(GpuStep::Count));
        let (workgroups, row) = grid(atlas.blocks.div_ceil(GROUP));
        for (program, numbers) in [(SUM, 1), (SPREAD, 2)] {
            let traffic = bytes(atlas.blocks, numbers);
            self.run_with_traffic(program, [atlas.blocks, row, 0, 0, 0], workgroups, traffic);
        }
    }
}
