//! Leaf after leaf on a GPU. One thread owns the device; workers send it textures and wait for the diagrams. Up to
//! [`IN_FLIGHT`] leaves are under way at once, each with its own buffers, so that one is computed while another comes back
//! and a third is repaired by the worker that sent it.
//!
//! Whatever goes wrong costs time only: too large a texture is asked for again at half the size, a lost device is opened anew
//! once, and after that every worker does its leaves itself.

use crate::gpu::Fault;
use crate::gpu::buffers::{Name, Set};
use crate::gpu::clock::StepTimes;
use crate::gpu::device::{self, Device, MOST_SIDE, Wish};
use crate::gpu::machine::{Machine, Ticket};
use crate::gpu::options::{TextureSide, VoronoiMethod};
use crate::gpu::steps::{Size, Step};
use crate::voronoi::{DiagramBackend, DiagramReply, TextureRequest, TextureResolution};
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

/// Leaves under way at once.
pub const IN_FLIGHT: usize = 3;
/// A texture with fewer pixels that does not fit says that nothing will.
const LEAST_PIXELS: u64 = 1 << 16;

/// What an executor is asked for.
#[derive(Clone, Debug)]
pub struct Order {
    /// Which adapter.
    pub wish: Wish,
    /// Which transform.
    pub voronoi: VoronoiMethod,
    /// How large the textures are.
    pub texture: TextureSide,
    /// Most pixels that there is room for on the CPU's side.
    pub most_pixels: u64,
    /// Whether workers do a leaf themselves while the GPU has enough to do.
    pub shared: bool,
}

/// A GPU at work.
pub struct Executor {
    requests: Mutex<Option<Sender<Request>>>,
    state: Arc<State>,
    resolution: TextureResolution,
    shared: bool,
    thread: Option<JoinHandle<()>>,
    /// The adapter's name.
    pub adapter: String,
}

/// What the workers and the GPU's thread both see.
struct State {
    most_pixels: AtomicU64,
    waiting: AtomicUsize,
    gone: AtomicBool,
    /// Nanoseconds by step on the GPU.
    times: [AtomicU64; Step::ALL.len()],
}

struct Request {
    work: Work,
    reply: SyncSender<DiagramReply>,
}

/// A texture to make the diagram of.
#[derive(Clone, Debug)]
struct Work {
    size: Size,
    pixels: Vec<u32>,
}

impl Executor {
    /// Opens an adapter and starts its thread.
    ///
    /// # Errors
    /// A sentence that says why there is no GPU to use.
    pub fn start(order: &Order) -> Result<Executor, String> {
        let engine = Engine::open(order.wish.clone(), order.voronoi).map_err(|fault| fault.to_string())?;
        let device = engine.machine.device();
        let adapter = device.info.name.clone();
        let most_pixels = device::most_pixels(&device.limits).min(order.most_pixels).max(1);
        let resolution = match order.texture {
            TextureSide::Auto => TextureRequest::default().resolution,
            TextureSide::Max => TextureResolution::Side(MOST_SIDE),
            TextureSide::Side(side) => TextureResolution::Side(side),
        };
        Executor::on(engine, adapter, resolution, most_pixels, order.shared)
    }

    fn on<E: Engines + 'static>(
        engine: E,
        adapter: String,
        resolution: TextureResolution,
        most_pixels: u64,
        shared: bool,
    ) -> Result<Executor, String> {
        let state = Arc::new(State {
            most_pixels: AtomicU64::new(most_pixels),
            waiting: AtomicUsize::new(0),
            gone: AtomicBool::new(false),
            times: Default::default(),
        });
        let (sender, receiver) = channel();
        let of_thread = state.clone();
        let run = move || Service::new(engine, of_thread).run(&receiver);
        let thread = std::thread::Builder::new().name("gpu".into()).spawn(run);
        let thread = Some(thread.map_err(|e| format!("the GPU's thread does not start: {e}"))?);
        Ok(Executor { requests: Mutex::new(Some(sender)), state, resolution, shared, thread, adapter })
    }

    /// Seconds that every step has taken on the GPU itself so far; none where the adapter does not tell.
    pub fn step_seconds(&self) -> Vec<(&'static str, f64)> {
        let seconds = |step: Step| self.state.times[step as usize].load(Ordering::Relaxed) as f64 / 1e9;
        Step::ALL.map(|step| (step.name(), seconds(step))).into_iter().filter(|(_, seconds)| *seconds > 0.0).collect()
    }

    /// Sends `work` and waits for its diagram; `None` if the thread is gone.
    fn ask(&self, work: Work) -> Option<DiagramReply> {
        let (reply, answer) = sync_channel(1);
        let requests = self.requests.lock().unwrap_or_else(PoisonError::into_inner).clone()?;
        requests.send(Request { work, reply }).ok()?;
        answer.recv().ok()
    }
}

