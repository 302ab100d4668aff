//! What shaders do with exact predicates, as lists of dispatches like those of `steps`.

use crate::geometry::Site;
use crate::gpu::buffer_id::BufferId::{Decisions, Sites};
use crate::gpu::steps::{GpuCommand, Recording, ShaderProgram, line, program};

const DECIDE: ShaderProgram = program!("decide", uses "predicates", "decide", &[(1, Sites), (2, Decisions)]);

impl Recording {
    /// Decides about each four sites a, b, c, d: the orientation of abc, and whether d is in their circle. The numbers are those of
    /// [`crate::gpu::twins::predicates::decide`].
    pub fn decide(&mut self, quads: &[[Site; 4]]) {
        let (count, (workgroups, invocations)) = (quads.len() as u32, line(quads.len() as u32));
        self.reserve(Sites, 8 * u64::from(count));
        self.reserve(Decisions, u64::from(count));
        self.commands.push(GpuCommand::Upload(Sites, bytemuck::cast_slice(quads).to_vec()));
        if count > 0 {
            self.run(DECIDE, [count, invocations, 0, 0, 0], workgroups);
        }
    }
}
