//! What a program around the library may offer it: whether to stop, and a clock.

use crate::error::{Error, Result};
use std::panic::Location;
use std::sync::OnceLock;

/// What a program offers. Without one, nothing stops a triangulation, and steps take no time.
#[derive(Clone, Copy, Debug)]
pub struct Host {
    /// Returns whether to stop. Long work asks between its pieces, and tells where it is.
    pub is_stopped: fn(&'static Location<'static>) -> bool,
    /// Returns the seconds of processor time that this thread has spent so far; NaN where they are not known.
    pub cpu_seconds: fn() -> f64,
}

static HOST: OnceLock<Host> = OnceLock::new();

/// Makes `host` that of this process. Only the first call counts.
pub fn set(host: Host) {
    HOST.get_or_init(|| host);
}

/// Returns an error if the host asks to stop.
///
/// # Errors
/// [`Error::Stopped`].
#[track_caller]
pub(crate) fn check() -> Result<()> {
    let place = Location::caller();
    match HOST.get() {
        Some(host) if (host.is_stopped)(place) => Err(Error::Stopped),
        _ => Ok(()),
    }
}

pub(crate) fn cpu_seconds() -> f64 {
    HOST.get().map_or(f64::NAN, |host| (host.cpu_seconds)())
}
