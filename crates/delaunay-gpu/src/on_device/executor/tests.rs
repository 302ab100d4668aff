use super::*;
use crate::on_device::filled_atlas::FilledAtlas;
use crate::on_device::landed::Landed;
use crate::on_device::returned::ReturnedLayout;
use crate::on_device::timestamps::StepNanoseconds;
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
        MeshReply::Made(made) => (*made.numbers).as_ref().get(made.records.start).copied(),
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

    fn is_finished(&mut self, _: &Vec<u32>) -> bool {
        true
    }

    fn finish(&mut self, _: usize, pending: Vec<u32>) -> Result<Landed, GpuError> {
        self.finishes.pop_front().unwrap_or(Ok(()))?;
        Ok(Landed { numbers: Arc::new(pending), may_stay: false, times: StepNanoseconds::default() })
    }

    fn free(&mut self, _: usize) {}

    fn reopen(&mut self) -> Result<(), GpuError> {
        self.reopens.fetch_add(1, Ordering::AcqRel);
        Ok(())
    }
}

const MAX_PIXELS: u32 = 1 << 22;
const FINE: Filling = Filling { resolution: TextureResolution::Side(2000), max_bytes: 1 << 20 };
const CAPACITY: Capacity = Capacity { max_pixels: MAX_PIXELS, max_waiting: 1000 };

fn executor(
    starts: impl IntoIterator<Item = Result<(), GpuError>>,
    finishes: impl IntoIterator<Item = Result<(), GpuError>>,
) -> (Executor, Arc<AtomicUsize>) {
    let reopens = Arc::<AtomicUsize>::default();
    let (starts, finishes) = (starts.into_iter().collect(), finishes.into_iter().collect());
    let engine = ScriptedEngine { starts, finishes, reopens: reopens.clone() };
    (open(engine, CAPACITY, GpuUse::Required), reopens)
}

/// Returns an executor whose engine is open.
fn open<E: MeshEngine + 'static>(engine: E, capacity: Capacity, gpu_use: GpuUse) -> Executor {
    let executor =
        Executor::on(move || Ok(Opened { engine, adapter: "test".into(), capacity, filling: FINE }), capacity, gpu_use);
    let executor = executor.unwrap();
    while executor.adapter().is_none() {
        std::thread::yield_now();
    }
    executor
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

    fn is_finished(&mut self, _: &Vec<u32>) -> bool {
        true
    }

    fn finish(&mut self, _: usize, pending: Vec<u32>) -> Result<Landed, GpuError> {
        let _ = self.leaves.send(0);
        let _ = self.go.recv();
        Ok(Landed { numbers: Arc::new(pending), may_stay: false, times: StepNanoseconds::default() })
    }

    fn free(&mut self, _: usize) {}

    fn reopen(&mut self) -> Result<(), GpuError> {
        Ok(())
    }
}

fn waiting_executor(gpu_use: GpuUse, capacity: Capacity) -> (Executor, Sender<()>, Receiver<usize>) {
    let ((go, gone), (leaves, atlases)) = (channel(), channel());
    let engine = WaitingEngine { go: gone, leaves };
    (open(engine, capacity, gpu_use), go, atlases)
}

/// The mesh comes only after the other work, which only this thread can do.
#[test]
fn a_worker_does_other_work_while_it_waits() {
    let (executor, go, _) = waiting_executor(GpuUse::Required, CAPACITY);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let (reply, ()) = pool.install(|| rayon::join(|| ask(&executor, 5), || go.send(()).unwrap()));
    assert_eq!(reply, Some(5));
}

/// One thread has many leaves that wait. Those that come while the device is busy share an atlas.
#[test]
fn leaves_that_wait_share_an_atlas() {
    let (executor, go, atlases) = waiting_executor(GpuUse::Required, CAPACITY);
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
    let (executor, go, _) = waiting_executor(GpuUse::Optional, Capacity { max_waiting: 5, ..CAPACITY });
    executor.state.has_answered.store(true, Ordering::Release);
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
    let (executor, go, _) = waiting_executor(GpuUse::Optional, CAPACITY);
    for _ in 0..MOST_ABANDONED {
        assert!(executor.is_worth_asking(FEWEST_SITES));
        executor.benefit.note(false, 1, 1e-3);
        assert_eq!(ask(&executor, 5), None);
    }
    assert!(!executor.is_worth_asking(FEWEST_SITES));
    assert!(executor.benefit.figures().given_up.is_some_and(|why| why.contains("answer")));
    drop(executor);
    drop(go);
}

#[test]
fn before_the_first_answer_only_one_leaf_of_a_thread_waits() {
    let (executor, go, _) = waiting_executor(GpuUse::Optional, CAPACITY);
    let is_worth_asking_while_one_waits = || {
        NESTED.set(1);
        let is_worth = executor.is_worth_asking(FEWEST_SITES);
        NESTED.set(0);
        executor.benefit.note(false, 1, 1e-3);
        is_worth
    };
    assert!(!is_worth_asking_while_one_waits());
    executor.state.has_answered.store(true, Ordering::Release);
    assert!(is_worth_asking_while_one_waits());
    drop(executor);
    drop(go);
}

#[test]
fn a_leaf_that_waits_for_a_gpu_that_is_given_up_waits_no_longer() {
    let (executor, go, _) = waiting_executor(GpuUse::Optional, CAPACITY);
    executor.state.is_gone.store(true, Ordering::Release);
    let (_reply, answer) = sync_channel(1);
    assert!(executor.wait_for(&answer, None).is_none());
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
