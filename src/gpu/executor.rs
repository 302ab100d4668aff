//! Leaf after leaf on a GPU. One thread owns the device; workers send it textures and wait for the diagrams. Up to
//! three leaves are in flight at once: while the GPU computes one, another is read back, and a worker repairs a third.
//!
//! Every failure costs time and nothing else. After a texture that is too large, workers ask for half the size. A lost device is
//! opened again once. If that does not help, every worker computes its own diagrams.
//!
//! A worker that waits for its diagram does other work of the job meanwhile. If there is none, and the job could do without the GPU,
//! the worker soon computes the diagram itself.

use crate::gpu::benefit::GpuBenefit;
use crate::gpu::device::{self, AdapterRequest, MAX_SIDE};
use crate::gpu::diagram_engine::{DiagramEngine, GpuDiagramEngine, MAX_IN_FLIGHT, TextureSites};
#[cfg(feature = "fault-injection")]
use crate::gpu::fake_engine::{self, FakeEngine};
use crate::gpu::gpu_thread::{DiagramRequest, GpuState, GpuThread};
use crate::gpu::options::{GpuOptions, TextureSide};
use crate::gpu::steps::GpuStep;
use crate::gpu::texture_size::TextureSize;
use crate::interrupt;
use crate::threads::do_other_work;
use crate::voronoi::diagram_backend::{DiagramBackend, DiagramReply};
use crate::voronoi::texture_request::{TextureRequest, TextureResolution};
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, TryRecvError, channel, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// An idle worker waits no longer than this for a GPU that the job can do without.
const PATIENCE: Duration = Duration::from_millis(300);
/// Or not longer than so many times what it takes for the leaf alone.
const PATIENCE_IN_LEAVES: f64 = 3.0;
/// An idle worker looks this often whether there is other work.
const NAP: Duration = Duration::from_millis(1);
/// After so many workers in a row waited in vain, the GPU is given up.
const MOST_ABANDONED: usize = 3;

/// Whether a job needs the GPU or only profits from it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GpuUse {
    /// The user asked for a GPU: a software renderer is acceptable, and workers always wait for the diagram.
    Required,
    /// The GPU must be hardware. Workers compute a diagram themselves while it is busy, and all diagrams if it saves no time.
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
    /// What it has brought so far.
    pub(crate) benefit: GpuBenefit,
}

impl Executor {
    /// Opens an adapter as `options` say and starts its thread. The CPU's side has room for textures of `max_pixels` pixels.
    ///
    /// # Errors
    /// A sentence that says why no GPU can be used.
    pub fn start(options: &GpuOptions, gpu_use: GpuUse, max_pixels: u64) -> Result<Executor, String> {
        #[cfg(feature = "fault-injection")]
        if let Some(engine) = FakeEngine::from_environment() {
            return Executor::on(engine, "no GPU".into(), TextureRequest::default().resolution, max_pixels, gpu_use);
        }
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
        let benefit = GpuBenefit::new(gpu_use == GpuUse::Required);
        Ok(Executor { requests: Mutex::new(Some(sender)), state, resolution, gpu_use, thread, adapter, benefit })
    }

    /// Tells whether an adapter is likely to be found. This is so cheap that every job may ask.
    pub fn is_likely() -> bool {
        #[cfg(feature = "fault-injection")]
        if fake_engine::is_wanted() {
            return true;
        }
        device::hardware_is_likely()
    }

    /// Returns the seconds that every step has taken on the GPU itself so far; nothing if the adapter has no timestamps.
    pub fn step_seconds(&self) -> Vec<(&'static str, f64)> {
        let seconds = |step: GpuStep| self.state.times[step as usize].load(Ordering::Relaxed) as f64 / 1e9;
        let steps = GpuStep::ALL.map(|step| (step.name(), seconds(step)));
        steps.into_iter().filter(|(_, seconds)| *seconds > 0.0).collect()
    }

    /// Tells whether to ask for help with the next leaf.
    pub(crate) fn is_worth_asking(&self) -> bool {
        (self.gpu_use == GpuUse::Required || !self.is_busy()) && self.benefit.is_worth_asking()
    }

    fn is_busy(&self) -> bool {
        self.state.waiting.load(Ordering::Acquire) >= MAX_IN_FLIGHT
    }

    /// Sends `sites` and waits for their diagram; returns `None` if none is to be expected.
    fn ask(&self, sites: TextureSites) -> Option<DiagramReply> {
        let patience = self.patience(sites.pixels.len());
        let (reply, answer) = sync_channel(1);
        let requests = self.requests.lock().unwrap_or_else(PoisonError::into_inner).clone()?;
        self.state.unanswered.fetch_add(1, Ordering::AcqRel);
        if requests.send(DiagramRequest { sites, reply }).is_err() {
            self.state.unanswered.fetch_sub(1, Ordering::AcqRel);
            return None;
        }
        let reply = self.wait_for(&answer, patience);
        if reply.is_none() && self.state.abandoned.fetch_add(1, Ordering::AcqRel) + 1 >= MOST_ABANDONED {
            self.state.is_gone.store(true, Ordering::Release);
            self.benefit.give_up("it does not answer in time");
        }
        reply
    }

