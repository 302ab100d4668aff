//! A GPU that makes the meshes of several atlases at a time, each with a set of buffers of its own.

use crate::on_device::buffer_id::BufferId;
use crate::on_device::buffers::BufferSet;
use crate::on_device::device;
use crate::on_device::device::{AdapterRequest, Device};
use crate::on_device::engine::{GpuEngine, PendingReadback};
use crate::on_device::error::GpuError;
use crate::on_device::filled_atlas::{AtlasLimits, FilledAtlas};
use crate::on_device::landed::Landed;
use crate::on_device::recording::Recording;
use crate::on_device::staging::StagingPool;
use crate::options::VoronoiMethod;
use delaunay::voronoi::texture_request::TextureResolution;
use std::sync::Arc;

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

    /// Returns whether [`MeshEngine::finish`] need not wait for this atlas, as far as the engine can tell.
    fn is_finished(&mut self, pending: &Self::Pending) -> bool;

    /// Waits for an atlas; returns what has come back.
    ///
    /// # Errors
    /// [`GpuError`] if they never arrive.
    fn finish(&mut self, slot: usize, pending: Self::Pending) -> Result<Landed, GpuError>;

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
    staging: Arc<StagingPool>,
}

impl GpuMeshEngine {
    /// Opens the adapter that `request` describes. What comes back may stay in buffers of `most_lent` bytes besides those of the slots,
    /// while others read it.
    ///
    /// # Errors
    /// [`GpuError`] if there is none, or it does not open.
    pub fn open(request: AdapterRequest, voronoi: VoronoiMethod, most_lent: u64) -> Result<GpuMeshEngine, GpuError> {
        let (slots, staging) = (Default::default(), Arc::new(StagingPool::new(most_lent)));
        Ok(GpuMeshEngine { engine: open(&request)?, request, voronoi, slots, staging })
    }

    /// Makes the mesh of one triangle, so that all shaders are compiled.
    ///
    /// # Errors
    /// [`GpuError`] of the device.
    pub fn warm_up(&mut self) -> Result<(), GpuError> {
        let mut filled = FilledAtlas::default();
        let limits = AtlasLimits::of(&self.device().limits);
        if filled.add(&[[0, 0], [9, 0], [0, 9]], TextureResolution::PixelsPerSite(16.0), limits) {
            let pending = self.start(0, &filled)?;
            self.finish(0, pending)?;
        }
        Ok(())
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
        let (buffers, bytes) = (&mut self.slots[slot], filled.bytes_back());
        buffers.fill_gap(BufferId::Staging, || self.staging.take_spare(bytes));
        self.engine.start_and_fetch(buffers, &recording, BufferId::Returned, bytes)
    }

    fn is_finished(&mut self, pending: &PendingReadback) -> bool {
        self.engine.is_finished(pending)
    }

    fn finish(&mut self, slot: usize, pending: PendingReadback) -> Result<Landed, GpuError> {
        self.engine.finish_shared(&mut self.slots[slot], pending, &self.staging)
    }

    fn free(&mut self, slot: usize) {
        self.slots[slot].clear();
        self.staging.free_spares();
    }

    fn reopen(&mut self) -> Result<(), GpuError> {
        self.slots = Default::default();
        self.staging = Arc::new(self.staging.successor());
        self.engine = open(&self.request)?;
        Ok(())
    }
}
