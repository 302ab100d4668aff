//! The steps of the paper as lists of dispatches: which shader, which buffers, which parameters, how many workgroups. Nothing
//! here touches the GPU; `engine` runs what is recorded.

use crate::gpu::buffer_id::BufferId;
use crate::gpu::options::VoronoiMethod;
use crate::gpu::prefix_sums::{self, BLOCK, PrefixSumLevel};
use crate::gpu::texture_size::TextureSize;

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

/// Names an entry point of a shader: its file, the files that it uses if any, the function, the bindings of buffers.
macro_rules! program {
    ($file:literal, $(uses $used:literal,)* $entry:literal, $bindings:expr) => {
        ShaderProgram {
            file: $file,
            source: concat!(
                $(include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/shaders/", $used, ".wgsl")),)*
                include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/shaders/", $file, ".wgsl"))
            ),
            entry: $entry,
            bindings: $bindings,
        }
    };
}
pub(super) use program;

use BufferId::{Counts, Flood, Islands, Labels, North, Pixels, South, Texture, Triangles, Vertices, Words, Workgroups};

const WRITE: ShaderProgram = program!("g1_write_sites", "write", &[(1, Pixels), (2, Texture)]);
const COLUMNS: ShaderProgram = program!("g2_voronoi_exact", "columns", &[(1, Texture), (2, Words)]);
const CARRY: ShaderProgram = program!("g2_voronoi_exact", "carry", &[(3, Words), (4, South), (5, North)]);
const ROWS: ShaderProgram = program!("g2_voronoi_exact", "rows", &[(3, Words), (6, South), (7, North), (8, Labels)]);
const SEED_LABELS: ShaderProgram = program!("g2_voronoi_jfa", "seed", &[(1, Texture), (3, Labels)]);
const SEED_FLOOD: ShaderProgram = program!("g2_voronoi_jfa", "seed", &[(1, Texture), (3, Flood)]);
const TO_FLOOD: ShaderProgram = program!("g2_voronoi_jfa", "flood", &[(2, Labels), (3, Flood)]);
const TO_LABELS: ShaderProgram = program!("g2_voronoi_jfa", "flood", &[(2, Flood), (3, Labels)]);
const FIND: ShaderProgram = program!("g3_islands", "find", &[(1, Labels), (2, Islands)]);
const ARRANGE: ShaderProgram = program!("g3_islands", "arrange", &[(2, Islands), (4, Workgroups)]);
const RECOLOUR: ShaderProgram = program!("g3_islands", "recolour", &[(2, Islands), (3, Labels)]);
const MARK: ShaderProgram = program!("g4_vertices", "mark", &[(1, Labels), (2, Vertices), (3, Counts)]);
const SUM: ShaderProgram = program!("g5_count", "sum", &[(1, Counts)]);
const SPREAD: ShaderProgram = program!("g5_count", "spread", &[(1, Counts)]);
const EMIT: ShaderProgram =
    program!("g6_triangles", "emit", &[(1, Labels), (2, Texture), (3, Vertices), (4, Counts), (5, Triangles)]);

/// The number of workgroups of a dispatch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WorkgroupCount {
    /// In x and y.
    Fixed([u32; 2]),
    /// The three numbers in [`BufferId::Workgroups`] that start at this position.
    Indirect(u64),
}

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
    /// Copy this many bytes from one buffer to another.
    Copy(BufferId, BufferId, u64),
    /// Run a program. The last number is how many bytes of the device's memory it reads and writes at the least; 0 if nobody has
    /// counted them.
    Run(ShaderProgram, [u32; 5], WorkgroupCount, u64),
}

/// Rows in a band of the exact transform.
const BAND: u32 = 32;
/// How often step G3 looks for islands. After two or three rounds none are left; the repair on the CPU handles any that remain
/// after the last round.
pub const ISLAND_ROUNDS: usize = 8;
/// The largest number of workgroups in one dimension.
pub(super) const MAX_WORKGROUPS: u32 = 65_535;
/// The most pixels that one dispatch of step G2 works on. A longer dispatch might be taken for a hang.
const MAX_PIXELS_PER_DISPATCH: u64 = 1 << 24;

/// Returns the row ranges, as (first, rows), of dispatches that must not take too long.
fn slabs(size: TextureSize) -> impl Iterator<Item = (u32, u32)> {
    let rows = (MAX_PIXELS_PER_DISPATCH / u64::from(size.width)).max(8) as u32;
    (0..size.height).step_by(rows as usize).map(move |first| (first, rows.min(size.height - first)))
}

/// Returns the workgroups of 32 x 8 invocations that cover `rows` rows of `width` invocations.
fn tiles(width: u32, rows: u32) -> WorkgroupCount {
    WorkgroupCount::Fixed([width.div_ceil(32), rows.div_ceil(8)])
}

