//! Compares every step with its twin on the same input.

use crate::on_device::buffer_id::BufferId;
use crate::on_device::buffers::BufferSet;
use crate::on_device::engine::GpuEngine;
use crate::on_device::error::GpuError;
use crate::on_device::filled_atlas::FilledAtlas;
use crate::on_device::mesh_steps::FLIP_ROUNDS;
use crate::on_device::recording::Recording;
use crate::on_device::reference_kernels::atlas;
use crate::on_device::reference_kernels::atlas::{AtlasDiagram, MeshOnDevice};
use crate::on_device::reference_kernels::c4_flip::{FlipState, flip_round};
use crate::on_device::reference_kernels::predicates::decide;
use crate::options::VoronoiMethod;
use delaunay::geometry::Site;
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

/// Runs steps on the engine, one after the other, and compares what they leave.
struct Comparer<'a> {
    engine: &'a mut GpuEngine,
    buffers: &'a mut BufferSet,
    comparisons: Vec<StepComparison>,
}

impl Comparer<'_> {
    /// Runs a step, and compares buffers with the numbers of its twin.
    fn compare(
        &mut self,
        step: &'static str,
        record: impl FnOnce(&mut Recording),
        expected: &[(BufferId, &[u32])],
    ) -> Result<(), GpuError> {
        let mut recording = Recording::default();
        record(&mut recording);
        self.engine.start(self.buffers, &recording)?;
        let (mut shader, mut twin) = (Vec::new(), Vec::new());
        for &(id, numbers) in expected {
            shader.extend(self.engine.numbers(self.buffers, id, numbers.len() as u64)?);
            twin.extend_from_slice(numbers);
        }
        self.comparisons.push(StepComparison::new(step, &shader, &twin));
        Ok(())
    }
}

/// Runs all steps on the leaves of an atlas, on the engine and as reference kernels.
///
/// # Errors
/// [`GpuError`] of the device.
pub fn compare(
    engine: &mut GpuEngine,
    buffers: &mut BufferSet,
    filled: &FilledAtlas,
) -> Result<Vec<StepComparison>, GpuError> {
    use BufferId::{BlockStarts, CornerRows, Flags, Labels, Marks, Missing, Records, Returned, Texture};
    let FilledAtlas { atlas, sites } = filled;
    let mut comparer = Comparer { engine, buffers, comparisons: Vec::new() };
    let written = atlas::write_sites(atlas, sites);
    let write = |r: &mut Recording| {
        r.upload_atlas(atlas, sites);
        r.write_atlas_sites(atlas);
    };
    comparer.compare("G1", write, &[(Texture, &written.texture), (Missing, &written.missing)])?;

    let (mut labels, mut flags) = (Vec::new(), Vec::new());
    for (method, g2, g3) in [(VoronoiMethod::Jfa, "G2 jfa", "G3 jfa"), (VoronoiMethod::Exact, "G2 exact", "G3 exact")] {
        labels = atlas::voronoi(atlas, &written.texture, method);
        let find = |r: &mut Recording| {
            // No leaf is flagged at first.
            r.upload_atlas(atlas, sites);
            r.atlas_voronoi(atlas, method);
        };
        comparer.compare(g2, find, &[(Labels, &labels)])?;
        flags = atlas::remove_islands(atlas, &mut labels);
        comparer.compare(g3, |r| r.remove_atlas_islands(atlas), &[(Labels, &labels), (Flags, &flags)])?;
    }

    let diagram = AtlasDiagram { atlas, labels: &labels, texture: &written.texture, sites };
    let (rows, counts) = atlas::find_vertices(diagram);
    comparer.compare("G4", |r| r.atlas_vertices(atlas), &[(CornerRows, &rows), (BlockStarts, &counts)])?;
    let starts = atlas::count(&counts);
    comparer.compare("G5", |r| r.atlas_count(atlas), &[(BlockStarts, &starts)])?;
    let records = atlas::make_triangles(diagram, &mut flags);
    comparer.compare("G6", |r| r.atlas_triangles(atlas), &[(Records, &records), (Flags, &flags)])?;

    let mut flipped = FlipState::new(records);
    (1..=FLIP_ROUNDS).for_each(|round| flip_round(&mut flipped, sites, round));
    let FlipState { records, marks, .. } = &flipped;
    comparer.compare("C2, C4", |r| r.flip(atlas.records), &[(Records, records), (Marks, marks)])?;
    let mesh = MeshOnDevice { records, marks, missing: &written.missing, starts: &starts, flags: &flags };
    let returned = atlas::give_back(atlas, mesh);
    comparer.compare("return", |r| r.give_back(atlas), &[(Returned, &returned)])?;
    Ok(comparer.comparisons)
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
    Ok(StepComparison::new("predicates", &decisions, &decide(&quads)))
}

/// Returns quad number `i`. Every other one has coordinates from 0 to 7, the others up to 2^28.
fn quad(i: u32) -> [Site; 4] {
    let bits = if i.is_multiple_of(2) { 3 } else { 28 };
    let coordinate = |k: u32| {
        ((8 * i + k).wrapping_mul(0x9e37_79b1).rotate_left(15).wrapping_mul(0x85eb_ca77) >> (32 - bits)) as i32
    };
    [0, 2, 4, 6].map(|k| [coordinate(k), coordinate(k + 1)])
}
