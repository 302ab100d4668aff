//! Leaf after leaf on a GPU. One thread owns the device; workers send it textures and wait for the diagrams. Up to
//! three leaves are in flight at once: while the GPU computes one, another is read back, and a worker repairs a third.
//!
//! Every failure costs time and nothing else. After a texture that is too large, workers ask for half the size. A lost device is
//! opened again once. If that does not help, every worker computes its own diagrams.

use crate::gpu::device::{self, AdapterRequest, MAX_SIDE};
use crate::gpu::diagram_engine::{DiagramEngine, GpuDiagramEngine, MAX_IN_FLIGHT, TextureSites};
use crate::gpu::gpu_thread::{DiagramRequest, GpuState, GpuThread};
use crate::gpu::options::{GpuOptions, TextureSide};
use crate::gpu::steps::GpuStep;
use crate::gpu::texture_size::TextureSize;
use crate::voronoi::diagram_backend::{DiagramBackend, DiagramReply};
use crate::voronoi::texture_request::{TextureRequest, TextureResolution};
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Sender, channel, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

/// Whether a job needs the GPU or only profits from it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GpuUse {
    /// The user asked for a GPU: a software renderer is acceptable, and workers always wait for the diagram.
    Required,
    /// The GPU must be hardware, and workers compute a diagram themselves while the GPU is busy.
    Optional,
}

/// A GPU that computes diagrams.
pub struct Executor {
    requests: Mutex<Option<Sender<DiagramRequest>>>,
    state: Arc<GpuState>,
    resolution: TextureResolution,
    gpu_use: GpuUse,
    thread: Option<JoinHandle<()>>,
    /// The adapter's name.
    pub adapter: String,
}

impl Executor {
    /// Opens an adapter as `options` say and starts its thread. The CPU's side has room for textures of `max_pixels` pixels.
    ///
    /// # Errors
    /// A sentence that says why no GPU can be used.
    pub fn start(options: &GpuOptions, gpu_use: GpuUse, max_pixels: u64) -> Result<Executor, String> {
        let request = AdapterRequest::new(options.adapter.as_deref(), gpu_use == GpuUse::Required);
        let engine = GpuDiagramEngine::open(request, options.voronoi).map_err(|error| error.to_string())?;
        let device = engine.device();
        let adapter = device.info.name.clone();
        let max_pixels = device::max_pixels(&device.limits).min(max_pixels).max(1);
        let resolution = match options.texture {
            TextureSide::Auto => TextureRequest::default().resolution,
            TextureSide::Max => TextureResolution::Side(MAX_SIDE),
            TextureSide::Side(side) => TextureResolution::Side(side),
        };
        Executor::on(engine, adapter, resolution, max_pixels, gpu_use)
    }

    fn on<E: DiagramEngine + 'static>(
        engine: E,
        adapter: String,
        resolution: TextureResolution,
        max_pixels: u64,
        gpu_use: GpuUse,
    ) -> Result<Executor, String> {
        let state = Arc::new(GpuState::new(max_pixels));
        let (sender, receiver) = channel();
        let of_thread = state.clone();
        let run = move || GpuThread::new(engine, of_thread).run(&receiver);
        let thread = std::thread::Builder::new().name("gpu".into()).spawn(run);
        let thread = Some(thread.map_err(|e| format!("the GPU's thread does not start: {e}"))?);
        Ok(Executor { requests: Mutex::new(Some(sender)), state, resolution, gpu_use, thread, adapter })
    }

    /// Returns the seconds that every step has taken on the GPU itself so far; nothing if the adapter has no timestamps.
    pub fn step_seconds(&self) -> Vec<(&'static str, f64)> {
        let seconds = |step: GpuStep| self.state.times[step as usize].load(Ordering::Relaxed) as f64 / 1e9;
        let steps = GpuStep::ALL.map(|step| (step.name(), seconds(step)));
        steps.into_iter().filter(|(_, seconds)| *seconds > 0.0).collect()
    }

    /// Sends `sites` and waits for their diagram; returns `None` if the thread is gone.
    fn ask(&self, sites: TextureSites) -> Option<DiagramReply> {
        let (reply, answer) = sync_channel(1);
        let requests = self.requests.lock().unwrap_or_else(PoisonError::into_inner).clone()?;
        requests.send(DiagramRequest { sites, reply }).ok()?;
        answer.recv().ok()
    }
}

impl DiagramBackend for Executor {
    fn texture_request(&self) -> TextureRequest {
        let max_pixels = self.state.max_pixels.load(Ordering::Acquire);
        TextureRequest { resolution: self.resolution, max_side: MAX_SIDE, max_pixels }
    }

