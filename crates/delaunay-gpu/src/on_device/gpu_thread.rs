//! The thread that owns the device. It gathers the leaves that wait in atlases, keeps several atlases in flight, and decides what happens
//! after a failure.

use crate::on_device::atlas::Atlas;
use crate::on_device::error::GpuError;
use crate::on_device::filled_atlas::{AtlasLimits, FilledAtlas};
use crate::on_device::landed::Landed;
use crate::on_device::mesh_engine::{MAX_IN_FLIGHT, MeshEngine};
use crate::on_device::recording::GpuStep;
use crate::on_device::returned::replies;
use delaunay::geometry::Site;
use delaunay::voronoi::mesh_reply::MeshReply;
use delaunay::voronoi::texture_request::TextureResolution;
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

/// If an atlas with no more pixels than this does not fit, none will.
const MIN_PIXELS: u32 = 1 << 16;
/// An atlas starts once leaves of so many sites wait: with fewer, its dispatches cost more than its work.
const ENOUGH_SITES: usize = 100_000;
/// Or once a leaf has waited for so long, or a worker has nothing else to do.
const SHORT: Duration = Duration::from_millis(5);
/// A leaf that has waited for so long comes first.
const TOO_LONG: Duration = Duration::from_millis(200);
/// An atlas takes no more leaves once it has so many sites: a large GPU is as fast with them as with ten times as many, which would only come
/// back later, in buffers that take long to create.
pub(super) const MANY_SITES: usize = 250_000;
/// The thread looks after an atlas, or after leaves that wait, whenever this share of the time since the start has passed.
const LOOKS: u32 = 16;
/// But it rests at least, and at most, for these times.
const RESTS: [Duration; 2] = [Duration::from_micros(20), Duration::from_millis(1)];
/// An atlas in flight for longer is waited for, until the device counts as lost.
const LONG: Duration = Duration::from_secs(5);

/// What the workers and the GPU's thread share.
pub(super) struct GpuState {
    /// The adapter's name, once the device is open.
    pub(super) adapter: OnceLock<String>,
    /// The most pixels that an atlas may have.
    pub(super) max_pixels: AtomicU32,
    /// The number of sites of the leaves that wait for their mesh.
    pub(super) waiting: AtomicU64,
    /// The number of requests without an answer, whether or not a worker still waits for it.
    pub(super) unanswered: AtomicUsize,
    /// The number of their sites.
    pub(super) unanswered_sites: AtomicU64,
    /// How many workers have nothing else to do than to wait for their mesh.
    pub(super) idle: AtomicUsize,
    /// How many workers in a row have stopped waiting.
    pub(super) abandoned: AtomicUsize,
    /// Whether any leaf has had an answer.
    pub(super) has_answered: AtomicBool,
    /// Whether the GPU can no longer be used.
    pub(super) is_gone: AtomicBool,
    /// Why the device can no longer be used.
    pub(super) failure: OnceLock<String>,
    /// Nanoseconds per step on the GPU.
    pub(super) times: [AtomicU64; GpuStep::ALL.len()],
}

impl GpuState {
    /// Returns the state of a GPU that has done nothing yet, with room for `max_pixels` pixels.
    pub(super) fn new(max_pixels: u32) -> GpuState {
        GpuState {
            adapter: OnceLock::new(),
            max_pixels: AtomicU32::new(max_pixels),
            waiting: AtomicU64::new(0),
            unanswered: AtomicUsize::new(0),
            unanswered_sites: AtomicU64::new(0),
            idle: AtomicUsize::new(0),
            abandoned: AtomicUsize::new(0),
            has_answered: AtomicBool::new(false),
            is_gone: AtomicBool::new(false),
            failure: OnceLock::new(),
            times: Default::default(),
        }
    }
}

/// A worker's request for the mesh of a leaf.
pub(super) struct MeshRequest {
    pub(super) sites: Vec<Site>,
    /// When the worker asked.
    pub(super) start: Instant,
    pub(super) reply: SyncSender<MeshReply>,
}

/// How the thread fills atlases.
#[derive(Clone, Copy, Debug)]
pub(super) struct Filling {
    /// How fine the textures are.
    pub(super) resolution: TextureResolution,
    /// The most bytes that come back from an atlas.
    pub(super) max_bytes: u64,
}

