//! Bytes of a file that have come, or are to come.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::Duration;

use crate::remote::network::failure::{Failure, FailureKind};
use sys::catch_panic::catch_panic;
use sys::{Result, interrupt};

/// How often somebody who waits asks whether the process should stop.
const LOOK: Duration = Duration::from_millis(50);

/// The stack of a thread that fetches.
const STACK: usize = 1 << 20;

/// The bytes of all windows that are held or under way.
static HELD: AtomicU64 = AtomicU64::new(0);

/// Counts bytes from their request until they are dropped.
struct Space(u64);

impl Space {
    fn take(bytes: u64) -> Space {
        HELD.fetch_add(bytes, Ordering::Relaxed);
        Space(bytes)
    }
}

impl Drop for Space {
    fn drop(&mut self) {
        HELD.fetch_sub(self.0, Ordering::Relaxed);
    }
}

/// A run of bytes of a file.
pub(crate) struct Window {
    /// The position of the first byte in the file.
    pub(crate) start: u64,
    pub(crate) bytes: Vec<u8>,
    _space: Space,
}

impl Window {
    /// Returns bytes that have come from position `start` of a file.
    pub(crate) fn new(start: u64, bytes: Vec<u8>) -> Window {
        Window { start, _space: Space::take(bytes.len() as u64), bytes }
    }

    /// Returns the bytes from position `at` of the file on; `None` if the first of them is not here.
    pub(crate) fn from(&self, at: u64) -> Option<&[u8]> {
        let skipped = usize::try_from(at.checked_sub(self.start)?).ok()?;
        self.bytes.get(skipped..).filter(|rest| !rest.is_empty())
    }
}

/// Returns how many bytes all windows of the process hold or will hold.
pub(crate) fn held_bytes() -> u64 {
    HELD.load(Ordering::Relaxed)
}

/// A window that comes. All clones are one.
#[derive(Clone)]
pub(crate) struct Pending(Arc<Slot>);

struct Slot {
    outcome: Mutex<Option<std::result::Result<Arc<Window>, Failure>>>,
    came: Condvar,
}

impl Pending {
    /// Begins to fetch the bytes of `range` with `fetch`, on a thread of its own.
    pub(crate) fn begin(
        range: Range<u64>,
        fetch: impl Fn() -> std::result::Result<Vec<u8>, Failure> + Send + Sync + 'static,
    ) -> Pending {
        let slot = Arc::new(Slot { outcome: Mutex::new(None), came: Condvar::new() });
        let (space, start) = (Space::take(range.end - range.start), range.start);
        let fetch = Arc::new(fetch);
        let on_thread = (slot.clone(), fetch.clone());
        let work = move || on_thread.0.finish(start, &*on_thread.1, Some(space));
        if std::thread::Builder::new().name("fetch".into()).stack_size(STACK).spawn(work).is_err() {
            // Without a thread it takes longer.
            slot.finish(start, &*fetch, None);
        }
        Pending(slot)
    }

    /// Waits until the bytes are there.
    ///
    /// # Errors
    /// [`sys::Error::Interrupted`] if the process is to stop.
    pub(crate) fn wait(&self) -> Result<std::result::Result<Arc<Window>, Failure>> {
        let mut outcome = self.0.outcome.lock().unwrap_or_else(PoisonError::into_inner);
        loop {
            if let Some(outcome) = outcome.as_ref() {
                return Ok(outcome.clone());
            }
            interrupt::check()?;
            let waited = self.0.came.wait_timeout(outcome, LOOK);
            outcome = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}

impl Slot {
    fn finish(&self, start: u64, fetch: &dyn Fn() -> std::result::Result<Vec<u8>, Failure>, space: Option<Space>) {
        let outcome = catch_panic(fetch).unwrap_or_else(|panic| {
            Err(Failure::new(FailureKind::Refused, format!("the request cannot be made: {panic}")))
        });
        drop(space);
        let outcome = outcome.map(|bytes| Arc::new(Window::new(start, bytes)));
        *self.outcome.lock().unwrap_or_else(PoisonError::into_inner) = Some(outcome);
        self.came.notify_all();
    }
}
