//! What needs exact predicates, as lists of dispatches like those of `steps`; and a copy, to measure by.

use crate::on_device::buffer_id::BufferId::{Claims, Decisions, Flood, Labels, Marks, Records, Sites};
use crate::on_device::flip_marks::FlipMarks;
use crate::on_device::recording::{GpuCommand, GpuStep, Recording, ShaderProgram, line, program};
use delaunay::geometry::Site;

const DECIDE: ShaderProgram = program!("decide", uses "predicates", "decide", &[(1, Sites), (2, Decisions)]);
const COPY: ShaderProgram = program!("copy", "copy", &[(1, Labels), (2, Flood)]);
const CLAIM: ShaderProgram =
    program!("c4_flip", uses "predicates", "claim", &[(1, Records), (2, Sites), (3, Claims), (4, Marks)]);
const COMMIT: ShaderProgram =
    program!("c4_flip", uses "predicates", "commit", &[(4, Marks), (5, Records), (6, Claims)]);
const RELINK: ShaderProgram =
    program!("c4_flip", uses "predicates", "relink", &[(5, Records), (6, Claims), (7, Marks)]);

/// How many rounds of flips there are. What they leave is marked, and the CPU does it.
pub const FLIP_ROUNDS: u32 = 12;
// A claim has four bits for the number of the round.
const _: () = assert!(FLIP_ROUNDS < 16);

impl Recording {
    /// Decides about each four sites a, b, c, d: the orientation of abc, and whether d is in their circle. The numbers are those of
    /// [`crate::on_device::reference_kernels::predicates::decide`].
    pub fn decide(&mut self, quads: &[[Site; 4]]) {
        let (count, (workgroups, invocations)) = (quads.len() as u32, line(quads.len() as u32));
        self.reserve(Sites, 8 * u64::from(count));
        self.reserve(Decisions, u64::from(count));
        self.commands.push(GpuCommand::Upload(Sites, bytemuck::cast_slice(quads).to_vec()));
        if count > 0 {
            self.run(DECIDE, [count, invocations, 0, 0, 0], workgroups);
        }
    }

    /// Copies `bytes` bytes from the buffer of labels to that of the flood. They must be a multiple of 16.
    pub fn copy_labels(&mut self, bytes: u64) {
        let count = (bytes / 16) as u32;
        let (workgroups, invocations) = line(count);
        [Labels, Flood].into_iter().for_each(|id| self.reserve(id, bytes / 4));
        self.run_with_traffic(COPY, [count, invocations, 0, 0, 0], workgroups, 2 * bytes);
    }

    /// Uploads a mesh: eight numbers for each triangle, and the site of every vertex.
    pub fn upload_mesh(&mut self, records: &[u32], sites: &[Site]) {
        self.reserve(Records, records.len() as u64);
        self.reserve(Sites, 2 * sites.len() as u64);
        self.commands.push(GpuCommand::Upload(Records, records.to_vec()));
        self.commands.push(GpuCommand::Upload(Sites, bytemuck::cast_slice(sites).to_vec()));
    }

    /// Steps C2 and C4: does all rounds of flips on a mesh of `triangles` records. Number 3 of every record must be 0.
    pub fn flip(&mut self, triangles: u32) {
        self.start_flips(triangles);
        (1..=FLIP_ROUNDS).for_each(|round| self.flip_round(triangles, round));
    }

    /// Forgets all claims and marks, as is needed before the first round.
    pub fn start_flips(&mut self, triangles: u32) {
        self.commands.push(GpuCommand::Step(GpuStep::Flips));
        let marks = FlipMarks::of(triangles as usize).numbers() as u64;
        for (id, numbers) in [(Claims, u64::from(triangles)), (Marks, marks)] {
            self.reserve(id, numbers);
            self.commands.push(GpuCommand::Clear(id, 4 * numbers));
        }
    }

    /// Does round number `round`, from 1 to [`FLIP_ROUNDS`].
    pub fn flip_round(&mut self, triangles: u32, round: u32) {
        if triangles == 0 {
            return;
        }
        let (workgroups, invocations) = line(triangles);
        let words = FlipMarks::of(triangles as usize).words as u32;
        for (program, bytes) in [CLAIM, COMMIT, RELINK].into_iter().zip(flip_traffic(triangles, words, round)) {
            self.run_with_traffic(program, [triangles, round, words, invocations, 0], workgroups, bytes);
        }
    }
}

/// Returns the bytes that the three dispatches of a round stream: all records, the sites (half as many) and the claims in round 1, marks
/// in the others. What the dirty triangles of later rounds and the flips take depends on the mesh, and is not counted.
fn flip_traffic(triangles: u32, words: u32, round: u32) -> [u64; 3] {
    let (all, marks) = (u64::from(triangles), 4 * u64::from(words));
    if round == 1 { [36 * all + marks, 4 * all, 4 * all] } else { [2 * marks, marks, marks] }
}
