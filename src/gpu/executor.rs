//! Leaves on a GPU. One thread owns the device; workers send it the sites of their leaves and wait for the meshes. All leaves that wait
//! share an atlas, as many as fit. Up to three atlases are in flight at once: while the GPU works on one, another is read back.
//!
//! Every failure costs time and nothing else. After an atlas that is too large, the next ones have half the size. A lost device is
//! opened again once. If that does not help, every worker does its own leaves.
//!
//! A worker that waits for its mesh does other work of the job meanwhile, so that many leaves wait. If there is none, and the job could do
//! without the GPU, the worker soon does the leaf itself.

use crate::geometry::Site;
use crate::gpu::benefit::GpuBenefit;
use crate::gpu::device::{self, AdapterRequest, MAX_SIDE};
#[cfg(feature = "fault-injection")]
use crate::gpu::fake_engine::{self, FakeEngine};
use crate::gpu::filled_atlas::{AtlasLimits, MAX_PIXELS};
use crate::gpu::gpu_thread::{Filling, GpuState, GpuThread, MeshRequest};
use crate::gpu::mesh_engine::{GpuMeshEngine, MeshEngine};
use crate::gpu::options::{GpuOptions, TextureSide};
use crate::gpu::steps::GpuStep;
use crate::interrupt;
use crate::threads::do_other_work;
use crate::voronoi::mesh_reply::MeshReply;
use crate::voronoi::texture_request::TextureResolution;
use std::cell::Cell;
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

/// Pixels a site of the textures. More pixels leave less to the CPU and take longer on the device; with 16 the CPU's part is least.
const PIXELS_PER_SITE: f64 = 16.0;
/// With fewer pixels for each site, so many sites would share one that the device is of no use.
const FEWEST_PIXELS_PER_SITE: u64 = 4;
/// Bytes for each site of a leaf that waits: its point, its position twice, and the device's answer.
const BYTES_PER_WAITING_SITE: u64 = 130;
/// Bytes for each byte that comes back from an atlas: each slot has a buffer into which the device copies them, and what goes up takes
/// about a quarter as much.
const BYTES_PER_BYTE_BACK: u64 = 4;
/// While so many leaves of a thread wait, it takes on other work; then no more, because its stack ends somewhere.
const MOST_NESTED: usize = 8;

thread_local! {
    /// How many leaves of this thread wait for their meshes, one above the other on its stack.
    static NESTED: Cell<usize> = const { Cell::new(0) };
}

/// Whether a job needs the GPU or only profits from it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GpuUse {
    /// The user asked for a GPU: a software renderer is acceptable, and workers always wait for the mesh.
    Required,
    /// The GPU must be hardware. Workers do leaves themselves while it is busy, and all leaves if it saves no time.
    Optional,
}

/// A GPU that makes meshes.
pub struct Executor {
    requests: Mutex<Option<Sender<MeshRequest>>>,
    state: Arc<GpuState>,
    /// The memory has room for so many sites of leaves that wait.
    max_waiting: u64,
    gpu_use: GpuUse,
    thread: Option<JoinHandle<()>>,
    /// The adapter's name.
    pub adapter: String,
    /// What it has brought so far.
    pub(crate) benefit: GpuBenefit,
}

/// What the executor has room for.
#[derive(Clone, Copy)]
struct Room {
    /// The most pixels of an atlas.
    max_pixels: u32,
    /// The most sites of leaves that wait while their threads do other work.
    max_waiting: u64,
}

