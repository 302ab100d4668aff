//! Leaves on a GPU. One thread opens the device and owns it; workers send it the sites of their leaves and wait for the meshes. All leaves
//! that wait share an atlas, as many as fit. If many wait, up to three atlases are in flight at once: while the GPU works on one, another is
//! gathered, and a third is read back.
//!
//! Every failure costs time and nothing else. After an atlas that is too large, the next ones have half the size. A lost device is
//! opened again once. If that does not help, every worker does its own leaves.
//!
//! A worker that waits for its mesh does other work of the job meanwhile, so that many leaves wait. If there is none, and the job could do
//! without the GPU, the worker soon does the leaf itself.

use crate::figures::GpuFigures;
use crate::on_device::benefit::GpuBenefit;
use crate::on_device::device;
use crate::on_device::device::{AdapterRequest, MAX_SIDE};
use crate::on_device::error::GpuError;
use crate::on_device::fake_engine;
use crate::on_device::fake_engine::FakeEngine;
use crate::on_device::filled_atlas::{AtlasLimits, MAX_PIXELS};
use crate::on_device::gpu_thread::{Filling, GpuState, GpuThread, MANY_SITES, MeshRequest};
use crate::on_device::mesh_engine::{GpuMeshEngine, MAX_IN_FLIGHT, MeshEngine};
use crate::on_device::recording::GpuStep;
use crate::options::{GpuOptions, TextureSide};
use delaunay::geometry::Site;
use delaunay::voronoi::mesh_reply::MeshReply;
use delaunay::voronoi::texture_request::TextureResolution;
use std::cell::Cell;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, TryRecvError, channel, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use sys::interrupt;
use sys::threads::do_other_work;

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
/// Smaller leaves are done before a GPU could answer.
const FEWEST_SITES: usize = 100;
/// With fewer pixels for each site, so many sites would share one that the device is of no use.
const FEWEST_PIXELS_PER_SITE: u64 = 4;
/// Bytes for each site of a leaf that waits: its point, and its position twice.
const BYTES_PER_WAITING_SITE: u64 = 50;
/// Bytes of a software renderer's buffers for each pixel, in all slots. They are the memory of this process.
const SOFTWARE_BYTES_PER_PIXEL: u64 = 180;
/// Bytes for each byte that comes back from an atlas: three slots have a buffer each into which the device copies them, up to a quarter too
/// large. What goes up takes about a quarter as much, in buffers that are up to twice too large.
const BYTES_PER_BYTE_BACK: u64 = 6;
/// While leaves of so many sites have no answer, a job that can do without the GPU asks for no more: the GPU has enough to do, and workers
/// do leaves themselves.
const BUSY: u64 = MAX_IN_FLIGHT as u64 * MANY_SITES as u64;
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
    /// What it has brought so far.
    benefit: GpuBenefit,
}

/// An engine that is open.
struct Opened<E> {
    engine: E,
    /// The adapter's name.
    adapter: String,
    capacity: Capacity,
    filling: Filling,
}

/// What the executor has room for.
#[derive(Clone, Copy)]
struct Capacity {
    /// The most pixels of an atlas.
    max_pixels: u32,
    /// The most sites of leaves that wait while their threads do other work.
    max_waiting: u64,
}

