//! Compares every step with its twin on the same input.

use crate::geometry::Site;
use crate::gpu::buffer_id::BufferId;
use crate::gpu::buffers::BufferSet;
use crate::gpu::engine::GpuEngine;
use crate::gpu::error::GpuError;
use crate::gpu::options::VoronoiMethod;
use crate::gpu::prefix_sums::position_of_total;
use crate::gpu::steps::Recording;
use crate::gpu::texture_size::TextureSize;
use crate::gpu::twins;
use serde::Serialize;

/// How often the exact predicates are compared.
const PREDICATE_QUADS: u32 = 100_000;

/// The comparison of one step with its twin.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct StepComparison {
    /// The step.
    pub step: &'static str,
    /// How many numbers were compared.
    pub numbers: u64,
    /// How many of them differ.
    pub differing: u64,
    /// The first difference: its position, the shader's number, the twin's number.
    pub first: Option<(u64, u32, u32)>,
}

impl StepComparison {
    pub(super) fn new(step: &'static str, shader: &[u32], twin: &[u32]) -> StepComparison {
        let pairs = || (0..).zip(shader).zip(twin).filter(|((_, a), b)| a != b).map(|((i, a), b)| (i, *a, *b));
        // Numbers that one of them lacks differ too.
        let differing = pairs().count() + shader.len().abs_diff(twin.len());
        StepComparison { step, numbers: twin.len() as u64, differing: differing as u64, first: pairs().next() }
    }
}

/// Runs all steps on the engine and as twins, for sites at `pixels` (each y << 16 | x) in a texture of `size`.
///
/// # Errors
/// [`GpuError`] of the device.
pub fn compare(
    engine: &mut GpuEngine,
    buffers: &mut BufferSet,
    size: TextureSize,
    pixels: &[u32],
) -> Result<Vec<StepComparison>, GpuError> {
    let mut comparisons = Vec::new();
    let texture = twins::write_sites(size, pixels);
    let mut jfa = twins::voronoi_jfa(size, &texture);
    let labels = |voronoi| {
        let mut recording = Recording::default();
        recording.write_sites(size, pixels.to_vec());
        recording.voronoi(size, voronoi);
        recording
    };
    engine.start(buffers, &labels(VoronoiMethod::Jfa))?;
    comparisons.push(StepComparison::new("G1", &engine.numbers(buffers, BufferId::Texture, size.pixels())?, &texture));
    comparisons.push(StepComparison::new("G2 jfa", &engine.numbers(buffers, BufferId::Labels, size.pixels())?, &jfa));

    twins::remove_islands(size, &mut jfa);
    let mut islands = Recording::default();
    islands.remove_islands(size);
    engine.start(buffers, &islands)?;
    comparisons.push(StepComparison::new("G3", &engine.numbers(buffers, BufferId::Labels, size.pixels())?, &jfa));

    let exact = twins::voronoi_exact(size, &texture);
    engine.start(buffers, &labels(VoronoiMethod::Exact))?;
    let labels = engine.numbers(buffers, BufferId::Labels, size.pixels())?;
    comparisons.push(StepComparison::new("G2 exact", &labels, &exact));
    comparisons.extend(compare_triangles(engine, buffers, size, &exact, &texture)?);
    Ok(comparisons)
}

/// Compares the exact predicates on sites near each other, many of them on one circle or line, and far apart.
///
/// # Errors
/// [`GpuError`] of the device.
pub(super) fn compare_predicates(engine: &mut GpuEngine, buffers: &mut BufferSet) -> Result<StepComparison, GpuError> {
    let quads: Vec<[Site; 4]> = (0..PREDICATE_QUADS).map(quad).collect();
    let mut recording = Recording::default();
    recording.decide(&quads);
    engine.start(buffers, &recording)?;
    let decisions = engine.numbers(buffers, BufferId::Decisions, u64::from(PREDICATE_QUADS))?;
    Ok(StepComparison::new("predicates", &decisions, &twins::predicates::decide(&quads)))
}

/// Returns quad number `i`. Every other one has coordinates from 0 to 7, the others up to 2^28.
fn quad(i: u32) -> [Site; 4] {
    let bits = if i.is_multiple_of(2) { 3 } else { 28 };
    let coordinate = |k: u32| {
        ((8 * i + k).wrapping_mul(0x9e37_79b1).rotate_left(15).wrapping_mul(0x85eb_ca77) >> (32 - bits)) as i32
    };
    [0, 2, 4, 6].map(|k| [coordinate(k), coordinate(k + 1)])
}

/// Compares steps G4 to G6, which start from the labels in the engine's buffers.
fn compare_triangles(
    engine: &mut GpuEngine,
    buffers: &mut BufferSet,
    size: TextureSize,
    labels: &[u32],
    texture: &[u32],
) -> Result<[StepComparison; 3], GpuError> {
    let corners = twins::find_vertices(size, labels);
    let (mut before, all) = twins::count(size, &corners);
    let triangles = twins::make_triangles(size, labels, texture);

    let mut recording = Recording::default();
    recording.find_vertices(size);
    engine.start(buffers, &recording)?;
    let vertices = engine.numbers(buffers, BufferId::Vertices, 2 * u64::from(size.all_segments()))?;
    let found = StepComparison::new("G4", &unpack(size, &vertices), &corners);

    let mut recording = Recording::default();
    recording.count(size);
    recording.make_triangles(size, all);
    engine.start(buffers, &recording)?;
    let mut counts = engine.numbers(buffers, BufferId::Counts, u64::from(position_of_total(size)) + 1)?;
    let shader_all = counts.last().copied().unwrap_or_default();
    counts.truncate(before.len());
    counts.push(shader_all);
    before.push(all);
    let counted = StepComparison::new("G5", &counts, &before);
    let made = engine.numbers(buffers, BufferId::Triangles, 3 * u64::from(all))?;
    Ok([found, counted, StepComparison::new("G6", &made, triangles.as_flattened())])
}

/// Returns the number of triangles of every corner, from the two words of every segment.
fn unpack(size: TextureSize, vertices: &[u32]) -> Vec<u32> {
    let corners = size.width as usize - 1;
    let segments = corners.div_ceil(32);
    let bit = |word: u32, x: usize| word >> (x % 32) & 1;
    let corner = |y: usize, x: usize| {
        let at = 2 * (y * segments + x / 32);
        bit(vertices[at], x) + bit(vertices[at + 1], x)
    };
    (0..size.height as usize - 1).flat_map(|y| (0..corners).map(move |x| (y, x))).map(|(y, x)| corner(y, x)).collect()
}
