//! Running work on threads.

use crate::{Error, Result};

/// Runs `work` in a rayon pool of `threads` threads.
///
/// # Errors
/// [`Error::Memory`] if the threads cannot be started, and the errors of `work`.
pub(crate) fn on_threads<T: Send>(threads: usize, work: impl FnOnce() -> Result<T> + Send) -> Result<T> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|e| Error::Memory(format!("cannot start {threads} threads: {e}")))?;
    pool.install(work)
}

/// Runs `work` while another thread runs `waiting`, which mostly waits for the disk. If no thread can be started, runs one after
/// the other.
///
/// # Errors
/// Those of `work`, then those of `waiting`.
pub(crate) fn run_concurrently<T>(
    waiting: impl Fn() -> Result<()> + Sync,
    work: impl FnOnce() -> Result<T>,
) -> Result<T> {
    std::thread::scope(|scope| match std::thread::Builder::new().spawn_scoped(scope, &waiting) {
        Ok(thread) => {
            let outcome = work();
            let waited = thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            outcome.and_then(|outcome| waited.map(|()| outcome))
        }
        Err(_) => waiting().and_then(|()| work()),
    })
}
