//! Step G6 in an atlas.

use crate::on_device::atlas::Atlas;
use crate::on_device::buffer_id::BufferId::{BlockStarts, Blocks, CornerRows, Flags, Labels, Leaves, Records, Texture};
use crate::on_device::recording::{GpuCommand, GpuStep, Recording, ShaderProgram, program};
use crate::on_device::steps::{ROW_BYTES, bytes, grid, table_bytes};

const MAKE: ShaderProgram = program!(
    "atlas/g6_triangles", uses "atlas/leaf", uses "atlas/tile", "make",
    &[
        (1, Blocks),
        (2, Leaves),
        (3, Labels),
        (4, Texture),
        (5, CornerRows),
        (6, BlockStarts),
        (7, Records),
        (8, Flags),
    ]
);

impl Recording {
    /// Makes the linked triangles of all leaves.
    pub fn atlas_triangles(&mut self, atlas: &Atlas) {
        self.commands.push(GpuCommand::Step(GpuStep::Triangles));
        self.reserve(Records, 8 * u64::from(atlas.records));
        let (workgroups, row) = grid(atlas.blocks);
        let rows = ROW_BYTES * u64::from(atlas.blocks);
        let traffic =
            bytes(atlas.pixels, 2) + rows + bytes(atlas.blocks, 1) + table_bytes(atlas) + bytes(atlas.records, 8);
        self.run_with_traffic(MAKE, [atlas.blocks, row, 0, 0, 0], workgroups, traffic);
    }
}