impl Executor {
    /// Starts a thread that opens an adapter as `options` say. Waits for that only if the job needs the GPU. The CPU's side may take `memory`
    /// bytes: a third each for the atlases in flight, for what has come back and is not read yet, and for the leaves that wait.
    ///
    /// # Errors
    /// A sentence that says why no GPU can be used.
    pub fn start(options: &GpuOptions, gpu_use: GpuUse, memory: u64) -> Result<Executor, String> {
        let resolution = match options.texture {
            TextureSide::Auto => TextureResolution::PixelsPerSite(PIXELS_PER_SITE),
            TextureSide::Max => TextureResolution::Side(MAX_SIDE),
            TextureSide::Side(side) => TextureResolution::Side(side),
        };
        let max_bytes = memory / 3 / BYTES_PER_BYTE_BACK;
        let filling = Filling { resolution, max_bytes };
        let capacity = Capacity { max_pixels: MAX_PIXELS, max_waiting: memory / 3 / BYTES_PER_WAITING_SITE };
        if let Some(engine) = FakeEngine::from_environment() {
            let open = move || Ok(Opened { engine, adapter: "no GPU".into(), capacity, filling });
            return Executor::on(open, capacity, gpu_use);
        }
        let request = AdapterRequest::new(options.adapter.as_deref(), gpu_use == GpuUse::Required);
        let voronoi = options.voronoi;
        let open = move || {
            let mut engine = GpuMeshEngine::open(request, voronoi, memory / 3)?;
            engine.warm_up()?;
            let device = engine.device();
            let (adapter, limits) = (device.info.name.clone(), AtlasLimits::of(&device.limits));
            let filling = Filling { max_bytes: max_bytes.min(limits.bytes), ..filling };
            let max_pixels = match device::is_software(&device.info) {
                true => limits.pixels.min(u32::try_from(memory / SOFTWARE_BYTES_PER_PIXEL).unwrap_or(u32::MAX)),
                false => limits.pixels,
            };
            Ok(Opened { engine, adapter, capacity: Capacity { max_pixels, ..capacity }, filling })
        };
        Executor::on(open, capacity, gpu_use)
    }