/// The state of the GPU's thread.
pub(super) struct GpuThread<E: MeshEngine> {
    engine: E,
    state: Arc<GpuState>,
    filling: Filling,
    /// The leaves that are in no atlas yet. The oldest is first.
    waiting: VecDeque<MeshRequest>,
    /// The oldest atlas is first.
    in_flight: VecDeque<AtlasInFlight<E::Pending>>,
    free_slots: Vec<usize>,
    /// The memory of an atlas that has gone up.
    unused: FilledAtlas,
    has_reopened: bool,
}

struct AtlasInFlight<P> {
    /// One for each leaf.
    requests: Vec<MeshRequest>,
    atlas: Atlas,
    slot: usize,
    pending: P,
    start: Instant,
}

impl<E: MeshEngine> GpuThread<E> {
    pub(super) fn new(engine: E, state: Arc<GpuState>, filling: Filling) -> GpuThread<E> {
        let free_slots = (0..MAX_IN_FLIGHT).collect();
        let (waiting, in_flight) = (VecDeque::new(), VecDeque::new());
        let unused = FilledAtlas::default();
        GpuThread { engine, state, filling, waiting, in_flight, free_slots, unused, has_reopened: false }
    }

    /// Serves `requests` until all senders are gone.
    pub(super) fn run(&mut self, requests: &Receiver<MeshRequest>) {
        while self.await_work(requests) {
            self.waiting.extend(requests.try_iter());
            if self.may_launch() {
                self.launch();
            } else if self.has_landed() {
                self.land();
            }
        }
    }

    /// Waits for a leaf, or if atlases are in flight, for a short time. Returns whether there is anything to do, now or later.
    fn await_work(&mut self, requests: &Receiver<MeshRequest>) -> bool {
        if self.may_launch() || self.has_landed() {
            return true;
        }
        let oldest = self.in_flight.front().map(|atlas| atlas.start);
        let request = match oldest.or(self.waiting.front().map(|request| request.start)) {
            None => requests.recv().map_err(|_| RecvTimeoutError::Disconnected),
            Some(start) => requests.recv_timeout((start.elapsed() / LOOKS).clamp(RESTS[0], RESTS[1])),
        };
        match request {
            Ok(request) => self.waiting.push_back(request),
            Err(RecvTimeoutError::Timeout) => {}
            // Nobody waits for what is in flight.
            Err(RecvTimeoutError::Disconnected) => return false,
        }
        true
    }

    /// Returns whether the leaves that wait may start.
    fn may_launch(&self) -> bool {
        let Some(oldest) = self.waiting.front().filter(|_| !self.free_slots.is_empty()) else { return false };
        let is_enough = || self.waiting.iter().map(|request| request.sites.len()).sum::<usize>() >= ENOUGH_SITES;
        let is_awaited = || self.state.idle.load(Ordering::Acquire) > 0 || oldest.start.elapsed() > SHORT;
        is_enough() || self.in_flight.is_empty() && is_awaited()
    }

    /// Returns whether the oldest atlas has come back, or will be waited for.
    fn has_landed(&mut self) -> bool {
        let Some(oldest) = self.in_flight.front() else { return false };
        oldest.start.elapsed() > LONG || self.engine.is_finished(&oldest.pending)
    }

    /// Starts an atlas of the leaves that wait.
    fn launch(&mut self) {
        let Some(slot) = self.free_slots.pop() else { return };
        if self.state.is_gone.load(Ordering::Acquire) {
            self.free_slots.push(slot);
            return std::mem::take(&mut self.waiting).iter().for_each(|request| self.refuse(request));
        }
        let (filled, requests) = self.gather();
        if requests.is_empty() {
            return self.free_slots.push(slot);
        }
        match self.engine.start(slot, &filled) {
            Ok(pending) => {
                let (atlas, start) = (filled.atlas.clone(), Instant::now());
                self.unused = filled;
                self.in_flight.push_back(AtlasInFlight { requests, atlas, slot, pending, start });
            }
            Err(GpuError::OutOfMemory) => {
                self.engine.free(slot);
                self.free_slots.push(slot);
                self.shrink(filled.atlas.pixels, requests);
            }
            Err(error) => {
                self.free_slots.push(slot);
                self.recover(requests, &error);
            }
        }
    }