impl Executor {
    /// Opens an adapter as `options` say and starts its thread. The CPU's side may take `memory` bytes: half for the atlases in flight,
    /// half for the leaves that wait.
    ///
    /// # Errors
    /// A sentence that says why no GPU can be used.
    pub fn start(options: &GpuOptions, gpu_use: GpuUse, memory: u64) -> Result<Executor, String> {
        let resolution = match options.texture {
            TextureSide::Auto => TextureResolution::PixelsPerSite(PIXELS_PER_SITE),
            TextureSide::Max => TextureResolution::Side(MAX_SIDE),
            TextureSide::Side(side) => TextureResolution::Side(side),
        };
        let max_bytes = memory / 2 / BYTES_PER_BYTE_BACK;
        let room = Room { max_pixels: MAX_PIXELS, max_waiting: memory / 2 / BYTES_PER_WAITING_SITE };
        #[cfg(feature = "fault-injection")]
        if let Some(engine) = FakeEngine::from_environment() {
            return Executor::on(engine, "no GPU".into(), Filling { resolution, max_bytes }, room, gpu_use);
        }
        let request = AdapterRequest::new(options.adapter.as_deref(), gpu_use == GpuUse::Required);
        let engine = GpuMeshEngine::open(request, options.voronoi).map_err(|error| error.to_string())?;
        let device = engine.device();
        let (adapter, limits) = (device.info.name.clone(), AtlasLimits::of(&device.limits));
        let filling = Filling { resolution, max_bytes: max_bytes.min(limits.bytes) };
        Executor::on(engine, adapter, filling, Room { max_pixels: limits.pixels, ..room }, gpu_use)
    }

