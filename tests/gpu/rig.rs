//! An engine on the first suitable adapter, and how to get numbers back from it.

use delaunay_gpu::buffer_id::BufferId;
use delaunay_gpu::buffers::BufferSet;
use delaunay_gpu::device;
use delaunay_gpu::device::{AdapterRequest, Device};
use delaunay_gpu::engine::GpuEngine;
use delaunay_gpu::error::GpuError;
use delaunay_gpu::filled_atlas::{AtlasLimits, FilledAtlas};
use delaunay_gpu::recording::Recording;
use delaunay_gpu::selftest::{StepComparison, compare};

pub(crate) struct Rig {
    engine: GpuEngine,
    buffers: BufferSet,
}

impl Rig {
    /// Opens an adapter. Returns `None`, with a message, on a machine without any adapter.
    pub(crate) fn new() -> Option<Rig> {
        let adapters = device::adapters();
        let infos: Vec<_> = adapters.iter().map(|adapter| adapter.get_info()).collect();
        match device::choose(&infos, &AdapterRequest::new(None, true)) {
            Ok(i) => {
                let device = Device::open(&adapters[i]).expect("the adapter opens");
                Some(Rig { engine: GpuEngine::new(device), buffers: BufferSet::default() })
            }
            Err(why) => {
                assert!(std::env::var_os("GDT_TEST_ALL").is_none(), "{why}");
                eprintln!("skipped: {why}; Debian's mesa-vulkan-drivers has a software GPU that is sufficient");
                None
            }
        }
    }

    /// Returns how large an atlas may be.
    pub(crate) fn limits(&self) -> AtlasLimits {
        AtlasLimits::of(&self.engine.device().limits)
    }

    /// Compares every step with its twin.
    pub(crate) fn compare(&mut self, filled: &FilledAtlas) -> Vec<StepComparison> {
        compare(&mut self.engine, &mut self.buffers, filled).expect("the steps run")
    }

    /// Loses the device, as a driver's reset would.
    pub(crate) fn lose(&self) {
        self.engine.device().device.destroy();
    }

    pub(crate) fn try_run(&mut self, recording: &Recording) -> Result<(), GpuError> {
        let submission = self.engine.start(&mut self.buffers, recording)?;
        self.engine.device().wait(submission)
    }

    pub(crate) fn run(&mut self, recording: &Recording) {
        self.engine.start(&mut self.buffers, recording).expect("the steps run");
    }

    /// Returns the first `count` numbers of buffer `id`.
    pub(crate) fn numbers(&mut self, id: BufferId, count: u64) -> Vec<u32> {
        self.engine.numbers(&mut self.buffers, id, count).expect("they come back")
    }
}
