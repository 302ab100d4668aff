//! The steps of the paper as lists of dispatches: which shader, which buffers, which parameters, how many workgroups. Nothing
//! here touches the GPU; `machine` carries out what is recorded.

use crate::gpu::buffers::Name;
use crate::gpu::options::VoronoiMethod;

/// A shader's entry point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Program {
    /// The file in `shaders/`, without its ending.
    pub file: &'static str,
    /// Its text.
    pub source: &'static str,
    /// The function.
    pub entry: &'static str,
    /// What is bound, beside the parameters at binding 0.
    pub bindings: &'static [(u32, Name)],
}

macro_rules! program {
    ($file:literal, $entry:literal, $bindings:expr) => {
        Program {
            file: $file,
            source: include_str!(concat!("../../shaders/", $file, ".wgsl")),
            entry: $entry,
            bindings: $bindings,
        }
    };
}

use Name::{Counts, Flood, Islands, Labels, North, Pixels, South, Texture, Triangles, Vertices, Words, Workgroups};

const WRITE: Program = program!("g1_write_sites", "write", &[(1, Pixels), (2, Texture)]);
const COLUMNS: Program = program!("g2_voronoi_exact", "columns", &[(1, Texture), (2, Words)]);
const CARRY: Program = program!("g2_voronoi_exact", "carry", &[(3, Words), (4, South), (5, North)]);
const ROWS: Program = program!("g2_voronoi_exact", "rows", &[(3, Words), (6, South), (7, North), (8, Labels)]);
const SEED_LABELS: Program = program!("g2_voronoi_jfa", "seed", &[(1, Texture), (3, Labels)]);
const SEED_FLOOD: Program = program!("g2_voronoi_jfa", "seed", &[(1, Texture), (3, Flood)]);
const TO_FLOOD: Program = program!("g2_voronoi_jfa", "flood", &[(2, Labels), (3, Flood)]);
const TO_LABELS: Program = program!("g2_voronoi_jfa", "flood", &[(2, Flood), (3, Labels)]);
const FIND: Program = program!("g3_islands", "find", &[(1, Labels), (2, Islands)]);
const ARRANGE: Program = program!("g3_islands", "arrange", &[(2, Islands), (4, Workgroups)]);
const RECOLOUR: Program = program!("g3_islands", "recolour", &[(2, Islands), (3, Labels)]);
const MARK: Program = program!("g4_vertices", "mark", &[(1, Labels), (2, Vertices), (3, Counts)]);
const SUM: Program = program!("g5_count", "sum", &[(1, Counts)]);
const SPREAD: Program = program!("g5_count", "spread", &[(1, Counts)]);
const EMIT: Program =
    program!("g6_triangles", "emit", &[(1, Labels), (2, Texture), (3, Vertices), (4, Counts), (5, Triangles)]);

/// How many workgroups a dispatch has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Groups {
    /// In x and y.
    Fixed([u32; 2]),
    /// As three numbers in [`Name::Workgroups`] say, from this one on.
    Indirect(u64),
}

/// The steps of the paper that a GPU does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
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
}

impl Step {
    /// In order.
    pub const ALL: [Step; 6] =
        [Step::WriteSites, Step::Voronoi, Step::Islands, Step::Vertices, Step::Count, Step::Triangles];

    /// As reports name it.
    pub fn name(self) -> &'static str {
        match self {
            Step::WriteSites => "G1 write sites",
            Step::Voronoi => "G2 Voronoi",
            Step::Islands => "G3 islands",
            Step::Vertices => "G4 vertices",
            Step::Count => "G5 count",
            Step::Triangles => "G6 triangles",
        }
    }
}

/// One thing for the GPU to do.
#[derive(Clone, Debug)]
pub enum Command {
    /// What follows belongs to this step.
    Step(Step),
    /// Make sure that a buffer has this many bytes.
    Need(Name, u64),
    /// Write numbers to the start of a buffer.
    Upload(Name, Vec<u32>),
    /// Set this many bytes of a buffer to zero.
    Clear(Name, u64),
    /// Copy this many bytes from one buffer to another.
    Copy(Name, Name, u64),
    /// Run a program.
    Run(Program, [u32; 5], Groups),
}

/// The width and height of a texture in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

/// Rows in a band of the exact transform.
const BAND: u32 = 32;
/// Corners in a segment.
const SEGMENT: u32 = 32;
/// Numbers that the prefix sums add up at a time.
const BLOCK: u32 = 64;
/// How often islands are looked for. Two or three rounds find none any more; what is left after the last is seen by the repair.
pub const ROUNDS: usize = 8;
/// Workgroups in one dimension.
const MOST_GROUPS: u32 = 65_535;
/// Pixels that one dispatch of step G2 works on, at the most, so that none takes long enough to be taken for a hang.
const PIXELS_AT_ONCE: u64 = 1 << 24;

impl Size {
    /// Pixels in the texture.
    pub fn pixels(self) -> u64 {
        u64::from(self.width) * u64::from(self.height)
    }

