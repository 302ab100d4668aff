//! What goes back to the CPU.

use crate::on_device::atlas::Atlas;
use crate::on_device::buffer_id::BufferId::{BlockStarts, Blocks, Flags, Leaves, Marks, Missing, Records, Returned};
use crate::on_device::flip_marks::FlipMarks;
use crate::on_device::mesh_steps::FLIP_ROUNDS;
use crate::on_device::recording::{GpuCommand, GpuStep, Recording, ShaderProgram, line, program};
use crate::on_device::returned::ReturnedLayout;
use crate::on_device::steps::{bytes, grid, table_bytes};

const GIVE_RECORDS: ShaderProgram =
    program!("atlas/give_back", uses "atlas/leaf", "give_records", &[(1, Leaves), (2, Records), (3, Returned)]);
const GIVE_BITS: ShaderProgram = program!(
    "atlas/give_back", uses "atlas/leaf", "give_bits",
    &[(1, Leaves), (4, Marks), (5, Missing), (6, Returned)]
);
const GIVE_STARTS: ShaderProgram = program!(
    "atlas/give_back", uses "atlas/leaf", "give_starts",
    &[(1, Leaves), (6, Returned), (7, Blocks), (8, BlockStarts), (9, Flags)]
);
/// Half records in a workgroup.
const HALVES: u32 = 128;

impl Recording {
    /// Gathers what the CPU reads in one buffer, as [`ReturnedLayout`] says.
    pub fn give_back(&mut self, atlas: &Atlas) {
        let layout = ReturnedLayout::of(atlas);
        let leaves = atlas.leaves.len() as u32;
        self.commands.push(GpuCommand::Step(GpuStep::GiveBack));
        self.reserve(Returned, layout.numbers() as u64);
        let (workgroups, row) = grid(2 * atlas.records / HALVES);
        let params = [2 * atlas.records, leaves, row, 0, 0];
        self.run_with_traffic(GIVE_RECORDS, params, workgroups, bytes(atlas.records, 16));

        let [record_words, site_words] = [layout.unfinished.len() as u32, layout.missing.len() as u32];
        let dirty = FlipMarks::of(atlas.records as usize).dirty(FLIP_ROUNDS + 1).start as u32;
        let (workgroups, invocations) = line(record_words.max(site_words));
        let params = [record_words, site_words, leaves, dirty, invocations];
        let traffic = bytes(record_words, 3) + bytes(site_words, 2);
        self.run_with_traffic(GIVE_BITS, params, workgroups, traffic);

        let (workgroups, invocations) = line(atlas.blocks.max(leaves));
        let params = [atlas.blocks, leaves, layout.leaves.start as u32, invocations, 0];
        self.run_with_traffic(GIVE_STARTS, params, workgroups, table_bytes(atlas) + bytes(atlas.blocks, 2));
    }
}
