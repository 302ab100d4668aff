//! Signals: long work checks between its pieces whether the process should stop, so that finished work is kept.

use crate::{Error, Result};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock};

/// Whether a signal has come. Signals concern the whole process, so this is global.
static STOP: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);

/// Makes Ctrl-C and SIGTERM set what [`check`] sees; a second one ends the process at once. Also turns the signal for a file that
/// grows beyond the limit of the shell into an error of the write. The hangup signal keeps its meaning, so that `nohup` works.
///
/// # Errors
/// [`Error::Io`] if the system refuses.
pub fn listen() -> Result<()> {
    use signal_hook::consts::{SIGINT, SIGTERM};
    let exit_code = i32::from(Error::Interrupted.exit_code());
    for signal in [SIGINT, SIGTERM] {
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

/// Returns an error if the process was asked to stop. Long work calls this between its pieces.
///
/// # Errors
/// [`Error::Interrupted`] if the process was asked to stop.
pub fn check() -> Result<()> {
    if STOP.load(Ordering::Relaxed) { Err(Error::Interrupted) } else { Ok(()) }
}