    fn on<E: MeshEngine + 'static>(
        open: impl FnOnce() -> Result<Opened<E>, GpuError> + Send + 'static,
        capacity: Capacity,
        gpu_use: GpuUse,
    ) -> Result<Executor, String> {
        let state = Arc::new(GpuState::new(capacity.max_pixels));
        let (sender, receiver) = channel();
        let (tell, told) = sync_channel(1);
        let of_thread = state.clone();
        let run = move || {
            // Nobody listens if the job can do without the GPU.
            match open() {
                Ok(Opened { engine, adapter, capacity, filling }) => {
                    of_thread.max_pixels.store(capacity.max_pixels, Ordering::Release);
                    of_thread.adapter.get_or_init(|| adapter);
                    let _ = tell.send(Ok(()));
                    GpuThread::new(engine, of_thread, filling).run(&receiver);
                }
                Err(error) => {
                    of_thread.is_gone.store(true, Ordering::Release);
                    let _ = tell.send(Err(error.to_string()));
                }
            }
        };
        let thread = std::thread::Builder::new().name("gpu".into()).spawn(run);
        let thread = Some(thread.map_err(|e| format!("the GPU's thread does not start: {e}"))?);
        if gpu_use == GpuUse::Required {
            told.recv().unwrap_or_else(|_| Err("the GPU's thread has ended".into()))?;
        }
        let benefit = GpuBenefit::new(gpu_use == GpuUse::Required);
        let (requests, max_waiting) = (Mutex::new(Some(sender)), capacity.max_waiting);
        Ok(Executor { requests, state, max_waiting, gpu_use, thread, benefit })
    }

    /// Returns the adapter's name, once it is open.
    pub fn adapter(&self) -> Option<&str> {
        self.state.adapter.get().map(String::as_str)
    }

    /// Tells whether an adapter is likely to be found. This is so cheap that every job may ask.
    pub fn is_likely() -> bool {
        device::hardware_is_likely()
    }

    /// Tells whether a test wants an engine that is no GPU.
    pub fn is_wanted_by_test() -> bool {
        fake_engine::is_wanted()
    }

    /// Returns the seconds that every step has taken on the GPU itself so far; nothing if the adapter has no timestamps.
    pub fn step_seconds(&self) -> Vec<(&'static str, f64)> {
        let seconds = |step: GpuStep| self.state.times[step as usize].load(Ordering::Relaxed) as f64 / 1e9;
        let steps = GpuStep::ALL.map(|step| (step.name(), seconds(step)));
        steps.into_iter().filter(|(_, seconds)| *seconds > 0.0).collect()
    }

    /// Notes that a leaf of `sites` sites took `seconds` of processor time, with help or alone.
    pub(crate) fn note(&self, is_helped: bool, sites: usize, seconds: f64) {
        self.benefit.note(is_helped, sites, seconds);
    }

    /// Notes that help was asked for a leaf, and that `reply` could not be used.
    pub(crate) fn note_in_vain(&self, reply: &MeshReply) {
        self.benefit.note_in_vain(reply);
    }

    /// Returns what it did so far.
    pub(crate) fn figures(&self) -> GpuFigures {
        let figures = self.benefit.figures();
        let failure = || self.state.failure.get().cloned();
        GpuFigures { given_up: failure().or(figures.given_up), ..figures }
    }

    /// Tells whether to ask for the mesh of the next leaf, which has `sites` sites.
    pub(crate) fn is_worth_asking(&self, sites: usize) -> bool {
        sites >= FEWEST_SITES
            && self.adapter().is_some()
            && (self.gpu_use == GpuUse::Required || self.has_room(sites as u64))
            && self.benefit.is_worth_asking()
    }

    /// Returns whether `sites` more sites may wait.
    fn has_room(&self, sites: u64) -> bool {
        let waiting = self.state.waiting.load(Ordering::Acquire);
        // As long as nothing is known of the device, only one leaf of a thread waits for it.
        let most = if self.state.has_answered.load(Ordering::Acquire) { MOST_NESTED } else { 1 };
        let is_busy = self.state.unanswered_sites.load(Ordering::Acquire) > BUSY;
        waiting.saturating_add(sites) <= self.max_waiting && !is_busy && NESTED.get() < most
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
        let timeout = self.timeout(sites.len());
        let (reply, answer) = sync_channel(1);
        let requests = self.requests.lock().unwrap_or_else(PoisonError::into_inner).clone()?;
        self.state.unanswered.fetch_add(1, Ordering::AcqRel);
        self.state.unanswered_sites.fetch_add(sites.len() as u64, Ordering::AcqRel);
        if requests.send(MeshRequest { sites: sites.to_vec(), start: Instant::now(), reply }).is_err() {
            self.state.unanswered.fetch_sub(1, Ordering::AcqRel);
            self.state.unanswered_sites.fetch_sub(sites.len() as u64, Ordering::AcqRel);
            return None;
        }
        let reply = self.wait_for(&answer, timeout);
        let is_late = reply.is_none() && self.gpu_use == GpuUse::Optional;
        if is_late && self.state.abandoned.fetch_add(1, Ordering::AcqRel) + 1 >= MOST_ABANDONED {
            self.state.is_gone.store(true, Ordering::Release);
            self.benefit.give_up("it does not answer in time");
        }
        reply
    }

    /// Returns how long an idle worker waits for the mesh of `sites` sites; `None` if as long as it takes.
    fn timeout(&self, sites: usize) -> Option<Duration> {
        let alone = self.benefit.seconds_alone(sites).map(|alone| Duration::from_secs_f64(PATIENCE_IN_LEAVES * alone));
        (self.gpu_use == GpuUse::Optional).then(|| alone.map_or(PATIENCE, |alone| alone.min(PATIENCE)))
    }

    /// Waits for an answer, and does other work meanwhile. Returns `None` once this thread has been idle for longer than `timeout`, or is
    /// to stop.
    fn wait_for(&self, answer: &Receiver<MeshReply>, timeout: Option<Duration>) -> Option<MeshReply> {
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
            self.state.idle.fetch_add(1, Ordering::AcqRel);
            let late = answer.recv_timeout(NAP);
            self.state.idle.fetch_sub(1, Ordering::AcqRel);
            match late {
                Ok(reply) => return Some(reply),
                Err(RecvTimeoutError::Disconnected) => return Some(MeshReply::Unavailable),
                // A process that was stopped for a while was not idle.
                Err(RecvTimeoutError::Timeout) => idle = idle.saturating_add(begun.elapsed().min(10 * NAP)),
            }
            let is_given_up = self.gpu_use == GpuUse::Optional && self.state.is_gone.load(Ordering::Acquire);
            if is_given_up || timeout.is_some_and(|timeout| idle > timeout) || interrupt::check().is_err() {
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
mod tests;
