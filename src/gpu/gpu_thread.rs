//! The thread that owns the device. It keeps several leaves in flight and decides what happens after a failure.

use crate::gpu::diagram_engine::{DiagramEngine, MAX_IN_FLIGHT, TextureSites};
use crate::gpu::error::GpuError;
use crate::gpu::steps::GpuStep;
use crate::voronoi::diagram_backend::DiagramReply;
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, SyncSender};

/// If a texture with no more pixels than this does not fit, none will.
const MIN_PIXELS: u64 = 1 << 16;

/// What the workers and the GPU's thread share.
pub(super) struct GpuState {
    /// The most pixels that a texture may have.
    pub(super) max_pixels: AtomicU64,
    /// The number of workers that wait for a diagram.
    pub(super) waiting: AtomicUsize,
    /// The number of requests without an answer, whether or not a worker still waits for it.
    pub(super) unanswered: AtomicUsize,
    /// How many workers in a row have stopped waiting.
    pub(super) abandoned: AtomicUsize,
    /// Whether the GPU can no longer be used.
    pub(super) is_gone: AtomicBool,
    /// Nanoseconds per step on the GPU.
    pub(super) times: [AtomicU64; GpuStep::ALL.len()],
}

impl GpuState {
    /// Returns the state of a GPU that has done nothing yet, with room for `max_pixels` pixels.
    pub(super) fn new(max_pixels: u64) -> GpuState {
        GpuState {
            max_pixels: AtomicU64::new(max_pixels),
            waiting: AtomicUsize::new(0),
            unanswered: AtomicUsize::new(0),
            abandoned: AtomicUsize::new(0),
            is_gone: AtomicBool::new(false),
            times: Default::default(),
        }
    }
}

/// A worker's request for a diagram.
pub(super) struct DiagramRequest {
    pub(super) sites: TextureSites,
    pub(super) reply: SyncSender<DiagramReply>,
}

/// The state of the GPU's thread.
pub(super) struct GpuThread<E: DiagramEngine> {
    engine: E,
    state: Arc<GpuState>,
    /// The oldest leaf is first.
    in_flight: VecDeque<LeafInFlight<E::Pending>>,
    free_slots: Vec<usize>,
    has_reopened: bool,
}

struct LeafInFlight<P> {
    request: DiagramRequest,
    slot: usize,
    pending: P,
}

impl<E: DiagramEngine> GpuThread<E> {
    pub(super) fn new(engine: E, state: Arc<GpuState>) -> GpuThread<E> {
        let free_slots = (0..MAX_IN_FLIGHT).collect();
        GpuThread { engine, state, in_flight: VecDeque::new(), free_slots, has_reopened: false }
    }

    /// Serves `requests` until all senders are gone.
    pub(super) fn run(&mut self, requests: &Receiver<DiagramRequest>) {
        loop {
            let next = match (self.in_flight.is_empty(), self.free_slots.is_empty()) {
                (true, _) => requests.recv().ok(),
                (false, false) => requests.try_recv().ok(),
                (false, true) => None,
            };
            match next {
                Some(request) => self.launch(request),
                None if self.in_flight.is_empty() => return,
                None => self.land(),
            }
        }
    }

    fn launch(&mut self, request: DiagramRequest) {
        let is_gone = self.state.is_gone.load(Ordering::Acquire);
        let Some(slot) = self.free_slots.pop().filter(|_| !is_gone) else {
            return self.answer(&request, DiagramReply::Unavailable);
        };
        match self.engine.start(slot, &request.sites) {
            Ok(pending) => self.in_flight.push_back(LeafInFlight { request, slot, pending }),
            Err(GpuError::OutOfMemory) => {
                self.engine.free(slot);
                self.free_slots.push(slot);
                let reply = self.shrink(request.sites.size.pixels());
                self.answer(&request, reply);
            }
            Err(error) => {
                self.free_slots.push(slot);
                self.recover(request, &error);
            }
        }
    }

    fn land(&mut self) {
        let Some(LeafInFlight { request, slot, pending }) = self.in_flight.pop_front() else { return };
        let done = self.engine.finish(slot, pending);
        self.free_slots.push(slot);
        match done {
            Ok((labels, times)) => {
                for (sum, time) in self.state.times.iter().zip(times) {
                    sum.fetch_add(time, Ordering::Relaxed);
                }
                self.answer(&request, DiagramReply::Labels(labels));
            }
            Err(error) => self.recover(request, &error),
        }
    }

    fn answer(&self, request: &DiagramRequest, reply: DiagramReply) {
        self.state.abandoned.store(0, Ordering::Release);
        self.state.unanswered.fetch_sub(1, Ordering::AcqRel);
        // If sending fails, the worker no longer waits and needs no answer.
        let _ = request.reply.send(reply);
    }

    /// Lowers the limit after a texture of `pixels` pixels did not fit.
    fn shrink(&self, pixels: u64) -> DiagramReply {
        if pixels <= MIN_PIXELS {
            return DiagramReply::Unavailable;
        }
        self.state.max_pixels.fetch_min(pixels / 2, Ordering::AcqRel);
        DiagramReply::TooLarge
    }

    /// After `request` failed with `error`: opens the device again and repeats all leaves in flight, or gives the GPU up.
    fn recover(&mut self, request: DiagramRequest, error: &GpuError) {
        let mut pending = vec![request];
        for leaf in std::mem::take(&mut self.in_flight) {
            pending.push(leaf.request);
            self.free_slots.push(leaf.slot);
        }
        let may_reopen = matches!(error, GpuError::Lost(_)) && !std::mem::replace(&mut self.has_reopened, true);
        if !may_reopen || self.engine.reopen().is_err() {
            self.state.is_gone.store(true, Ordering::Release);
        }
        pending.into_iter().for_each(|request| self.launch(request));
    }
}
