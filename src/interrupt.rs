//! Signals: what asks the process to stop is noticed between pieces, leaves and tiles, so that finished work is kept.

use crate::{Error, Result};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock};

/// Signals are for the whole process, and so is this.
static STOP: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);

/// From here on Ctrl-C and SIGTERM set what [`check`] sees, and the second of them ends the process at once. A file that
/// passes the limit of the shell becomes an error of writing. The hangup signal keeps its meaning, for the sake of `nohup`.
///
/// # Errors
/// [`Error::Io`] if the system refuses.
pub fn listen() -> Result<()> {
    use signal_hook::consts::{SIGINT, SIGTERM};
    let again = i32::from(Error::Interrupted.exit_code());
    for signal in [SIGINT, SIGTERM] {
        // In this order: the first signal finds nothing set.
        signal_hook::flag::register_conditional_shutdown(signal, again, STOP.clone())
            .and_then(|_| signal_hook::flag::register(signal, STOP.clone()))
            .map_err(Error::io("listen to the signals of", "the system"))?;
    }
    #[cfg(unix)]
    signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default())
        .map_err(Error::io("listen to the signals of", "the system"))?;
    Ok(())
}

/// To be called in everything that takes long.
///
/// # Errors
/// [`Error::Interrupted`] if the process was asked to stop.
pub fn check() -> Result<()> {
    if STOP.load(Ordering::Relaxed) { Err(Error::Interrupted) } else { Ok(()) }
}
