//! An engine for tests that is no GPU: it computes diagrams on its own thread, and answers late, or never. `GDT_GPU=slow:n` is n
//! milliseconds late for every leaf, and `GDT_GPU=silent` never answers.

use crate::gpu::diagram_engine::{DiagramEngine, TextureSites};
use crate::gpu::error::GpuError;
use crate::gpu::timestamps::StepNanoseconds;
use crate::gpu::twins;
use std::time::Duration;

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
        let wanted = std::env::var("GDT_GPU").ok()?;
        if wanted == "silent" {
            return Some(FakeEngine { delay: None });
        }
        let milliseconds = wanted.strip_prefix("slow:")?.parse().ok()?;
        Some(FakeEngine { delay: Some(Duration::from_millis(milliseconds)) })
    }
}

impl DiagramEngine for FakeEngine {
    type Pending = TextureSites;

    fn start(&mut self, _: usize, sites: &TextureSites) -> Result<TextureSites, GpuError> {
        Ok(sites.clone())
    }

    fn finish(&mut self, _: usize, sites: TextureSites) -> Result<(Vec<u32>, StepNanoseconds), GpuError> {
        let Some(delay) = self.delay else {
            loop {
                std::thread::park();
            }
        };
        std::thread::sleep(delay);
        let texture = twins::write_sites(sites.size, &sites.pixels);
        let mut labels = twins::voronoi_exact(sites.size, &texture);
        twins::remove_islands(sites.size, &mut labels);
        Ok((labels, StepNanoseconds::default()))
    }

    fn free(&mut self, _: usize) {}

    fn reopen(&mut self) -> Result<(), GpuError> {
        Ok(())
    }
}
