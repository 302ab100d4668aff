//! Step G4 in an atlas.

use crate::on_device::atlas::Atlas;
use crate::on_device::buffer_id::BufferId::{BlockStarts, Blocks, CornerRows, Labels, Leaves, Sites, Texture};
use crate::on_device::recording::{GpuCommand, GpuStep, Recording, ShaderProgram, program};
use crate::on_device::steps::{ROW_BYTES, ROWS, bytes, grid, table_bytes};

const FIND: ShaderProgram = program!(
    "atlas/g4_vertices", uses "predicates", uses "atlas/leaf", uses "atlas/tile", "find",
    &[(1, Blocks), (2, Leaves), (3, Labels), (4, Texture), (5, Sites), (6, CornerRows), (7, BlockStarts)]
);

impl Recording {
    /// Finds the Voronoi vertices, and counts the triangles of each block.
    pub fn atlas_vertices(&mut self, atlas: &Atlas) {
        self.commands.push(GpuCommand::Step(GpuStep::Vertices));
        self.reserve(CornerRows, 4 * ROWS * u64::from(atlas.blocks));
        self.reserve(BlockStarts, 1 + u64::from(atlas.blocks) + u64::from(atlas.blocks.div_ceil(1024)));
        let (workgroups, row) = grid(atlas.blocks);
        let rows = ROW_BYTES * u64::from(atlas.blocks);
        let traffic = bytes(atlas.pixels, 1) + rows + bytes(atlas.blocks, 1) + table_bytes(atlas);
        self.run_with_traffic(FIND, [atlas.blocks, row, 0, 0, 0], workgroups, traffic);
    }
}
