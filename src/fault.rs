//! Faults on purpose: tests kill the process at places where a kill could do harm. CONTRIBUTING.md says how.

use std::sync::LazyLock;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// `GDT_FAULT=name:n` kills the process when it comes to the place of that name for the n-th time.
struct Fault {
    name: String,
    countdown: AtomicU64,
}

static FAULT: LazyLock<Option<Fault>> = LazyLock::new(|| {
    let text = std::env::var("GDT_FAULT").ok()?;
    let (name, count) = text.split_once(':')?;
    Some(Fault { name: name.into(), countdown: AtomicU64::new(count.parse().ok()?) })
});

/// Whether the process is to die at this place, the `name`d one, this time.
pub(crate) fn is_due(name: &str) -> bool {
    FAULT.as_ref().is_some_and(|fault| fault.name == name && fault.countdown.fetch_sub(1, Ordering::Relaxed) == 1)
}

/// Ends the process as `kill -9` would: nothing is flushed, nothing is cleaned up.
pub(crate) fn die() -> ! {
    #[cfg(unix)]
    let _ = signal_hook::low_level::raise(signal_hook::consts::SIGKILL);
    std::process::abort()
}

/// A place where a test may kill the process.
pub(crate) fn point(name: &str) {
    if is_due(name) {
        die();
    }
}

/// The time between two commits of a journal, where a test has it otherwise (`GDT_COMMIT_MS`).
pub(crate) fn commit_interval() -> Option<Duration> {
    std::env::var("GDT_COMMIT_MS").ok()?.parse().ok().map(Duration::from_millis)
}
