//! Running work on a pool of threads, and while another thread waits.

use crate::{Error, Result, address_space, fault, interrupt};
use std::cell::Cell;
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::time::Duration;

thread_local! {
    /// The seconds of processor time that this thread has spent on other work while its own waited.
    static ELSEWHERE: Cell<f64> = const { Cell::new(0.0) };
}

/// Does another piece of work of the pool on this thread, while the thread's own piece waits for something. Returns whether there was any.
pub fn do_other_work() -> bool {
    let before = own_cpu_seconds();
    let worked = matches!(rayon::yield_now(), Some(rayon::Yield::Executed));
    ELSEWHERE.set(cpu_seconds() - before);
    worked
}

/// Returns the seconds of processor time that this thread has spent so far, without what it did while its own work waited; NaN where
/// the system does not tell.
pub fn own_cpu_seconds() -> f64 {
    cpu_seconds() - ELSEWHERE.get()
}

fn cpu_seconds() -> f64 {
    cpu_time::ThreadTime::try_now().map_or(f64::NAN, |time| time.as_duration().as_secs_f64())
}

/// The address space that a thread takes: its stack, and what starting it takes besides.
const BYTES_PER_THREAD: u64 = (2 << 20) + (64 << 10);
/// The address space that must be left besides the threads.
const RESERVE: u64 = 4 << 20;

/// Runs `work` in a rayon pool of `threads` threads.
///
/// # Errors
/// [`Error::Memory`] if the threads cannot be started, and the errors of `work`.
pub fn on_threads<T: Send, E: From<Error> + Send>(
    threads: usize,
    work: impl FnOnce() -> std::result::Result<T, E> + Send,
) -> std::result::Result<T, E> {
    // A thread that starts without room for its signal stack would end the process.
    let bytes = RESERVE + BYTES_PER_THREAD * threads as u64;
    address_space::require(bytes, address_space::left(), || format!("starting {threads} threads"))?;
    // Profilers, and the benchmark `serial`, tell the threads by their names.
    let name = |number| format!("worker {number}");
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).thread_name(name).build();
    let pool = pool.map_err(|e| Error::Memory(format!("cannot start {threads} threads: {e}")))?;
    pool.install(work)
}

/// Runs `work` while another thread runs `waiting`, which mostly waits for the disk. If no thread can be started, runs one after
/// the other.
///
/// # Errors
/// Those of `work`, then those of `waiting`.
pub fn run_concurrently<T, E: From<Error>>(
    waiting: impl Fn() -> Result<()> + Sync,
    work: impl FnOnce() -> std::result::Result<T, E>,
) -> std::result::Result<T, E> {
    std::thread::scope(|scope| match std::thread::Builder::new().spawn_scoped(scope, &waiting) {
        Ok(thread) => {
            let outcome = work();
            let waited = thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            outcome.and_then(|outcome| Ok(waited.map(|()| outcome)?))
        }
        Err(_) => {
            waiting()?;
            work()
        }
    })
}

/// Runs `work`, which cannot be stopped, on a thread of its own. If the process is asked to stop meanwhile, nobody waits for it any
/// longer, and it ends with the process.
///
/// # Errors
/// Those of `work`, [`Error::Interrupted`], or [`Error::Memory`] if no thread can be started.
pub fn unless_interrupted<T: Send + 'static>(work: impl FnOnce() -> Result<T> + Send + 'static) -> Result<T> {
    let (sender, receiver) = sync_channel(1);
    let send = move || {
        // After an interruption nobody receives it.
        let _ = sender.send(work());
    };
    let thread = std::thread::Builder::new().spawn(send);
    thread.map_err(|e| Error::Memory(format!("cannot start a thread: {e}")))?;
    loop {
        match receiver.recv_timeout(Duration::from_millis(100)) {
            Ok(outcome) => return outcome,
            Err(RecvTimeoutError::Timeout) => interrupt::check()?,
            Err(RecvTimeoutError::Disconnected) => {
                return Err(Error::Broken("a thread ended without a result".into()));
            }
        }
    }
}

/// Returns how many threads the machine runs at the same time.
pub fn available() -> usize {
    let processors = || std::thread::available_parallelism().map_or(1, |n| n.get());
    fault::processors().unwrap_or_else(processors)
}