    /// Fills an atlas with leaves that wait. The newest come first: a worker that does other work while it waits can use only the answer to
    /// its last request, and until it has used that, what has come back for earlier ones keeps its memory. A leaf that does not fit alone
    /// gets no mesh.
    fn gather(&mut self) -> (FilledAtlas, Vec<MeshRequest>) {
        let (mut filled, mut requests) = (std::mem::take(&mut self.unused), Vec::new());
        filled.clear();
        let Filling { resolution, max_bytes } = self.filling;
        let limits = AtlasLimits { pixels: self.state.max_pixels.load(Ordering::Acquire), bytes: max_bytes };
        while filled.sites.len() < MANY_SITES
            && let Some(request) = self.next()
        {
            if filled.add(&request.sites, resolution, limits) {
                requests.push(request);
            } else if requests.is_empty() {
                self.refuse(&request);
            } else {
                self.waiting.push_back(request);
                break;
            }
        }
        (filled, requests)
    }

    /// Takes the newest leaf that waits, or the oldest one if that has waited for long: nobody waits for ever.
    fn next(&mut self) -> Option<MeshRequest> {
        match self.waiting.front()?.start.elapsed() > TOO_LONG {
            true => self.waiting.pop_front(),
            false => self.waiting.pop_back(),
        }
    }

    fn land(&mut self) {
        let Some(AtlasInFlight { requests, atlas, slot, pending, .. }) = self.in_flight.pop_front() else { return };
        let done = self.engine.finish(slot, pending);
        self.free_slots.push(slot);
        match done {
            Ok(Landed { numbers, may_stay, times }) => {
                for (sum, time) in self.state.times.iter().zip(times) {
                    sum.fetch_add(time, Ordering::Relaxed);
                }
                let replies = replies(&atlas, &numbers, may_stay);
                requests.iter().zip(replies).for_each(|(request, reply)| self.answer(request, reply));
            }
            Err(error) => self.recover(requests, &error),
        }
    }

    fn answer(&self, request: &MeshRequest, reply: MeshReply) {
        self.state.has_answered.store(true, Ordering::Release);
        self.state.unanswered.fetch_sub(1, Ordering::AcqRel);
        self.state.unanswered_sites.fetch_sub(request.sites.len() as u64, Ordering::AcqRel);
        // If sending fails, the worker no longer waits and needs no answer.
        if request.reply.send(reply).is_ok() {
            self.state.abandoned.store(0, Ordering::Release);
        }
    }

    fn refuse(&self, request: &MeshRequest) {
        self.answer(request, MeshReply::Unavailable);
    }

    /// Lowers the limit after an atlas of `pixels` pixels did not fit.
    fn shrink(&mut self, pixels: u32, requests: Vec<MeshRequest>) {
        if pixels <= MIN_PIXELS {
            return requests.iter().for_each(|request| self.refuse(request));
        }
        self.state.max_pixels.fetch_min(pixels / 2, Ordering::AcqRel);
        self.put_back(requests);
    }

    fn put_back(&mut self, requests: Vec<MeshRequest>) {
        self.waiting.extend(requests.into_iter().rev());
    }

    /// After the atlas of `requests` failed with `error`: opens the device again and repeats all leaves in flight, or gives the GPU up.
    fn recover(&mut self, requests: Vec<MeshRequest>, error: &GpuError) {
        for atlas in std::mem::take(&mut self.in_flight).into_iter().rev() {
            self.put_back(atlas.requests);
            self.free_slots.push(atlas.slot);
        }
        self.put_back(requests);
        let may_reopen = matches!(error, GpuError::Lost(_)) && !std::mem::replace(&mut self.has_reopened, true);
        let failure = if may_reopen { self.engine.reopen().err() } else { Some(error.clone()) };
        if let Some(failure) = failure {
            self.state.failure.get_or_init(|| failure.to_string());
            self.state.is_gone.store(true, Ordering::Release);
        }
    }
}
