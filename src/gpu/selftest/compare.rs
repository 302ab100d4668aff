//! Every step against its twin on the same input.

use crate::gpu::buffers::{Name, Set};
use crate::gpu::machine::Machine;
use crate::gpu::options::VoronoiMethod;
use crate::gpu::steps::{Recording, Size, total};
use crate::gpu::{Fault, twins};
use serde::Serialize;

/// What came of one step.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Comparison {
    /// The step.
    pub step: &'static str,
    /// Numbers that were compared.
    pub numbers: u64,
    /// Those that differ.
    pub differing: u64,
    /// The first of them: position, the shader's number, the twin's.
    pub first: Option<(u64, u32, u32)>,
}

impl Comparison {
    fn new(step: &'static str, shader: &[u32], twin: &[u32]) -> Comparison {
        let pairs = || (0..).zip(shader).zip(twin).filter(|((_, a), b)| a != b).map(|((i, a), b)| (i, *a, *b));
        // What one of them lacks differs too.
        let differing = pairs().count() + shader.len().abs_diff(twin.len());
        Comparison { step, numbers: twin.len() as u64, differing: differing as u64, first: pairs().next() }
    }
}

/// Runs all steps for sites at `pixels` (each y << 16 | x) in a texture of `size`, on the machine and as twins.
///
/// # Errors
/// [`Fault`] of the device.
pub fn compare(machine: &mut Machine, set: &mut Set, size: Size, pixels: &[u32]) -> Result<Vec<Comparison>, Fault> {
    let mut comparisons = Vec::new();
    let texture = twins::write_sites(size, pixels);
    let mut jfa = twins::voronoi_jfa(size, &texture);
    let labels = |voronoi| {
        let mut recording = Recording::default();
        recording.write_sites(size, pixels.to_vec());
        recording.voronoi(size, voronoi);
        recording
    };
    machine.start(set, &labels(VoronoiMethod::Jfa))?;
    comparisons.push(Comparison::new("G1", &machine.numbers(set, Name::Texture, size.pixels())?, &texture));
    comparisons.push(Comparison::new("G2 jfa", &machine.numbers(set, Name::Labels, size.pixels())?, &jfa));

    twins::remove_islands(size, &mut jfa);
    let mut islands = Recording::default();
    islands.remove_islands(size);
    machine.start(set, &islands)?;
    comparisons.push(Comparison::new("G3", &machine.numbers(set, Name::Labels, size.pixels())?, &jfa));

    let exact = twins::voronoi_exact(size, &texture);
    machine.start(set, &labels(VoronoiMethod::Exact))?;
    comparisons.push(Comparison::new("G2 exact", &machine.numbers(set, Name::Labels, size.pixels())?, &exact));
    comparisons.extend(compare_triangles(machine, set, size, &exact, &texture)?);
    Ok(comparisons)
}

/// Steps G4 to G6, from the labels that the machine has.
fn compare_triangles(
    machine: &mut Machine,
    set: &mut Set,
    size: Size,
    labels: &[u32],
    texture: &[u32],
) -> Result<[Comparison; 3], Fault> {
    let corners = twins::find_vertices(size, labels);
    let (mut before, all) = twins::count(size, &corners);
    let triangles = twins::make_triangles(size, labels, texture);

    let mut recording = Recording::default();
    recording.find_vertices(size);
    machine.start(set, &recording)?;
    let vertices = machine.numbers(set, Name::Vertices, 2 * u64::from(size.all_segments()))?;
    let found = Comparison::new("G4", &unpack(size, &vertices), &corners);

    let mut recording = Recording::default();
    recording.count(size);
    recording.make_triangles(size, all);
    machine.start(set, &recording)?;
    let mut counts = machine.numbers(set, Name::Counts, u64::from(total(size)) + 1)?;
    let shader_all = counts.last().copied().unwrap_or_default();
    counts.truncate(before.len());
    counts.push(shader_all);
    before.push(all);
    let counted = Comparison::new("G5", &counts, &before);
    let made = machine.numbers(set, Name::Triangles, 3 * u64::from(all))?;
    Ok([found, counted, Comparison::new("G6", &made, triangles.as_flattened())])
}

/// Triangles of every corner, out of the two words of every segment.
fn unpack(size: Size, vertices: &[u32]) -> Vec<u32> {
    let corners = size.width as usize - 1;
    let segments = corners.div_ceil(32);
    let bit = |word: u32, x: usize| word >> (x % 32) & 1;
    let corner = |y: usize, x: usize| {
        let at = 2 * (y * segments + x / 32);
        bit(vertices[at], x) + bit(vertices[at + 1], x)
    };
    (0..size.height as usize - 1).flat_map(|y| (0..corners).map(move |x| (y, x))).map(|(y, x)| corner(y, x)).collect()
}