    fn diagram(&self, width: u32, height: u32, pixels: Vec<u32>) -> DiagramReply {
        let waiting = self.state.waiting.fetch_add(1, Ordering::AcqRel);
        let is_busy = self.gpu_use == GpuUse::Optional && waiting >= MAX_IN_FLIGHT;
        let answer = match is_busy || self.state.is_gone.load(Ordering::Acquire) {
            true => None,
            false => self.ask(TextureSites { size: TextureSize { width, height }, pixels }),
        };
        self.state.waiting.fetch_sub(1, Ordering::AcqRel);
        answer.unwrap_or(DiagramReply::Unavailable)
    }
}

impl Drop for Executor {
    fn drop(&mut self) {
        self.requests.get_mut().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(thread) = self.thread.take() {
            // A panic of the thread has spoilt no result: the workers have computed their diagrams themselves.
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::error::GpuError;
    use crate::gpu::timestamps::StepNanoseconds;
    use std::collections::VecDeque;
    use std::sync::atomic::AtomicUsize;

    /// An engine that follows a script: the result of each start and of each finish, in order.
    struct ScriptedEngine {
        starts: VecDeque<Result<(), GpuError>>,
        finishes: VecDeque<Result<(), GpuError>>,
        reopens: Arc<AtomicUsize>,
    }

    impl DiagramEngine for ScriptedEngine {
        type Pending = u32;

        fn start(&mut self, _: usize, sites: &TextureSites) -> Result<u32, GpuError> {
            self.starts.pop_front().unwrap_or(Ok(())).map(|()| sites.pixels[0])
        }

        fn finish(&mut self, _: usize, pending: u32) -> Result<(Vec<u32>, StepNanoseconds), GpuError> {
            self.finishes.pop_front().unwrap_or(Ok(())).map(|()| (vec![pending], StepNanoseconds::default()))
        }

        fn free(&mut self, _: usize) {}

        fn reopen(&mut self) -> Result<(), GpuError> {
            self.reopens.fetch_add(1, Ordering::AcqRel);
            Ok(())
        }
    }

    fn executor(
        starts: impl IntoIterator<Item = Result<(), GpuError>>,
        finishes: impl IntoIterator<Item = Result<(), GpuError>>,
    ) -> (Executor, Arc<AtomicUsize>) {
        let reopens = Arc::<AtomicUsize>::default();
        let (starts, finishes) = (starts.into_iter().collect(), finishes.into_iter().collect());
        let engine = ScriptedEngine { starts, finishes, reopens: reopens.clone() };
        let resolution = TextureResolution::Side(1);
        let executor = Executor::on(engine, "test".into(), resolution, 1 << 28, GpuUse::Required).unwrap();
        (executor, reopens)
    }

    fn lost() -> Result<(), GpuError> {
        Err(GpuError::Lost("test".into()))
    }

    #[test]
    fn every_worker_gets_its_own_diagram() {
        let (executor, _) = executor([], []);
        std::thread::scope(|scope| {
            for worker in 0..8 {
                let executor = &executor;
                scope.spawn(move || {
                    for leaf in 0..100 {
                        let pixel = worker << 16 | leaf;
                        assert_eq!(executor.diagram(9, 9, vec![pixel]), DiagramReply::Labels(vec![pixel]));
                    }
                });
            }
        });
    }

    #[test]
    fn a_texture_that_is_too_large_halves_the_limit() {
        let (executor, _) = executor([Err(GpuError::OutOfMemory), Err(GpuError::OutOfMemory)], []);
        assert_eq!(executor.diagram(8192, 8192, vec![5]), DiagramReply::TooLarge);
        assert_eq!(executor.texture_request().max_pixels, 1 << 25);
        // If even a small texture does not fit, the worker computes the diagram.
        assert_eq!(executor.diagram(16, 16, vec![5]), DiagramReply::Unavailable);
        assert_eq!(executor.diagram(16, 16, vec![5]), DiagramReply::Labels(vec![5]));
    }

    #[test]
    fn a_lost_device_is_opened_again_once() {
        let (executor, reopens) = executor([], [lost(), Ok(()), lost()]);
        assert_eq!(executor.diagram(9, 9, vec![5]), DiagramReply::Labels(vec![5]));
        assert_eq!(reopens.load(Ordering::Acquire), 1);
        assert_eq!(executor.diagram(9, 9, vec![6]), DiagramReply::Unavailable);
        assert_eq!(executor.diagram(9, 9, vec![7]), DiagramReply::Unavailable);
        assert_eq!(reopens.load(Ordering::Acquire), 1);
    }

    #[test]
    fn a_refused_request_is_not_repeated() {
        let (executor, reopens) = executor([Err(GpuError::Refused("test".into()))], []);
        assert_eq!(executor.diagram(9, 9, vec![5]), DiagramReply::Unavailable);
        assert_eq!(executor.diagram(9, 9, vec![5]), DiagramReply::Unavailable);
        assert_eq!(reopens.load(Ordering::Acquire), 0);
    }
}
