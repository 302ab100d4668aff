//! Running work while another thread waits.

use crate::Result;

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