    /// Segments in a row of corners.
    fn segments(self) -> u32 {
        (self.width - 1).div_ceil(SEGMENT)
    }

    /// Segments in all rows of corners.
    pub fn all_segments(self) -> u32 {
        self.segments() * (self.height - 1)
    }

    /// Room for islands: an eighth of the pixels.
    pub fn islands(self) -> u32 {
        (self.pixels() / 8) as u32
    }

    /// Row ranges for dispatches that must not be too long, as (first, rows).
    fn slabs(self) -> impl Iterator<Item = (u32, u32)> {
        let rows = (PIXELS_AT_ONCE / u64::from(self.width)).max(8) as u32;
        (0..self.height).step_by(rows as usize).map(move |first| (first, rows.min(self.height - first)))
    }

    /// Workgroups of 32 x 8 for `rows` rows of `width` invocations.
    fn tiles(width: u32, rows: u32) -> Groups {
        Groups::Fixed([width.div_ceil(32), rows.div_ceil(8)])
    }
}

/// Workgroups of 64 for `count` invocations; and how many invocations a row of them has.
fn line(count: u32) -> (Groups, u32) {
    let groups = count.div_ceil(64);
    let x = groups.min(MOST_GROUPS);
    (Groups::Fixed([x, groups.div_ceil(x.max(1))]), 64 * x)
}

/// What is recorded.
#[derive(Clone, Debug, Default)]
pub struct Recording {
    /// In order.
    pub commands: Vec<Command>,
}

impl Recording {
    fn need(&mut self, name: Name, numbers: u64) {
        self.commands.push(Command::Need(name, 4 * numbers));
    }

    fn run(&mut self, program: Program, params: [u32; 5], groups: Groups) {
        self.commands.push(Command::Run(program, params, groups));
    }

    /// Step G1: the sites, each by its pixel (y << 16 | x), into the texture.
    pub fn write_sites(&mut self, size: Size, pixels: Vec<u32>) {
        let (sites, (groups, invocations)) = (pixels.len() as u32, line(pixels.len() as u32));
        self.commands.push(Command::Step(Step::WriteSites));
        self.need(Pixels, u64::from(sites));
        self.need(Texture, size.pixels());
        self.commands.push(Command::Upload(Pixels, pixels));
        self.commands.push(Command::Clear(Texture, 4 * size.pixels()));
        if sites > 0 {
            self.run(WRITE, [size.width, size.height, sites, invocations, 0], groups);
        }
    }

    /// Step G2: the discrete VoronoiMethod diagram.
    pub fn voronoi(&mut self, size: Size, voronoi: VoronoiMethod) {
        self.commands.push(Command::Step(Step::Voronoi));
        match voronoi {
            VoronoiMethod::Auto | VoronoiMethod::Exact => self.voronoi_exact(size),
            VoronoiMethod::Jfa => self.voronoi_jfa(size),
        }
    }

    fn voronoi_exact(&mut self, size: Size) {
        let Size { width, height } = size;
        let bands = height.div_ceil(BAND);
        for name in [Words, South, North] {
            self.need(name, u64::from(bands) * u64::from(width));
        }
        self.need(Labels, size.pixels());
        self.run(COLUMNS, [width, height, 0, 0, 0], Groups::Fixed([width.div_ceil(64), bands]));
        self.run(CARRY, [width, height, 0, 0, 0], Groups::Fixed([width.div_ceil(64), 1]));
        for [stride, known] in [[256, 0], [16, 256], [1, 16]] {
            for (first, rows) in size.slabs() {
                self.run(ROWS, [width, height, first, stride, known], Size::tiles(width.div_ceil(stride), rows));
            }
        }
    }

    fn voronoi_jfa(&mut self, size: Size) {
        let steps = jfa_steps(size);
        self.need(Labels, size.pixels());
        self.need(Flood, size.pixels());
        let pass = |recording: &mut Recording, program, step| {
            for (first, rows) in size.slabs() {
                recording.run(program, [size.width, size.height, first, step, 0], Size::tiles(size.width, rows));
            }
        };
        // To and fro, so that the last pass ends in the labels.
        pass(self, if steps.len().is_multiple_of(2) { SEED_LABELS } else { SEED_FLOOD }, 0);
        for (i, &step) in steps.iter().enumerate() {
            pass(self, if (steps.len() - i).is_multiple_of(2) { TO_FLOOD } else { TO_LABELS }, step);
        }
    }

    /// Step G3: islands take the colours around them.
    pub fn remove_islands(&mut self, size: Size) {
        let Size { width, height } = size;
        let all = [width.div_ceil(32), height.div_ceil(8)];
        let room = size.islands();
        self.commands.push(Command::Step(Step::Islands));
        self.need(Islands, 1 + 2 * u64::from(room));
        self.need(Workgroups, 6);
        for round in 0..ROUNDS {
            let groups = if round == 0 { Groups::Fixed(all) } else { Groups::Indirect(3) };
            let params = [width, height, room, all[0], all[1]];
            self.commands.push(Command::Clear(Islands, 4));
            self.run(FIND, params, groups);
            self.run(ARRANGE, params, Groups::Fixed([1, 1]));
            self.run(RECOLOUR, params, Groups::Indirect(0));
        }
    }

