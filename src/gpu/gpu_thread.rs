//! The thread that owns the device. It gathers the leaves that wait in atlases, keeps several atlases in flight, and decides what happens
//! after a failure.

use crate::geometry::Site;
use crate::gpu::atlas::Atlas;
use crate::gpu::error::GpuError;
use crate::gpu::filled_atlas::{AtlasLimits, FilledAtlas};
use crate::gpu::mesh_engine::{MAX_IN_FLIGHT, MeshEngine};
use crate::gpu::returned::ReturnedAtlas;
use crate::gpu::steps::GpuStep;
use crate::voronoi::mesh_reply::MeshReply;
use crate::voronoi::texture_request::TextureResolution;
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, SyncSender};
use std::sync::{Arc, OnceLock};

/// If an atlas with no more pixels than this does not fit, none will.
const MIN_PIXELS: u32 = 1 << 16;

/// What the workers and the GPU's thread share.
pub(super) struct GpuState {
    /// The most pixels that an atlas may have.
    pub(super) max_pixels: AtomicU32,
    /// The number of sites of the leaves that wait for their mesh.
    pub(super) waiting: AtomicU64,
    /// The number of requests without an answer, whether or not a worker still waits for it.
    pub(super) unanswered: AtomicUsize,
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
            max_pixels: AtomicU32::new(max_pixels),
            waiting: AtomicU64::new(0),
            unanswered: AtomicUsize::new(0),
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
    has_reopened: bool,
}

struct AtlasInFlight<P> {
    /// One for each leaf.
    requests: Vec<MeshRequest>,
    atlas: Atlas,
    slot: usize,
    pending: P,
}

impl<E: MeshEngine> GpuThread<E> {
    pub(super) fn new(engine: E, state: Arc<GpuState>, filling: Filling) -> GpuThread<E> {
        let free_slots = (0..MAX_IN_FLIGHT).collect();
        let (waiting, in_flight) = (VecDeque::new(), VecDeque::new());
        GpuThread { engine, state, filling, waiting, in_flight, free_slots, has_reopened: false }
    }

    /// Serves `requests` until all senders are gone.
    pub(super) fn run(&mut self, requests: &Receiver<MeshRequest>) {
        loop {
            if self.in_flight.is_empty() && self.waiting.is_empty() {
                let Ok(request) = requests.recv() else { return };
                self.waiting.push_back(request);
            }
            // While this thread was busy, more leaves may have come: they share the next atlas.
            self.waiting.extend(requests.try_iter());
            match self.free_slots.pop() {
                Some(slot) if !self.waiting.is_empty() => self.launch(slot),
                slot => {
                    self.free_slots.extend(slot);
                    self.land();
                }
            }
        }
    }

    /// Starts an atlas of the leaves that wait.
    fn launch(&mut self, slot: usize) {
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
                self.in_flight.push_back(AtlasInFlight { requests, atlas: filled.atlas, slot, pending });
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

    /// Fills an atlas with leaves that wait, the oldest first. A leaf that does not fit alone gets no mesh.
    fn gather(&mut self) -> (FilledAtlas, Vec<MeshRequest>) {
        let (mut filled, mut requests) = (FilledAtlas::default(), Vec::new());
        let Filling { resolution, max_bytes } = self.filling;
        let limits = AtlasLimits { pixels: self.state.max_pixels.load(Ordering::Acquire), bytes: max_bytes };
        while let Some(request) = self.waiting.pop_front() {
            if filled.add(&request.sites, resolution, limits) {
                requests.push(request);
            } else if requests.is_empty() {
                self.refuse(&request);
            } else {
                self.waiting.push_front(request);
                break;
            }
        }
        (filled, requests)
    }

    fn land(&mut self) {
        let Some(AtlasInFlight { requests, atlas, slot, pending }) = self.in_flight.pop_front() else { return };
        let mut replies = Vec::new();
        let done = self.engine.finish(slot, pending, &mut |numbers| replies = replies_of(&atlas, numbers));
        self.free_slots.push(slot);
        match done {
            Ok(times) => {
                for (sum, time) in self.state.times.iter().zip(times) {
                    sum.fetch_add(time, Ordering::Relaxed);
                }
                requests.iter().zip(replies).for_each(|(request, reply)| self.answer(request, reply));
            }
            Err(error) => self.recover(requests, &error),
        }
    }

    fn answer(&self, request: &MeshRequest, reply: MeshReply) {
        self.state.abandoned.store(0, Ordering::Release);
        self.state.has_answered.store(true, Ordering::Release);
        self.state.unanswered.fetch_sub(1, Ordering::AcqRel);
        // If sending fails, the worker no longer waits and needs no answer.
        let _ = request.reply.send(reply);
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
        requests.into_iter().rev().for_each(|request| self.waiting.push_front(request));
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

/// Returns the answer for every leaf of `atlas`, of which `numbers` came back.
fn replies_of(atlas: &Atlas, numbers: &[u32]) -> Vec<MeshReply> {
    let returned = ReturnedAtlas::new(atlas, numbers);
    let reply = |leaf| returned.map_or(MeshReply::Flagged, |returned| returned.reply(leaf));
    (0..atlas.leaves.len()).map(reply).collect()
}
