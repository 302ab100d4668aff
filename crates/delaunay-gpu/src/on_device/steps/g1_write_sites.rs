//! Step G1 on an atlas.

use crate::on_device::atlas::Atlas;
use crate::on_device::buffer_id::BufferId::{Leaves, Losers, Missing, Sites, Texture};
use crate::on_device::recording::{GpuCommand, GpuStep, Recording, ShaderProgram, line, program};
use crate::on_device::steps::pixel_bytes;

const WRITE: ShaderProgram =
    program!("atlas/g1_write_sites", uses "atlas/leaf", "write", &[(1, Leaves), (2, Sites), (3, Texture)]);
const CLAIM_EAST: ShaderProgram = program!(
    "atlas/g1_write_sites", uses "atlas/leaf", "claim_east", &[(1, Leaves), (2, Sites), (3, Texture), (4, Losers)]
);
const CLAIM_WEST: ShaderProgram = program!(
    "atlas/g1_write_sites", uses "atlas/leaf", "claim_west",
    &[(1, Leaves), (2, Sites), (3, Texture), (5, Losers), (6, Missing)]
);
const SETTLE: ShaderProgram = program!(
    "atlas/g1_write_sites", uses "atlas/leaf", "settle",
    &[(1, Leaves), (2, Sites), (3, Texture), (5, Losers), (6, Missing)]
);

impl Recording {
    /// Step G1: writes the sites of all leaves into the texture, and marks those that are missing.
    pub fn write_atlas_sites(&mut self, atlas: &Atlas) {
        let (vertices, words) = (atlas.vertices, u64::from(atlas.vertices.div_ceil(32)));
        self.commands.push(GpuCommand::Step(GpuStep::WriteSites));
        self.reserve(Texture, u64::from(atlas.pixels));
        self.reserve(Losers, words);
        self.reserve(Missing, words);
        self.commands.push(GpuCommand::Clear(Texture, pixel_bytes(atlas)));
        if vertices == 0 {
            return;
        }
        let (workgroups, invocations) = line(vertices);
        let params = [vertices, atlas.leaves.len() as u32, invocations, 0, 0];
        // A site has two coordinates; its pixel is read, and in `write` written too. How many losers there are is not known here.
        let (each, bits) = (u64::from(vertices), 4 * words);
        for (program, bytes) in
            [(WRITE, 16 * each), (CLAIM_EAST, 12 * each + bits), (CLAIM_WEST, 2 * bits), (SETTLE, 3 * bits)]
        {
            self.run_with_traffic(program, params, workgroups, bytes);
        }
    }
}