    /// Step G4: which corners are VoronoiMethod vertices, and how many triangles there are in each segment.
    pub fn find_vertices(&mut self, size: Size) {
        let segments = size.all_segments();
        self.commands.push(Command::Step(Step::Vertices));
        self.need(Vertices, 2 * u64::from(segments));
        self.need(Counts, u64::from(levels(segments).last().map_or(0, |level| level.first + level.length)));
        if segments > 0 {
            let (groups, invocations) = line(segments);
            self.run(MARK, [size.width, size.height, size.segments(), invocations, 0], groups);
        }
    }

    /// Step G5: prefix sums of those numbers. The total is then at [`total`].
    pub fn count(&mut self, size: Size) {
        let levels = levels(size.all_segments());
        self.commands.push(Command::Step(Step::Count));
        if size.all_segments() == 0 {
            self.commands.push(Command::Clear(Counts, 4 * u64::from(levels[levels.len() - 1].first + 1)));
            return;
        }
        let dispatch = |level: Level, next: Level, has_next: bool| {
            let (groups, invocations) = line(level.length.div_ceil(BLOCK));
            ([level.first, level.length, next.first, has_next as u32, invocations], groups)
        };
        for pair in levels.windows(2) {
            let (params, groups) = dispatch(pair[0], pair[1], true);
            self.run(SUM, params, groups);
        }
        for (i, pair) in levels.windows(2).enumerate().rev() {
            let (params, groups) = dispatch(pair[0], pair[1], i + 2 < levels.len());
            self.run(SPREAD, params, groups);
        }
    }

    /// Step G6: the triangles, `room` of them at the most.
    pub fn make_triangles(&mut self, size: Size, room: u32) {
        self.commands.push(Command::Step(Step::Triangles));
        self.need(Triangles, 3 * u64::from(room));
        if size.all_segments() > 0 {
            let (groups, invocations) = line(size.all_segments());
            self.run(EMIT, [size.width, size.height, size.segments(), invocations, room], groups);
        }
    }
}

/// The steps of 1+JFA: 1, then half the side (as a power of two), a quarter, and so on down to 1.
pub fn jfa_steps(size: Size) -> Vec<u32> {
    let half = size.width.max(size.height).next_power_of_two() / 2;
    std::iter::once(1).chain((0..32).rev().map(|i| 1 << i).filter(|&step| step <= half)).collect()
}

/// A level of the prefix sums.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Level {
    first: u32,
    length: u32,
}

/// The levels over `count` numbers, the last of which is the total; at least two.
fn levels(count: u32) -> Vec<Level> {
    let mut levels = vec![Level { first: 0, length: count }];
    loop {
        let last = levels[levels.len() - 1];
        levels.push(Level { first: last.first + last.length, length: last.length.div_ceil(BLOCK).max(1) });
        if levels[levels.len() - 1].length == 1 {
            return levels;
        }
    }
}

/// Where in [`Name::Counts`] the number of all triangles is.
pub fn total(size: Size) -> u32 {
    levels(size.all_segments()).last().map_or(0, |level| level.first)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_end_with_the_total() {
        assert_eq!(levels(0), [Level { first: 0, length: 0 }, Level { first: 0, length: 1 }]);
        assert_eq!(levels(1), [Level { first: 0, length: 1 }, Level { first: 1, length: 1 }]);
        let lengths: Vec<_> = levels(1_000_000).iter().map(|level| level.length).collect();
        assert_eq!(lengths, [1_000_000, 15_625, 245, 4, 1]);
    }

    #[test]
    fn jump_flooding_starts_and_ends_with_one() {
        assert_eq!(jfa_steps(Size { width: 1, height: 1 }), [1]);
        assert_eq!(jfa_steps(Size { width: 17, height: 3 }), [1, 16, 8, 4, 2, 1]);
        assert_eq!(jfa_steps(Size { width: 16, height: 16 }), [1, 8, 4, 2, 1]);
    }

    #[test]
    fn no_dispatch_is_larger_than_an_adapter_must_take() {
        let size = Size { width: 16_384, height: 16_384 };
        let mut recording = Recording::default();
        recording.write_sites(size, vec![0; 1 << 26]);
        recording.voronoi(size, VoronoiMethod::Exact);
        recording.voronoi(size, VoronoiMethod::Jfa);
        recording.remove_islands(size);
        recording.find_vertices(size);
        recording.count(size);
        recording.make_triangles(size, 1 << 27);
        let fixed = recording.commands.iter().filter_map(|command| match command {
            Command::Run(_, _, Groups::Fixed(groups)) => Some(*groups),
            _ => None,
        });
        assert!(fixed.flatten().all(|groups| (1..=MOST_GROUPS).contains(&groups)));
    }
}
