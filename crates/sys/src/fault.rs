//! Faults on purpose: tests kill or stop the process at places where a kill could do harm, let reads fail, and have every change of a file
//! written down. CONTRIBUTING.md says how.
//!
//! A process looks for them only after [`allow`], which the program calls if it is built with the feature `fault-injection`. In all others
//! these functions do nothing and read no environment variable.

use std::fs::File;
use std::io::{self, Write};
use std::panic::Location;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{LazyLock, Mutex, PoisonError};
use std::time::Duration;

/// Whether this process looks for faults.
static IS_ALLOWED: AtomicBool = AtomicBool::new(false);

/// "Input/output error".
const EIO: i32 = 5;

/// Lets this process look for faults. Comes before anything else.
pub fn allow() {
    IS_ALLOWED.store(true, Ordering::Relaxed);
}

/// Returns an environment variable of tests, if this process may look for it.
pub fn variable(name: &str) -> Option<String> {
    IS_ALLOWED.load(Ordering::Relaxed).then(|| std::env::var(name).ok())?
}

/// Ends the process like `kill -9`: nothing is flushed, nothing is cleaned up.
pub fn die() -> ! {
    #[cfg(unix)]
    let _ = signal_hook::low_level::raise(signal_hook::consts::SIGKILL);
    std::process::abort()
}

/// Marks a place where a test may kill the process, or stop it until a signal lets it continue (`GDT_STOPS`).
#[inline]
pub fn point(name: &str) {
    mark(name);
    if is_due(name) {
        if variable("GDT_STOPS").is_none() {
            die();
        }
        #[cfg(unix)]
        let _ = signal_hook::low_level::raise(signal_hook::consts::SIGSTOP);
    }
}

/// Marks a place that reads from a disk, or asks what is there, which a test may let fail as a broken disk does.
#[inline]
pub fn read(name: &str) -> io::Result<()> {
    if is_due(name) { Err(io::Error::from_raw_os_error(EIO)) } else { Ok(()) }
}

/// `GDT_FAULT=name:n` makes the process fail when it comes to the place of that name for the n-th time; `name:n+` also at every
/// later time.
struct RequestedFault {
    name: String,
    count: u64,
    and_later: bool,
    visits: AtomicU64,
}

static REQUESTED: LazyLock<Option<RequestedFault>> = LazyLock::new(|| {
    let text = variable("GDT_FAULT")?;
    let (name, count) = text.split_once(':')?;
    let and_later = count.ends_with('+');
    let count = count.trim_end_matches('+').parse().ok()?;
    Some(RequestedFault { name: name.into(), count, and_later, visits: AtomicU64::new(0) })
});

/// Counts a visit to the place called `name` and returns whether the process must fail there this time.
#[inline]
pub fn is_due(name: &str) -> bool {
    REQUESTED.as_ref().is_some_and(|fault| {
        fault.name == name && {
            let visit = fault.visits.fetch_add(1, Ordering::Relaxed) + 1;
            visit == fault.count || fault.and_later && visit > fault.count
        }
    })
}

/// Returns whether a test has a signal come now that this place asks for one. All places in a file have one name.
#[inline]
pub fn is_signalled(place: &Location) -> bool {
    let file = || Path::new(place.file()).file_stem().unwrap_or_default();
    REQUESTED.is_some() && is_due(&format!("signal-{}", file().display()))
}

/// Tells whether a test wants young jobs to wait for the disk as often as long ones (`GDT_SYNC`).
pub fn syncs_always() -> bool {
    variable("GDT_SYNC").is_some()
}

/// Returns how long servers may be silent if a test sets it (`GDT_TIMEOUT_MS`).
pub fn network_timeout() -> Option<Duration> {
    variable("GDT_TIMEOUT_MS")?.parse().ok().map(Duration::from_millis)
}

/// Returns the number of processors if a test sets it (`GDT_PROCESSORS`).
pub fn processors() -> Option<usize> {
    variable("GDT_PROCESSORS")?.parse().ok()
}

/// Returns the pixels along the longer side of a preview if a test sets them (`GDT_PREVIEW`).
pub fn preview_side() -> Option<u64> {
    variable("GDT_PREVIEW")?.parse().ok().filter(|&side| side > 0)
}

/// The file in which all changes of files are written down (`GDT_TRACE`).
static TRACE: LazyLock<Option<Mutex<File>>> =
    LazyLock::new(|| variable("GDT_TRACE").and_then(|path| File::create(path).ok()).map(Mutex::new));

/// Does a change, unless it must fail, and writes it down.
pub fn traced<'a, T>(
    change: impl FnOnce() -> io::Result<T>,
    describe: impl FnOnce(&T) -> (String, &'a [u8]),
) -> io::Result<T> {
    written_down(|| read("change").and_then(|()| change()), describe)
}

/// Does a change and writes it down: a line, and the bytes that it announces. One change at a time, so that the order is the
/// true one.
fn written_down<'a, T>(
    change: impl FnOnce() -> io::Result<T>,
    describe: impl FnOnce(&T) -> (String, &'a [u8]),
) -> io::Result<T> {
    let Some(trace) = TRACE.as_ref() else { return change() };
    let mut trace = trace.lock().unwrap_or_else(PoisonError::into_inner);
    let done = change()?;
    let (line, bytes) = describe(&done);
    trace.write_all(&[line.as_bytes(), b"\n", bytes].concat())?;
    Ok(done)
}

/// Writes down that the process came to the place called `name`.
pub fn mark(name: &str) {
    // Only the tests read the trace, and they notice if it is cut off.
    let _ = written_down(|| Ok(()), |()| (format!("mark {name}"), &[]));
}