/// Returns the workgroups of 64 that cover `count` invocations, and how many invocations a row of those workgroups has.
pub(super) fn line(count: u32) -> (WorkgroupCount, u32) {
    let groups = count.div_ceil(64);
    let x = groups.min(MAX_WORKGROUPS);
    (WorkgroupCount::Fixed([x, groups.div_ceil(x.max(1))]), 64 * x)
}

/// A list of commands.
#[derive(Clone, Debug, Default)]
pub struct Recording {
    /// The commands, in order.
    pub commands: Vec<GpuCommand>,
}

impl Recording {
    /// Records the steps that label a texture: G1, G2 and G3. Each site is given by its pixel (y << 16 | x). Step G3 follows
    /// the exact transform too, because exact diagrams have islands where thin regions fall apart into pixels.
    pub fn labels(size: TextureSize, pixels: Vec<u32>, voronoi: VoronoiMethod) -> Recording {
        let mut recording = Recording::default();
        recording.write_sites(size, pixels);
        recording.voronoi(size, voronoi);
        recording.remove_islands(size);
        recording
    }

    /// Records the steps that turn labels into at most `room` triangles: G4, G5 and G6.
    pub fn triangles(size: TextureSize, room: u32) -> Recording {
        let mut recording = Recording::default();
        recording.find_vertices(size);
        recording.count(size);
        recording.make_triangles(size, room);
        recording
    }

    pub(super) fn reserve(&mut self, id: BufferId, numbers: u64) {
        self.commands.push(GpuCommand::Reserve(id, 4 * numbers));
    }

    pub(super) fn run(&mut self, program: ShaderProgram, params: [u32; 5], workgroups: WorkgroupCount) {
        self.run_with_traffic(program, params, workgroups, 0);
    }

    /// Runs a program that reads and writes at least `bytes` bytes of the device's memory: each array that it streams, once.
    pub(super) fn run_with_traffic(
        &mut self,
        program: ShaderProgram,
        params: [u32; 5],
        workgroups: WorkgroupCount,
        bytes: u64,
    ) {
        self.commands.push(GpuCommand::Run(program, params, workgroups, bytes));
    }

    /// Returns how many bytes of the device's memory the commands read and write at the least, as far as they are counted.
    pub fn traffic(&self) -> u64 {
        let bytes = self.commands.iter().map(|command| match command {
            GpuCommand::Run(_, _, _, bytes) | GpuCommand::Clear(_, bytes) => *bytes,
            GpuCommand::Copy(_, _, bytes) => 2 * bytes,
            GpuCommand::Upload(_, numbers) => 4 * numbers.len() as u64,
            GpuCommand::Step(_) | GpuCommand::Reserve(..) => 0,
        });
        bytes.sum()
    }

    /// Returns the number of dispatches.
    pub fn dispatches(&self) -> usize {
        self.commands.iter().filter(|command| matches!(command, GpuCommand::Run(..))).count()
    }

    /// Step G1: writes the sites, each given by its pixel (y << 16 | x), into the texture.
    pub fn write_sites(&mut self, size: TextureSize, pixels: Vec<u32>) {
        let (sites, (workgroups, invocations)) = (pixels.len() as u32, line(pixels.len() as u32));
        self.commands.push(GpuCommand::Step(GpuStep::WriteSites));
        self.reserve(Pixels, u64::from(sites));
        self.reserve(Texture, size.pixels());
        self.commands.push(GpuCommand::Upload(Pixels, pixels));
        self.commands.push(GpuCommand::Clear(Texture, 4 * size.pixels()));
        if sites > 0 {
            self.run(WRITE, [size.width, size.height, sites, invocations, 0], workgroups);
        }
    }

    /// Step G2: computes the discrete Voronoi diagram.
    pub fn voronoi(&mut self, size: TextureSize, voronoi: VoronoiMethod) {
        self.commands.push(GpuCommand::Step(GpuStep::Voronoi));
        match voronoi {
            VoronoiMethod::Auto | VoronoiMethod::Exact => self.voronoi_exact(size),
            VoronoiMethod::Jfa => self.voronoi_jfa(size),
        }
    }

    fn voronoi_exact(&mut self, size: TextureSize) {
        let TextureSize { width, height } = size;
        let bands = height.div_ceil(BAND);
        for id in [Words, South, North] {
            self.reserve(id, u64::from(bands) * u64::from(width));
        }
        self.reserve(Labels, size.pixels());
        self.run(COLUMNS, [width, height, 0, 0, 0], WorkgroupCount::Fixed([width.div_ceil(64), bands]));
        self.run(CARRY, [width, height, 0, 0, 0], WorkgroupCount::Fixed([width.div_ceil(64), 1]));
        for [stride, known] in [[256, 0], [16, 256], [1, 16]] {
            for (first, rows) in slabs(size) {
                self.run(ROWS, [width, height, first, stride, known], tiles(width.div_ceil(stride), rows));
            }
        }
    }

