//! A GPU that computes the diagrams of several leaves at a time, each with a set of buffers of its own.

use crate::gpu::buffer_id::BufferId;
use crate::gpu::buffers::BufferSet;
use crate::gpu::device::{self, AdapterRequest, Device};
use crate::gpu::engine::{GpuEngine, PendingReadback};
use crate::gpu::error::GpuError;
use crate::gpu::options::VoronoiMethod;
use crate::gpu::steps::Recording;
use crate::gpu::texture_size::TextureSize;
use crate::gpu::timestamps::StepNanoseconds;

/// The most leaves that are in flight at once, which is the number of slots of an engine.
pub(super) const MAX_IN_FLIGHT: usize = 3;

/// A texture whose diagram is needed.
#[derive(Clone, Debug)]
pub(super) struct TextureSites {
    pub(super) size: TextureSize,
    /// The pixel (y << 16 | x) of every site.
    pub(super) pixels: Vec<u32>,
}

/// What the GPU's thread needs from a GPU. Tests use an engine that fails on purpose.
pub(super) trait DiagramEngine: Send {
    /// A diagram that is being computed.
    type Pending;

    /// Starts the diagram of `sites` on the buffers of `slot`.
    fn start(&mut self, slot: usize, sites: &TextureSites) -> Result<Self::Pending, GpuError>;
    /// Waits for a diagram; returns its labels and the times of the steps.
    fn finish(&mut self, slot: usize, pending: Self::Pending) -> Result<(Vec<u32>, StepNanoseconds), GpuError>;
    /// Frees the buffers of `slot`.
    fn free(&mut self, slot: usize);
    /// Opens the device again after it was lost.
    fn reopen(&mut self) -> Result<(), GpuError>;
}

/// An engine on a real device.
pub(super) struct GpuDiagramEngine {
    request: AdapterRequest,
    voronoi: VoronoiMethod,
    engine: GpuEngine,
    slots: [BufferSet; MAX_IN_FLIGHT],
}

impl GpuDiagramEngine {
    /// Opens the adapter that `request` describes.
    pub(super) fn open(request: AdapterRequest, voronoi: VoronoiMethod) -> Result<GpuDiagramEngine, GpuError> {
        Ok(GpuDiagramEngine { engine: open(&request)?, request, voronoi, slots: Default::default() })
    }

    /// Returns the device.
    pub(super) fn device(&self) -> &Device {
        self.engine.device()
    }
}

fn open(request: &AdapterRequest) -> Result<GpuEngine, GpuError> {
    let adapters = device::adapters();
    let infos: Vec<_> = adapters.iter().map(wgpu::Adapter::get_info).collect();
    let chosen = device::choose(&infos, request).map_err(GpuError::Absent)?;
    Ok(GpuEngine::new(Device::open(&adapters[chosen])?))
}

impl DiagramEngine for GpuDiagramEngine {
    type Pending = PendingReadback;

    fn start(&mut self, slot: usize, sites: &TextureSites) -> Result<PendingReadback, GpuError> {
        let recording = Recording::labels(sites.size, sites.pixels.clone(), self.voronoi);
        self.engine.start_and_fetch(&mut self.slots[slot], &recording, BufferId::Labels, 4 * sites.size.pixels())
    }

    fn finish(&mut self, slot: usize, pending: PendingReadback) -> Result<(Vec<u32>, StepNanoseconds), GpuError> {
        self.engine.finish(&self.slots[slot], pending)
    }

    fn free(&mut self, slot: usize) {
        self.slots[slot].clear();
    }

    fn reopen(&mut self) -> Result<(), GpuError> {
        self.slots = Default::default();
        self.engine = open(&self.request)?;
        Ok(())
    }
}
