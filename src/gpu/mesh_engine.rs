//! A GPU that makes the meshes of several atlases at a time, each with a set of buffers of its own.

use crate::gpu::buffer_id::BufferId;
use crate::gpu::buffers::BufferSet;
use crate::gpu::device::{self, AdapterRequest, Device};
use crate::gpu::engine::{GpuEngine, PendingReadback};
use crate::gpu::error::GpuError;
use crate::gpu::filled_atlas::FilledAtlas;
use crate::gpu::options::VoronoiMethod;
use crate::gpu::steps::Recording;
use crate::gpu::timestamps::StepNanoseconds;

/// The most atlases that are in flight at once, which is the number of slots of an engine.
pub const MAX_IN_FLIGHT: usize = 3;

/// What the GPU's thread needs from a GPU. Tests use an engine that fails on purpose.
pub trait MeshEngine: Send {
    /// An atlas that is being worked on.
    type Pending;

    /// Starts the meshes of an atlas on the buffers of `slot`.
    ///
    /// # Errors
    /// [`GpuError`] if the device refuses.
    fn start(&mut self, slot: usize, filled: &FilledAtlas) -> Result<Self::Pending, GpuError>;

    /// Waits for an atlas, and shows `take` the numbers that have come back; returns the times of the steps.
    ///
    /// # Errors
    /// [`GpuError`] if they never arrive. Then `take` was not called.
    fn finish(
        &mut self,
        slot: usize,
        pending: Self::Pending,
        take: &mut dyn FnMut(&[u32]),
    ) -> Result<StepNanoseconds, GpuError>;

    /// Frees the buffers of `slot`.
    fn free(&mut self, slot: usize);

    /// Opens the device again after it was lost.
    ///
    /// # Errors
    /// [`GpuError`] if it does not open.
    fn reopen(&mut self) -> Result<(), GpuError>;
}

/// An engine on a real device.
pub struct GpuMeshEngine {
    request: AdapterRequest,
    voronoi: VoronoiMethod,
    engine: GpuEngine,
    slots: [BufferSet; MAX_IN_FLIGHT],
}

impl GpuMeshEngine {
    /// Opens the adapter that `request` describes.
    ///
    /// # Errors
    /// [`GpuError`] if there is none, or it does not open.
    pub fn open(request: AdapterRequest, voronoi: VoronoiMethod) -> Result<GpuMeshEngine, GpuError> {
        Ok(GpuMeshEngine { engine: open(&request)?, request, voronoi, slots: Default::default() })
    }

    /// Returns the device.
    pub fn device(&self) -> &Device {
        self.engine.device()
    }
}

fn open(request: &AdapterRequest) -> Result<GpuEngine, GpuError> {
    let adapters = device::adapters();
    let infos: Vec<_> = adapters.iter().map(wgpu::Adapter::get_info).collect();
    let chosen = device::choose(&infos, request).map_err(GpuError::Absent)?;
    Ok(GpuEngine::new(Device::open(&adapters[chosen])?))
}

impl MeshEngine for GpuMeshEngine {
    type Pending = PendingReadback;

    fn start(&mut self, slot: usize, filled: &FilledAtlas) -> Result<PendingReadback, GpuError> {
        let recording = Recording::mesh(&filled.atlas, &filled.sites, self.voronoi);
        self.engine.start_and_fetch(&mut self.slots[slot], &recording, BufferId::Returned, filled.bytes_back())
    }

    fn finish(
        &mut self,
        slot: usize,
        pending: PendingReadback,
        take: &mut dyn FnMut(&[u32]),
    ) -> Result<StepNanoseconds, GpuError> {
        Ok(self.engine.finish_with(&self.slots[slot], pending, take)?.1)
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