    fn on<E: MeshEngine + 'static>(
        engine: E,
        adapter: String,
        filling: Filling,
        room: Room,
        gpu_use: GpuUse,
    ) -> Result<Executor, String> {
        let state = Arc::new(GpuState::new(room.max_pixels));
        let (sender, receiver) = channel();
        let of_thread = state.clone();
        let run = move || GpuThread::new(engine, of_thread, filling).run(&receiver);
        let thread = std::thread::Builder::new().name("gpu".into()).spawn(run);
        let thread = Some(thread.map_err(|e| format!("the GPU's thread does not start: {e}"))?);
        let benefit = GpuBenefit::new(gpu_use == GpuUse::Required);
        let (requests, max_waiting) = (Mutex::new(Some(sender)), room.max_waiting);
        Ok(Executor { requests, state, max_waiting, gpu_use, thread, adapter, benefit })
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

    /// Tells whether to ask for the mesh of the next leaf, which has `sites` sites.
    pub(crate) fn is_worth_asking(&self, sites: usize) -> bool {
        (self.gpu_use == GpuUse::Required || self.has_room(sites as u64)) && self.benefit.is_worth_asking()
    }

    /// Returns whether `sites` more sites may wait.
    fn has_room(&self, sites: u64) -> bool {
        let waiting = self.state.waiting.load(Ordering::Acquire);
        waiting.saturating_add(sites) <= self.max_waiting && NESTED.get() < MOST_NESTED
    }

    /// Sends `sites` to the device, and waits for their mesh. Does other work of the job meanwhile.
    pub fn mesh(&self, sites: &[Site]) -> MeshReply {
        let (count, pixels) = (sites.len() as u64, self.state.max_pixels.load(Ordering::Acquire));
        if self.state.is_gone.load(Ordering::Acquire) || count > u64::from(pixels) / FEWEST_PIXELS_PER_SITE {
            return MeshReply::Unavailable;
        }
        self.state.waiting.fetch_add(count, Ordering::AcqRel);
        NESTED.set(NESTED.get() + 1);
        let answer = self.ask(sites);
        NESTED.set(NESTED.get() - 1);
        self.state.waiting.fetch_sub(count, Ordering::AcqRel);
        answer.unwrap_or(MeshReply::Unavailable)
    }

    /// Sends `sites` and waits for their mesh; returns `None` if none is to be expected.
    fn ask(&self, sites: &[Site]) -> Option<MeshReply> {
        let patience = self.patience(sites.len());
        let (reply, answer) = sync_channel(1);
        let requests = self.requests.lock().unwrap_or_else(PoisonError::into_inner).clone()?;
        self.state.unanswered.fetch_add(1, Ordering::AcqRel);
        if requests.send(MeshRequest { sites: sites.to_vec(), reply }).is_err() {
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

    /// Returns how long an idle worker waits for the mesh of `sites` sites; `None` if as long as it takes.
    fn patience(&self, sites: usize) -> Option<Duration> {
        let alone = self.benefit.seconds_alone(sites).map(|alone| Duration::from_secs_f64(PATIENCE_IN_LEAVES * alone));
        (self.gpu_use == GpuUse::Optional).then(|| alone.map_or(PATIENCE, |alone| alone.min(PATIENCE)))
    }

    /// Waits for an answer, and does other work meanwhile. Returns `None` once this thread has been idle for longer than `patience`, or is
    /// to stop.
    fn wait_for(&self, answer: &Receiver<MeshReply>, patience: Option<Duration>) -> Option<MeshReply> {
        // The other work may be a leaf that waits too. Beyond the limits, one that does not.
        let may_do_other_work =
            || self.state.waiting.load(Ordering::Acquire) <= self.max_waiting && NESTED.get() <= MOST_NESTED;
        let mut idle = Duration::ZERO;
        loop {
            match answer.try_recv() {
                Ok(reply) => return Some(reply),
                Err(TryRecvError::Disconnected) => return Some(MeshReply::Unavailable),
                Err(TryRecvError::Empty) if may_do_other_work() && do_other_work() => continue,
                Err(TryRecvError::Empty) => {}
            }
            let begun = Instant::now();
            match answer.recv_timeout(NAP) {
                Ok(reply) => return Some(reply),
                Err(RecvTimeoutError::Disconnected) => return Some(MeshReply::Unavailable),
                Err(RecvTimeoutError::Timeout) => idle = idle.saturating_add(begun.elapsed()),
            }
            if patience.is_some_and(|patience| idle > patience) || interrupt::check().is_err() {
                return None;
            }
        }
    }
}

impl Drop for Executor {
    fn drop(&mut self) {
        self.requests.get_mut().unwrap_or_else(PoisonError::into_inner).take();
        // A device that does not answer may hold its thread for a minute. Nobody needs what it answers.
        let is_at_rest = self.state.unanswered.load(Ordering::Acquire) == 0;
        if let Some(thread) = self.thread.take().filter(|_| is_at_rest) {
            // A panic of the thread has spoilt no result: the workers have done their leaves themselves.
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::error::GpuError;
    use crate::gpu::filled_atlas::FilledAtlas;
    use crate::gpu::returned::ReturnedLayout;
    use crate::gpu::timestamps::StepNanoseconds;
    use std::collections::VecDeque;
    use std::sync::atomic::AtomicUsize;

    /// Returns what comes back of an atlas whose leaves have one record each, with the x of the leaf's first site.
    fn numbers_back(filled: &FilledAtlas) -> Vec<u32> {
        let layout = ReturnedLayout::of(&filled.atlas);
        let mut numbers = vec![0; layout.numbers()];
        for (i, leaf) in filled.atlas.leaves.iter().enumerate() {
            numbers[layout.leaves.start + 2 * i] = 1;
            numbers[8 * leaf.first_record as usize] = filled.sites[leaf.first_site as usize][0] as u32;
        }
        numbers
    }

    /// Returns a leaf that is known by `x`.
    fn leaf(x: i32) -> [Site; 3] {
        [[x, 0], [x + 9, 0], [x, 9]]
    }

    /// Returns the x by which the leaf of an answer is known.
    fn known_by(reply: &MeshReply) -> Option<u32> {
        match reply {
            MeshReply::Made(made) => made.records.first().copied(),
            MeshReply::Flagged | MeshReply::Unavailable => None,
        }
    }

    fn ask(executor: &Executor, x: i32) -> Option<u32> {
        known_by(&executor.mesh(&leaf(x)))
    }

    /// An engine that follows a script: the result of each start and of each finish, in order.
    struct ScriptedEngine {
        starts: VecDeque<Result<(), GpuError>>,
        finishes: VecDeque<Result<(), GpuError>>,
        reopens: Arc<AtomicUsize>,
    }

    impl MeshEngine for ScriptedEngine {
        type Pending = Vec<u32>;

        fn start(&mut self, _: usize, filled: &FilledAtlas) -> Result<Vec<u32>, GpuError> {
            self.starts.pop_front().unwrap_or(Ok(())).map(|()| numbers_back(filled))
        }

        fn finish(
            &mut self,
            _: usize,
            pending: Vec<u32>,
            take: &mut dyn FnMut(&[u32]),
        ) -> Result<StepNanoseconds, GpuError> {
            self.finishes.pop_front().unwrap_or(Ok(())).map(|()| take(&pending))?;
            Ok(StepNanoseconds::default())
        }

        fn free(&mut self, _: usize) {}

        fn reopen(&mut self) -> Result<(), GpuError> {
            self.reopens.fetch_add(1, Ordering::AcqRel);
            Ok(())
        }
    }

    const MAX_PIXELS: u32 = 1 << 22;
    const FINE: Filling = Filling { resolution: TextureResolution::Side(2000), max_bytes: 1 << 20 };
    const ROOM: Room = Room { max_pixels: MAX_PIXELS, max_waiting: 1000 };

    fn executor(
        starts: impl IntoIterator<Item = Result<(), GpuError>>,
        finishes: impl IntoIterator<Item = Result<(), GpuError>>,
    ) -> (Executor, Arc<AtomicUsize>) {
        let reopens = Arc::<AtomicUsize>::default();
        let (starts, finishes) = (starts.into_iter().collect(), finishes.into_iter().collect());
        let engine = ScriptedEngine { starts, finishes, reopens: reopens.clone() };
        let executor = Executor::on(engine, "test".into(), FINE, ROOM, GpuUse::Required).unwrap();
        (executor, reopens)
    }

    fn lost() -> Result<(), GpuError> {
        Err(GpuError::Lost("test".into()))
    }

    #[test]
    fn every_worker_gets_its_own_mesh() {
        let (executor, _) = executor([], []);
        std::thread::scope(|scope| {
            for worker in 0..8 {
                let executor = &executor;
                scope.spawn(move || {
                    for leaf in 0..100 {
                        let x = worker << 16 | leaf;
                        assert_eq!(ask(executor, x), Some(x as u32));
                    }
                });
            }
        });
        assert_eq!(executor.state.waiting.load(Ordering::Acquire), 0);
    }

    /// An engine that answers only when it is told to. It tells how many leaves an atlas has when it starts, and 0 when it waits.
    struct WaitingEngine {
        go: Receiver<()>,
        leaves: Sender<usize>,
    }

    impl MeshEngine for WaitingEngine {
        type Pending = Vec<u32>;

        fn start(&mut self, _: usize, filled: &FilledAtlas) -> Result<Vec<u32>, GpuError> {
            let _ = self.leaves.send(filled.atlas.leaves.len());
            Ok(numbers_back(filled))
        }

        fn finish(
            &mut self,
            _: usize,
            pending: Vec<u32>,
            take: &mut dyn FnMut(&[u32]),
        ) -> Result<StepNanoseconds, GpuError> {
            let _ = self.leaves.send(0);
            let _ = self.go.recv();
            take(&pending);
            Ok(StepNanoseconds::default())
        }

        fn free(&mut self, _: usize) {}

        fn reopen(&mut self) -> Result<(), GpuError> {
            Ok(())
        }
    }

    fn waiting_executor(gpu_use: GpuUse, room: Room) -> (Executor, Sender<()>, Receiver<usize>) {
        let ((go, gone), (leaves, atlases)) = (channel(), channel());
        let engine = WaitingEngine { go: gone, leaves };
        (Executor::on(engine, "test".into(), FINE, room, gpu_use).unwrap(), go, atlases)
    }

    /// The mesh comes only after the other work, which only this thread can do.
    #[test]
    fn a_worker_does_other_work_while_it_waits() {
        let (executor, go, _) = waiting_executor(GpuUse::Required, ROOM);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let (reply, ()) = pool.install(|| rayon::join(|| ask(&executor, 5), || go.send(()).unwrap()));
        assert_eq!(reply, Some(5));
    }

    /// One thread has many leaves that wait. Those that come while the device is busy share an atlas.
    #[test]
    fn leaves_that_wait_share_an_atlas() {
        let (executor, go, atlases) = waiting_executor(GpuUse::Required, ROOM);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let first = std::thread::scope(|scope| {
            // The device is busy with the first leaf until all others wait.
            let first = scope.spawn(|| ask(&executor, 1000));
            assert_eq!([atlases.recv(), atlases.recv()], [Ok(1), Ok(0)]);
            let answers: Vec<_> = pool.install(|| {
                let tell = || (0..2).for_each(|_| go.send(()).unwrap());
                leaves(&executor, 0..MOST_NESTED as i32, &tell)
            });
            assert!(answers.iter().zip(0..).all(|(answer, x)| *answer == Some(x)), "{answers:?}");
            first.join().unwrap()
        });
        assert_eq!((first, atlases.recv()), (Some(1000), Ok(MOST_NESTED)));
    }

    /// Asks for leaves that this pool can do at the same time. `tell` is called once all of them wait.
    fn leaves(executor: &Executor, xs: std::ops::Range<i32>, tell: &(dyn Fn() + Sync)) -> Vec<Option<u32>> {
        let Some(x) = xs.clone().next() else {
            tell();
            return Vec::new();
        };
        let (own, others) = rayon::join(|| ask(executor, x), || leaves(executor, x + 1..xs.end, tell));
        [vec![own], others].concat()
    }

    #[test]
    fn a_job_that_needs_no_gpu_asks_only_while_there_is_room() {
        let (executor, go, _) = waiting_executor(GpuUse::Optional, Room { max_waiting: 5, ..ROOM });
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        assert!(executor.has_room(5) && !executor.has_room(6));
        let nested = || {
            assert!(executor.has_room(2) && !executor.has_room(3));
            go.send(()).unwrap();
        };
        assert_eq!(pool.install(|| rayon::join(|| ask(&executor, 5), nested)).0, Some(5));
        assert!(executor.has_room(5));
    }

    #[test]
    fn a_silent_gpu_is_given_up_and_nobody_waits_for_its_thread() {
        let (executor, go, _) = waiting_executor(GpuUse::Optional, ROOM);
        for _ in 0..MOST_ABANDONED {
            assert!(executor.is_worth_asking(3));
            executor.benefit.note(false, 1, 1e-3);
            assert_eq!(ask(&executor, 5), None);
        }
        assert!(!executor.is_worth_asking(3));
        assert!(executor.benefit.figures().given_up.is_some_and(|why| why.contains("answer")));
        drop(executor);
        drop(go);
    }

    #[test]
    fn an_atlas_that_is_too_large_halves_the_limit() {
        let out_of_memory = || Err(GpuError::OutOfMemory);
        let (executor, _) = executor([out_of_memory(), out_of_memory()], []);
        let wide = [[0, 0], [10_000, 0], [0, 10_000]];
        // The leaf gets a coarser texture, twice.
        assert_eq!(known_by(&executor.mesh(&wide)), Some(0));
        let limit = executor.state.max_pixels.load(Ordering::Acquire);
        assert!(limit <= MAX_PIXELS / 4 && limit > MAX_PIXELS / 32, "{limit}");
    }

    #[test]
    fn if_even_a_small_atlas_does_not_fit_the_worker_does_the_leaf() {
        let (executor, _) = executor([Err(GpuError::OutOfMemory)], []);
        assert_eq!(ask(&executor, 5), None);
        assert_eq!(ask(&executor, 5), Some(5));
    }

    #[test]
    fn a_leaf_that_does_not_fit_alone_gets_no_mesh() {
        let (executor, _) = executor([], []);
        let long: Vec<Site> = (0..20_000).map(|x| [x, 0]).collect();
        assert_eq!(known_by(&executor.mesh(&long)), None);
        assert_eq!(ask(&executor, 5), Some(5));
    }

    #[test]
    fn a_lost_device_is_opened_again_once() {
        let (executor, reopens) = executor([], [lost(), Ok(()), lost()]);
        assert_eq!(ask(&executor, 5), Some(5));
        assert_eq!(reopens.load(Ordering::Acquire), 1);
        assert_eq!(ask(&executor, 6), None);
        assert_eq!(ask(&executor, 7), None);
        assert_eq!(reopens.load(Ordering::Acquire), 1);
    }

    #[test]
    fn a_refused_request_is_not_repeated() {
        let (executor, reopens) = executor([Err(GpuError::Refused("test".into()))], []);
        assert_eq!(ask(&executor, 5), None);
        assert_eq!(ask(&executor, 5), None);
        assert_eq!(reopens.load(Ordering::Acquire), 0);
    }
}