    /// Returns how long an idle worker waits for the diagram of `sites` sites; `None` if as long as it takes.
    fn patience(&self, sites: usize) -> Option<Duration> {
        let alone = self.benefit.seconds_alone(sites).map(|alone| Duration::from_secs_f64(PATIENCE_IN_LEAVES * alone));
        (self.gpu_use == GpuUse::Optional).then(|| alone.map_or(PATIENCE, |alone| alone.min(PATIENCE)))
    }

    /// Waits for an answer, and does other work meanwhile. Returns `None` once this thread has been idle for longer than `patience`, or is
    /// to stop.
    fn wait_for(&self, answer: &Receiver<DiagramReply>, patience: Option<Duration>) -> Option<DiagramReply> {
        // The memory has room for a few leaves that wait, besides one for each worker.
        let may_do_other_work = || self.state.waiting.load(Ordering::Acquire) <= MAX_IN_FLIGHT;
        let mut idle = Duration::ZERO;
        loop {
            match answer.try_recv() {
                Ok(reply) => return Some(reply),
                Err(TryRecvError::Disconnected) => return Some(DiagramReply::Unavailable),
                Err(TryRecvError::Empty) if may_do_other_work() && do_other_work() => continue,
                Err(TryRecvError::Empty) => {}
            }
            let begun = Instant::now();
            match answer.recv_timeout(NAP) {
                Ok(reply) => return Some(reply),
                Err(RecvTimeoutError::Disconnected) => return Some(DiagramReply::Unavailable),
                Err(RecvTimeoutError::Timeout) => idle = idle.saturating_add(begun.elapsed()),
            }
            if patience.is_some_and(|patience| idle > patience) || interrupt::check().is_err() {
                return None;
            }
        }
    }
}

impl DiagramBackend for Executor {
    fn texture_request(&self) -> TextureRequest {
        let max_pixels = self.state.max_pixels.load(Ordering::Acquire);
        TextureRequest { resolution: self.resolution, max_side: MAX_SIDE, max_pixels }
    }

    fn diagram(&self, width: u32, height: u32, pixels: Vec<u32>) -> DiagramReply {
        self.state.waiting.fetch_add(1, Ordering::AcqRel);
        let answer = match self.state.is_gone.load(Ordering::Acquire) {
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
        // A device that does not answer may hold its thread for a minute. Nobody needs what it answers.
        let is_at_rest = self.state.unanswered.load(Ordering::Acquire) == 0;
        if let Some(thread) = self.thread.take().filter(|_| is_at_rest) {
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

    /// An engine that answers only when it is told to.
    struct WaitingEngine(Receiver<()>);

    impl DiagramEngine for WaitingEngine {
        type Pending = u32;

        fn start(&mut self, _: usize, sites: &TextureSites) -> Result<u32, GpuError> {
            Ok(sites.pixels[0])
        }

        fn finish(&mut self, _: usize, pending: u32) -> Result<(Vec<u32>, StepNanoseconds), GpuError> {
            let _ = self.0.recv();
            Ok((vec![pending], StepNanoseconds::default()))
        }

        fn free(&mut self, _: usize) {}

        fn reopen(&mut self) -> Result<(), GpuError> {
            Ok(())
        }
    }

    fn waiting_executor(gpu_use: GpuUse) -> (Executor, Sender<()>) {
        let (go, gone) = channel();
        let resolution = TextureResolution::Side(1);
        (Executor::on(WaitingEngine(gone), "test".into(), resolution, 1 << 28, gpu_use).unwrap(), go)
    }

    /// The diagram comes only after the other work, which only this thread can do.
    #[test]
    fn a_worker_does_other_work_while_it_waits() {
        let (executor, go) = waiting_executor(GpuUse::Required);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let (reply, ()) = pool.install(|| rayon::join(|| executor.diagram(9, 9, vec![5]), || go.send(()).unwrap()));
        assert_eq!(reply, DiagramReply::Labels(vec![5]));
    }

    #[test]
    fn a_silent_gpu_is_given_up_and_nobody_waits_for_its_thread() {
        let (executor, go) = waiting_executor(GpuUse::Optional);
        for _ in 0..MOST_ABANDONED {
            assert!(executor.is_worth_asking());
            executor.benefit.note(false, 1, 1e-3);
            assert_eq!(executor.diagram(9, 9, vec![5]), DiagramReply::Unavailable);
        }
        assert!(!executor.is_worth_asking());
        assert!(executor.benefit.figures().given_up.is_some_and(|why| why.contains("answer")));
        drop(executor);
        drop(go);
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
