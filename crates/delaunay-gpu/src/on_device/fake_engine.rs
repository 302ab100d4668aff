//! An engine for tests (`sys::fault`) that is no GPU: it makes meshes on its own thread as workers do, and answers late, or never. `GDT_GPU=slow:n` is
//! n milliseconds late for every atlas, and `GDT_GPU=silent` never answers. The shaders' twins would take so much processor time that
//! jobs were slow for that reason.

use crate::on_device::error::GpuError;
use crate::on_device::filled_atlas::FilledAtlas;
use crate::on_device::landed::Landed;
use crate::on_device::leaf_flags::TOO_MANY_TRIANGLES;
use crate::on_device::mesh_engine::MeshEngine;
use crate::on_device::returned::ReturnedLayout;
use crate::on_device::timestamps::StepNanoseconds;
use delaunay::geometry::Site;
use delaunay::mesh::half_edge::HalfEdgeMesh;
use delaunay::mesh::index::HalfEdgeIndex;
use delaunay::voronoi::{PipelineBuffers, triangulate};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};
use sys::fault;

/// See the module.
pub(super) struct FakeEngine {
    /// How late it is; `None` if it never answers.
    delay: Option<Duration>,
}

/// Tells whether a test wants this engine.
pub(super) fn is_wanted() -> bool {
    FakeEngine::from_environment().is_some()
}

impl FakeEngine {
    /// Returns the engine that a test wants, if it does.
    pub(super) fn from_environment() -> Option<FakeEngine> {
        let wanted = fault::variable("GDT_GPU")?;
        if wanted == "silent" {
            return Some(FakeEngine { delay: None });
        }
        let milliseconds = wanted.strip_prefix("slow:")?.parse().ok()?;
        Some(FakeEngine { delay: Some(Duration::from_millis(milliseconds)) })
    }
}

impl MeshEngine for FakeEngine {
    /// The atlas, and when it started.
    type Pending = (FilledAtlas, Instant);

    fn start(&mut self, _: usize, filled: &FilledAtlas) -> Result<Self::Pending, GpuError> {
        Ok((filled.clone(), Instant::now()))
    }

    fn is_finished(&mut self, (_, start): &Self::Pending) -> bool {
        self.delay.is_some_and(|delay| start.elapsed() >= delay)
    }

    fn finish(&mut self, _: usize, (filled, start): Self::Pending) -> Result<Landed, GpuError> {
        let Some(delay) = self.delay else {
            loop {
                std::thread::park();
            }
        };
        std::thread::sleep(delay.saturating_sub(start.elapsed()));
        Ok(Landed { numbers: Arc::new(numbers_back(&filled)), may_stay: true, times: StepNanoseconds::default() })
    }

    fn free(&mut self, _: usize) {}

    fn reopen(&mut self) -> Result<(), GpuError> {
        Ok(())
    }
}

/// Returns what would come back from a device. Leaves that do not suit the pipeline are flagged.
fn numbers_back(filled: &FilledAtlas) -> Vec<u32> {
    let layout = ReturnedLayout::of(&filled.atlas);
    let mut numbers = vec![0; layout.numbers()];
    let mut buffers = PipelineBuffers::default();
    for (i, leaf) in filled.atlas.leaves.iter().enumerate() {
        let sites = &filled.sites[leaf.first_site as usize..][..leaf.sites as usize];
        let [triangles, flags] = &mut numbers[layout.leaves.start + 2 * i..][..2] else { return numbers };
        let Some(records) = records_of(sites, &mut buffers) else {
            *flags = TOO_MANY_TRIANGLES;
            continue;
        };
        *triangles = records.len() as u32;
        let first = 8 * leaf.first_record as usize;
        numbers[first..first + 8 * records.len()].copy_from_slice(records.as_flattened());
    }
    numbers
}

/// Returns the records of a leaf's triangles, those at the vertex at infinity last.
fn records_of(sites: &[Site], buffers: &mut PipelineBuffers) -> Option<Vec<[u32; 8]>> {
    let (mesh, _) = triangulate(sites, buffers).ok()?;
    let record = |h: HalfEdgeIndex| (8 * h.triangle() + h.corner()) as u32;
    let twin = |h| Some(mesh.twin(h)).filter(|&twin| twin != HalfEdgeIndex::HULL).map_or(u32::MAX, record);
    let finite = mesh.corners().iter().enumerate().map(|(t, &[a, b, c])| {
        let [ab, bc, ca] = HalfEdgeIndex::of_triangle(t).map(twin);
        [a, b, c, 0, ab, bc, ca, 0]
    });
    let mut records: Vec<[u32; 8]> = finite.collect();
    let ghosts = ghosts(&mesh, sites.len() as u32);
    for ghost in &ghosts {
        // The first half-edge of a ghost lies on the hull.
        let [inner, this] = [ghost[4], 8 * records.len() as u32];
        records[inner as usize / 8][4 + inner as usize % 8] = this;
        records.push(*ghost);
    }
    buffers.recycle(mesh);
    Some(records)
}

/// Returns the triangles between the hull and the vertex at infinity, which follow those of `mesh`.
fn ghosts(mesh: &HalfEdgeMesh, infinity: u32) -> Vec<[u32; 8]> {
    let hull: Vec<HalfEdgeIndex> = mesh.hull().collect();
    let [starts, ends]: [BTreeMap<_, _>; 2] = [HalfEdgeMesh::origin, HalfEdgeMesh::destination].map(|end| {
        hull.iter().zip(mesh.triangles.len()..).map(|(&h, ghost)| (end(mesh, h), 8 * ghost as u32)).collect()
    });
    let ghost = |&h: &HalfEdgeIndex| {
        let (from, to) = (mesh.origin(h), mesh.destination(h));
        // The neighbours' half-edges at the same corners of the hull: towards that of `from`, away from that of `to`.
        let [before, after] = [ends[&from] + 2, starts[&to] + 1];
        [to.0, from.0, infinity, 0, (8 * h.triangle() + h.corner()) as u32, before, after, 0]
    };
    hull.iter().map(ghost).collect()
}
