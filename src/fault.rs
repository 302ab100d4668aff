//! Faults on purpose: tests kill the process at places where a kill could do harm. CONTRIBUTING.md says how.
//!
//! Only builds with the feature `fault-injection` look for them. In all other builds these functions do nothing and read no
//! environment variable.

/// Ends the process like `kill -9`: nothing is flushed, nothing is cleaned up.
pub(crate) fn die() -> ! {
    #[cfg(unix)]
    let _ = signal_hook::low_level::raise(signal_hook::consts::SIGKILL);
    std::process::abort()
}

/// Marks a place where a test may kill the process.
pub(crate) fn point(name: &str) {
    if is_due(name) {
        die();
    }
}

pub(crate) use injection::{commit_interval, is_due};

#[cfg(feature = "fault-injection")]
mod injection {
    use std::sync::LazyLock;
    use std::sync::atomic::{AtomicU64, Ordering};
    use std::time::Duration;

    /// `GDT_FAULT=name:n` kills the process when it comes to the place of that name for the n-th time.
    struct RequestedFault {
        name: String,
        countdown: AtomicU64,
    }

    static REQUESTED: LazyLock<Option<RequestedFault>> = LazyLock::new(|| {
        let text = std::env::var("GDT_FAULT").ok()?;
        let (name, count) = text.split_once(':')?;
        Some(RequestedFault { name: name.into(), countdown: AtomicU64::new(count.parse().ok()?) })
    });

    /// Counts a visit to the place called `name` and returns whether the process must die there this time.
    pub(crate) fn is_due(name: &str) -> bool {
        REQUESTED
            .as_ref()
            .is_some_and(|fault| fault.name == name && fault.countdown.fetch_sub(1, Ordering::Relaxed) == 1)
    }

    /// Returns the least time between two commits of the journal if a test sets it (`GDT_COMMIT_MS`).
    pub(crate) fn commit_interval() -> Option<Duration> {
        std::env::var("GDT_COMMIT_MS").ok()?.parse().ok().map(Duration::from_millis)
    }
}

#[cfg(not(feature = "fault-injection"))]
mod injection {
    use std::time::Duration;

    #[inline(always)]
    pub(crate) fn is_due(_: &str) -> bool {
        false
    }

    #[inline(always)]
    pub(crate) fn commit_interval() -> Option<Duration> {
        None
    }
}
