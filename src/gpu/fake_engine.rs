//! An engine for tests that is no GPU: it makes meshes on its own thread with the shaders' twins, and answers late, or never.
//! `GDT_GPU=slow:n` is n milliseconds late for every atlas, and `GDT_GPU=silent` never answers.

use crate::gpu::error::GpuError;
use crate::gpu::filled_atlas::FilledAtlas;
use crate::gpu::mesh_engine::MeshEngine;
use crate::gpu::options::VoronoiMethod;
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

impl MeshEngine for FakeEngine {
    type Pending = FilledAtlas;

    fn start(&mut self, _: usize, filled: &FilledAtlas) -> Result<FilledAtlas, GpuError> {
        Ok(filled.clone())
    }

    fn finish(
        &mut self,
        _: usize,
        filled: FilledAtlas,
        take: &mut dyn FnMut(&[u32]),
    ) -> Result<StepNanoseconds, GpuError> {
        let Some(delay) = self.delay else {
            loop {
                std::thread::park();
            }
        };
        std::thread::sleep(delay);
        take(&twins::atlas::mesh(&filled.atlas, &filled.sites, VoronoiMethod::Exact));
        Ok(StepNanoseconds::default())
    }

    fn free(&mut self, _: usize) {}

    fn reopen(&mut self) -> Result<(), GpuError> {
        Ok(())
    }
}
