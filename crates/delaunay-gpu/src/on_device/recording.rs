//! The steps of the paper as lists of dispatches: which shader, which buffers, which parameters, how many workgroups. Nothing
//! here touches the GPU; `engine` runs what is recorded.

use crate::on_device::buffer_id::BufferId;

/// An entry point of a shader.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ShaderProgram {
    /// The file in `shaders/`, without its extension.
    pub file: &'static str,
    /// The text of the file, after those of the files that it uses.
    pub source: &'static str,
    /// The function.
    pub entry: &'static str,
    /// The bindings of buffers, besides the parameters at binding 0.
    pub bindings: &'static [(u32, BufferId)],
}

/// What tells a program from all others: where its text is in memory, and its function. Comparing the texts themselves would take longer.
pub(super) type ProgramKey = (usize, &'static str);

impl ShaderProgram {
    /// Returns the program's key.
    pub(super) fn key(&self) -> ProgramKey {
        (self.source.as_ptr() as usize, self.entry)
    }
}

/// Names an entry point of a shader: its file, the files that it uses if any, the function, the bindings of buffers.
macro_rules! program {
    ($file:literal, $(uses $used:literal,)* $entry:literal, $bindings:expr) => {
        ShaderProgram {
            file: $file,
            source: concat!(
                $(include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shaders/", $used, ".wgsl")),)*
                include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shaders/", $file, ".wgsl"))
            ),
            entry: $entry,
            bindings: $bindings,
        }
    };
}
pub(super) use program;

/// The steps of the paper that a GPU does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GpuStep {
    /// G1.
    WriteSites,
    /// G2.
    Voronoi,
    /// G3.
    Islands,
    /// G4.
    Vertices,
    /// G5.
    Count,
    /// G6.
    Triangles,
    /// C2 and most of C4.
    Flips,
    /// The gathering of what the CPU reads.
    GiveBack,
}

impl GpuStep {
    /// All steps in order.
    pub const ALL: [GpuStep; 8] = [
        GpuStep::WriteSites,
        GpuStep::Voronoi,
        GpuStep::Islands,
        GpuStep::Vertices,
        GpuStep::Count,
        GpuStep::Triangles,
        GpuStep::Flips,
        GpuStep::GiveBack,
    ];

    /// Returns the name that reports use.
    pub fn name(self) -> &'static str {
        match self {
            GpuStep::WriteSites => "G1 write sites",
            GpuStep::Voronoi => "G2 Voronoi",
            GpuStep::Islands => "G3 islands",
            GpuStep::Vertices => "G4 vertices",
            GpuStep::Count => "G5 count",
            GpuStep::Triangles => "G6 triangles",
            GpuStep::Flips => "C2, C4 flips",
            GpuStep::GiveBack => "return",
        }
    }
}

/// One thing for the GPU to do.
#[derive(Clone, Debug)]
pub enum GpuCommand {
    /// The commands that follow belong to this step.
    Step(GpuStep),
    /// Make sure that a buffer has this many bytes.
    Reserve(BufferId, u64),
    /// Write numbers to the start of a buffer.
    Upload(BufferId, Vec<u32>),
    /// Set this many bytes of a buffer to zero.
    Clear(BufferId, u64),
    /// Run a program with its parameters, on so many workgroups in x and y. The last number is how many bytes of the device's memory it
    /// reads and writes at the least; 0 if nobody has counted them.
    Run(ShaderProgram, [u32; 5], [u32; 2], u64),
}

/// The largest number of workgroups in one dimension.
pub(super) const MAX_WORKGROUPS: u32 = 65_535;

/// Returns the workgroups of 64 that cover `count` invocations, and how many invocations a row of those workgroups has.
pub(super) fn line(count: u32) -> ([u32; 2], u32) {
    let groups = count.div_ceil(64);
    let x = groups.min(MAX_WORKGROUPS);
    ([x, groups.div_ceil(x.max(1))], 64 * x)
}

/// A list of commands.
#[derive(Clone, Debug, Default)]
pub struct Recording {
    /// The commands, in order.
    pub commands: Vec<GpuCommand>,
}

impl Recording {
    pub(super) fn reserve(&mut self, id: BufferId, numbers: u64) {
        self.commands.push(GpuCommand::Reserve(id, 4 * numbers));
    }

    pub(super) fn run(&mut self, program: ShaderProgram, params: [u32; 5], workgroups: [u32; 2]) {
        self.run_with_traffic(program, params, workgroups, 0);
    }

    /// Runs a program that reads and writes at least `bytes` bytes of the device's memory: each array that it streams, once.
    pub(super) fn run_with_traffic(
        &mut self,
        program: ShaderProgram,
        params: [u32; 5],
        workgroups: [u32; 2],
        bytes: u64,
    ) {
        self.commands.push(GpuCommand::Run(program, params, workgroups, bytes));
    }

    /// Returns how many bytes of the device's memory the commands read and write at the least, as far as they are counted.
    pub fn traffic(&self) -> u64 {
        let bytes = self.commands.iter().map(|command| match command {
            GpuCommand::Run(_, _, _, bytes) | GpuCommand::Clear(_, bytes) => *bytes,
            GpuCommand::Upload(_, numbers) => 4 * numbers.len() as u64,
            GpuCommand::Step(_) | GpuCommand::Reserve(..) => 0,
        });
        bytes.sum()
    }

    /// Returns as many of those bytes as belong to `step`.
    pub fn traffic_of(&self, step: GpuStep) -> u64 {
        let mut current = None;
        let of_step = |command: &&GpuCommand| {
            if let GpuCommand::Step(next) = command {
                current = Some(*next);
            }
            current == Some(step)
        };
        Recording { commands: self.commands.iter().filter(of_step).cloned().collect() }.traffic()
    }

    /// Returns the number of dispatches.
    pub fn dispatches(&self) -> usize {
        self.commands.iter().filter(|command| matches!(command, GpuCommand::Run(..))).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_dispatch_is_larger_than_every_adapter_accepts() {
        for count in [1, 64, 65, 64 * MAX_WORKGROUPS, 64 * MAX_WORKGROUPS + 1, u32::MAX] {
            let (groups, across) = line(count);
            assert!(groups.iter().all(|groups| (1..=MAX_WORKGROUPS).contains(groups)), "{count}: {groups:?}");
            assert!(u64::from(across) * u64::from(groups[1]) >= u64::from(count));
        }
    }
}