impl DiagramBackend for Executor {
    fn shape(&self) -> TextureRequest {
        let most_pixels = self.state.most_pixels.load(Ordering::Acquire);
        TextureRequest { resolution: self.resolution, most_side: MOST_SIDE, most_pixels }
    }

    fn diagram(&self, width: u32, height: u32, pixels: Vec<u32>) -> DiagramReply {
        let waiting = self.state.waiting.fetch_add(1, Ordering::AcqRel);
        let busy = self.shared && waiting >= IN_FLIGHT;
        let answer = match busy || self.state.gone.load(Ordering::Acquire) {
            true => None,
            false => self.ask(Work { size: Size { width, height }, pixels }),
        };
        self.state.waiting.fetch_sub(1, Ordering::AcqRel);
        answer.unwrap_or(DiagramReply::No)
    }
}

impl Drop for Executor {
    fn drop(&mut self) {
        self.requests.get_mut().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(thread) = self.thread.take() {
            // A panic of the thread has made no result wrong; its workers have gone on by themselves.
            let _ = thread.join();
        }
    }
}

/// What the service needs of a GPU; in tests, one that fails on purpose.
trait Engines: Send {
    type Ticket;

    /// Starts `work` on the buffers of `slot`.
    fn start(&mut self, slot: usize, work: &Work) -> Result<Self::Ticket, Fault>;
    /// Waits for it.
    fn finish(&mut self, slot: usize, ticket: Self::Ticket) -> Result<(Vec<u32>, StepTimes), Fault>;
    /// Frees the buffers of `slot`.
    fn free(&mut self, slot: usize);
    /// Opens a lost device anew.
    fn reopen(&mut self) -> Result<(), Fault>;
}

/// A device and the buffers of the leaves in flight.
struct Engine {
    wish: Wish,
    voronoi: VoronoiMethod,
    machine: Machine,
    sets: [Set; IN_FLIGHT],
}

impl Engine {
    fn open(wish: Wish, voronoi: VoronoiMethod) -> Result<Engine, Fault> {
        Ok(Engine { machine: open(&wish)?, wish, voronoi, sets: Default::default() })
    }
}

fn open(wish: &Wish) -> Result<Machine, Fault> {
    let adapters = device::adapters();
    let infos: Vec<_> = adapters.iter().map(wgpu::Adapter::get_info).collect();
    let chosen = device::choose(&infos, wish).map_err(Fault::Absent)?;
    Ok(Machine::new(Device::open(&adapters[chosen])?))
}

impl Engines for Engine {
    type Ticket = Ticket;

    fn start(&mut self, slot: usize, work: &Work) -> Result<Ticket, Fault> {
        let recording = super::labels(work.size, work.pixels.clone(), self.voronoi);
        self.machine.start_and_fetch(&mut self.sets[slot], &recording, Name::Labels, 4 * work.size.pixels())
    }

    fn finish(&mut self, slot: usize, ticket: Ticket) -> Result<(Vec<u32>, StepTimes), Fault> {
        self.machine.finish(&self.sets[slot], ticket)
    }

    fn free(&mut self, slot: usize) {
        self.sets[slot].clear();
    }

    fn reopen(&mut self) -> Result<(), Fault> {
        self.sets = Default::default();
        self.machine = open(&self.wish)?;
        Ok(())
    }
}

/// The GPU's thread.
struct Service<E: Engines> {
    engine: E,
    state: Arc<State>,
    /// Oldest first.
    flights: VecDeque<Flight<E::Ticket>>,
    free: Vec<usize>,
    reopened: bool,
}

struct Flight<T> {
    request: Request,
    slot: usize,
    ticket: T,
}

impl<E: Engines> Service<E> {
    fn new(engine: E, state: Arc<State>) -> Service<E> {
        Service { engine, state, flights: VecDeque::new(), free: (0..IN_FLIGHT).collect(), reopened: false }
    }

    /// Serves until nobody can ask any more.
    fn run(&mut self, requests: &Receiver<Request>) {
        loop {
            let next = match (self.flights.is_empty(), self.free.is_empty()) {
                (true, _) => requests.recv().ok(),
                (false, false) => requests.try_recv().ok(),
                (false, true) => None,
            };
            match next {
                Some(request) => self.launch(request),
                None if self.flights.is_empty() => return,
                None => self.land(),
            }
        }
    }

    fn launch(&mut self, request: Request) {
        let Some(slot) = self.free.pop().filter(|_| !self.state.gone.load(Ordering::Acquire)) else {
            return answer(&request, DiagramReply::No);
        };
        match self.engine.start(slot, &request.work) {
            Ok(ticket) => self.flights.push_back(Flight { request, slot, ticket }),
            Err(Fault::OutOfMemory) => {
                self.engine.free(slot);
                self.free.push(slot);
                answer(&request, self.shrink(request.work.size.pixels()));
            }
            Err(fault) => {
                self.free.push(slot);
                self.recover(request, &fault);
            }
        }
    }

