//! Signals: long work checks between its pieces whether the process should stop, so that finished work is kept.

use crate::{Error, ErrorKind, Result, fault};
use std::panic::Location;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock};

/// Whether a signal has come, or the end of standard input. Both concern the whole process, so this is global.
static STOP: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);

/// Makes Ctrl-C, SIGTERM and the hangup of the terminal (unless `nohup` says to ignore it) set what [`check`] sees; a second signal
/// ends the process at once, with the exit code that `code_of` gives. Also turns the signal for a file that grows beyond the limit of the
/// shell into an error of the write.
///
/// # Errors
/// [`Error::Io`] if the system refuses.
pub fn listen(code_of: impl Fn(ErrorKind) -> u8) -> Result<()> {
    use signal_hook::consts::{SIGINT, SIGTERM};
    let exit_code = i32::from(code_of(Error::Interrupted.kind()));
    let hangup = hangup().filter(|signal| !is_ignored(*signal));
    for signal in [SIGINT, SIGTERM].into_iter().chain(hangup) {
        // In this order. Otherwise the first signal would find the flag set and end the process.
        signal_hook::flag::register_conditional_shutdown(signal, exit_code, STOP.clone())
            .and_then(|_| signal_hook::flag::register(signal, STOP.clone()))
            .map_err(Error::io("listen to the signals of", "the system"))?;
    }
    #[cfg(unix)]
    signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default())
        .map_err(Error::io("listen to the signals of", "the system"))?;
    Ok(())
}

/// Makes the end of standard input set what [`check`] sees. The process that started this one holds the other end, and the system closes it
/// with that process, however it ends.
///
/// # Errors
/// [`Error::Memory`] if no thread can be started.
pub fn listen_to_stdin() -> Result<()> {
    let wait = || {
        // An error is an end too.
        let _ = std::io::copy(&mut std::io::stdin().lock(), &mut std::io::sink());
        STOP.store(true, Ordering::Relaxed);
    };
    let thread = std::thread::Builder::new().name("stdin".into()).spawn(wait);
    thread.map(|_| ()).map_err(|e| Error::Memory(format!("cannot start a thread: {e}")))
}

#[cfg(unix)]
fn hangup() -> Option<i32> {
    Some(signal_hook::consts::SIGHUP)
}

#[cfg(not(unix))]
fn hangup() -> Option<i32> {
    None
}

/// Tells whether this process ignores the signal, as `nohup` makes it. Where the system does not tell, the signal counts as ignored:
/// it keeps its meaning.
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let bits = ignored.and_then(|bits| u64::from_str_radix(bits.trim(), 16).ok());
    bits.is_none_or(|bits| bits >> (signal - 1) & 1 == 1)
}

/// Returns an error if the process was asked to stop. Long work calls this between its pieces.
///
/// # Errors
/// [`Error::Interrupted`] if the process was asked to stop.
#[track_caller]
#[inline]
pub fn check() -> Result<()> {
    if is_wanted(Location::caller()) { Err(Error::Interrupted) } else { Ok(()) }
}

/// Returns whether the process was asked to stop; the question is asked at `place`.
pub fn is_wanted(place: &'static Location<'static>) -> bool {
    if fault::is_signalled(place) {
        STOP.store(true, Ordering::Relaxed);
    }
    STOP.load(Ordering::Relaxed)
}