    fn voronoi_jfa(&mut self, size: TextureSize) {
        let steps = size.jump_steps();
        self.reserve(Labels, size.pixels());
        self.reserve(Flood, size.pixels());
        let pass = |recording: &mut Recording, program, step| {
            for (first, rows) in slabs(size) {
                recording.run(program, [size.width, size.height, first, step, 0], tiles(size.width, rows));
            }
        };
        // Alternate between the two buffers so that the last pass writes to the labels.
        pass(self, if steps.len().is_multiple_of(2) { SEED_LABELS } else { SEED_FLOOD }, 0);
        for (i, &step) in steps.iter().enumerate() {
            pass(self, if (steps.len() - i).is_multiple_of(2) { TO_FLOOD } else { TO_LABELS }, step);
        }
    }

    /// Step G3: gives islands the colours around them.
    pub fn remove_islands(&mut self, size: TextureSize) {
        let TextureSize { width, height } = size;
        let all = [width.div_ceil(32), height.div_ceil(8)];
        let room = size.max_islands();
        self.commands.push(GpuCommand::Step(GpuStep::Islands));
        self.reserve(Islands, 1 + 2 * u64::from(room));
        self.reserve(Workgroups, 6);
        for round in 0..ISLAND_ROUNDS {
            let find = if round == 0 { WorkgroupCount::Fixed(all) } else { WorkgroupCount::Indirect(3) };
            let params = [width, height, room, all[0], all[1]];
            self.commands.push(GpuCommand::Clear(Islands, 4));
            self.run(FIND, params, find);
            self.run(ARRANGE, params, WorkgroupCount::Fixed([1, 1]));
            self.run(RECOLOUR, params, WorkgroupCount::Indirect(0));
        }
    }

    /// Step G4: finds the corners that are Voronoi vertices, and the number of triangles in each segment.
    pub fn find_vertices(&mut self, size: TextureSize) {
        let segments = size.all_segments();
        self.commands.push(GpuCommand::Step(GpuStep::Vertices));
        self.reserve(Vertices, 2 * u64::from(segments));
        let levels = prefix_sums::levels(segments);
        self.reserve(Counts, u64::from(levels.last().map_or(0, |level| level.end())));
        if segments > 0 {
            let (workgroups, invocations) = line(segments);
            self.run(MARK, [size.width, size.height, size.segments(), invocations, 0], workgroups);
        }
    }

    /// Step G5: computes the prefix sums of those numbers. The total is then at `position_of_total`.
    pub fn count(&mut self, size: TextureSize) {
        self.commands.push(GpuCommand::Step(GpuStep::Count));
        if size.all_segments() == 0 {
            let total = prefix_sums::position_of_total(size);
            self.commands.push(GpuCommand::Clear(Counts, 4 * u64::from(total + 1)));
            return;
        }
        let dispatch = |level: PrefixSumLevel, next: PrefixSumLevel, has_next: bool| {
            let (workgroups, invocations) = line(level.length.div_ceil(BLOCK));
            ([level.first, level.length, next.first, has_next as u32, invocations], workgroups)
        };
        let levels = prefix_sums::levels(size.all_segments());
        for pair in levels.windows(2) {
            let (params, workgroups) = dispatch(pair[0], pair[1], true);
            self.run(SUM, params, workgroups);
        }
        for (i, pair) in levels.windows(2).enumerate().rev() {
            let (params, workgroups) = dispatch(pair[0], pair[1], i + 2 < levels.len());
            self.run(SPREAD, params, workgroups);
        }
    }

    /// Step G6: makes at most `room` triangles.
    pub fn make_triangles(&mut self, size: TextureSize, room: u32) {
        self.commands.push(GpuCommand::Step(GpuStep::Triangles));
        self.reserve(Triangles, 3 * u64::from(room));
        if size.all_segments() > 0 {
            let (workgroups, invocations) = line(size.all_segments());
            self.run(EMIT, [size.width, size.height, size.segments(), invocations, room], workgroups);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_dispatch_is_larger_than_every_adapter_accepts() {
        let size = TextureSize { width: 16_384, height: 16_384 };
        let mut recording = Recording::default();
        recording.write_sites(size, vec![0; 1 << 26]);
        recording.voronoi(size, VoronoiMethod::Exact);
        recording.voronoi(size, VoronoiMethod::Jfa);
        recording.remove_islands(size);
        recording.find_vertices(size);
        recording.count(size);
        recording.make_triangles(size, 1 << 27);
        let fixed = recording.commands.iter().filter_map(|command| match command {
            GpuCommand::Run(_, _, WorkgroupCount::Fixed(groups), _) => Some(*groups),
            _ => None,
        });
        assert!(fixed.flatten().all(|groups| (1..=MAX_WORKGROUPS).contains(&groups)));
    }
}