    fn land(&mut self) {
        let Some(Flight { request, slot, ticket }) = self.flights.pop_front() else { return };
        let done = self.engine.finish(slot, ticket);
        self.free.push(slot);
        match done {
            Ok((labels, times)) => {
                for (sum, time) in self.state.times.iter().zip(times) {
                    sum.fetch_add(time, Ordering::Relaxed);
                }
                answer(&request, DiagramReply::Labels(labels));
            }
            Err(fault) => self.recover(request, &fault),
        }
    }

    /// A texture of that many pixels does not fit.
    fn shrink(&self, pixels: u64) -> DiagramReply {
        if pixels <= LEAST_PIXELS {
            return DiagramReply::No;
        }
        self.state.most_pixels.fetch_min(pixels / 2, Ordering::AcqRel);
        DiagramReply::TooLarge
    }

    /// After `fault` hit `request`: does all that was under way again on the device opened anew, or gives the GPU up.
    fn recover(&mut self, request: Request, fault: &Fault) {
        let mut pending = vec![request];
        for flight in std::mem::take(&mut self.flights) {
            pending.push(flight.request);
            self.free.push(flight.slot);
        }
        let lost = matches!(fault, Fault::Lost(_)) && !std::mem::replace(&mut self.reopened, true);
        if !lost || self.engine.reopen().is_err() {
            self.state.gone.store(true, Ordering::Release);
        }
        pending.into_iter().for_each(|request| self.launch(request));
    }
}

fn answer(request: &Request, diagram: DiagramReply) {
    // A worker that does not wait any more needs no answer.
    let _ = request.reply.send(diagram);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A GPU that follows a script: what each start, in order, will come to when it is started or finished.
    struct Scripted {
        starts: VecDeque<Result<(), Fault>>,
        finishes: VecDeque<Result<(), Fault>>,
        reopens: Arc<AtomicUsize>,
    }

    impl Engines for Scripted {
        type Ticket = u32;

        fn start(&mut self, _: usize, work: &Work) -> Result<u32, Fault> {
            self.starts.pop_front().unwrap_or(Ok(())).map(|()| work.pixels[0])
        }

        fn finish(&mut self, _: usize, ticket: u32) -> Result<(Vec<u32>, StepTimes), Fault> {
            self.finishes.pop_front().unwrap_or(Ok(())).map(|()| (vec![ticket], StepTimes::default()))
        }

        fn free(&mut self, _: usize) {}

        fn reopen(&mut self) -> Result<(), Fault> {
            self.reopens.fetch_add(1, Ordering::AcqRel);
            Ok(())
        }
    }

    fn executor(
        starts: impl IntoIterator<Item = Result<(), Fault>>,
        finishes: impl IntoIterator<Item = Result<(), Fault>>,
    ) -> (Executor, Arc<AtomicUsize>) {
        let reopens = Arc::<AtomicUsize>::default();
        let (starts, finishes) = (starts.into_iter().collect(), finishes.into_iter().collect());
        let engine = Scripted { starts, finishes, reopens: reopens.clone() };
        let executor = Executor::on(engine, "test".into(), TextureResolution::Side(1), 1 << 28, false).unwrap();
        (executor, reopens)
    }

    fn lost() -> Result<(), Fault> {
        Err(Fault::Lost("test".into()))
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
    fn too_large_a_texture_halves_what_is_asked_for_next() {
        let (executor, _) = executor([Err(Fault::OutOfMemory), Err(Fault::OutOfMemory)], []);
        assert_eq!(executor.diagram(8192, 8192, vec![5]), DiagramReply::TooLarge);
        assert_eq!(executor.shape().most_pixels, 1 << 25);
        // If even a small one does not fit, the worker does it.
        assert_eq!(executor.diagram(16, 16, vec![5]), DiagramReply::No);
        assert_eq!(executor.diagram(16, 16, vec![5]), DiagramReply::Labels(vec![5]));
    }

    #[test]
    fn a_lost_device_is_opened_anew_once() {
        let (executor, reopens) = executor([], [lost(), Ok(()), lost()]);
        assert_eq!(executor.diagram(9, 9, vec![5]), DiagramReply::Labels(vec![5]));
        assert_eq!(reopens.load(Ordering::Acquire), 1);
        assert_eq!(executor.diagram(9, 9, vec![6]), DiagramReply::No);
        assert_eq!(executor.diagram(9, 9, vec![7]), DiagramReply::No);
        assert_eq!(reopens.load(Ordering::Acquire), 1);
    }

    #[test]
    fn a_refusal_is_not_tried_again() {
        let (executor, reopens) = executor([Err(Fault::Refused("test".into()))], []);
        assert_eq!(executor.diagram(9, 9, vec![5]), DiagramReply::No);
        assert_eq!(executor.diagram(9, 9, vec![5]), DiagramReply::No);
        assert_eq!(reopens.load(Ordering::Acquire), 0);
    }
}
