//! The address space that the process may take, where a limit is set (`ulimit -v`).

use crate::{Error, Result};
use std::sync::OnceLock;

static AT_START: OnceLock<Option<u64>> = OnceLock::new();

/// Returns what [`left`] returned when this was called for the first time. The program calls it before it starts threads: they reserve
/// far more address space than they take, and give it back when others need it.
pub(crate) fn at_start() -> Option<u64> {
    *AT_START.get_or_init(left)
}

/// Returns the bytes of address space that are left; `None` if there is no limit or the system does not tell.
#[cfg(target_os = "linux")]
pub(crate) fn left() -> Option<u64> {
    let limit = rustix::process::getrlimit(rustix::process::Resource::As).current?;
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let size = status.lines().find_map(|line| line.strip_prefix("VmSize:"))?;
    let kibibytes: u64 = size.split_whitespace().next()?.parse().ok()?;
    Some(limit.saturating_sub(kibibytes * 1024))
}

/// Returns the bytes of address space that are left; `None` if there is no limit or the system does not tell.
#[cfg(not(target_os = "linux"))]
pub(crate) fn left() -> Option<u64> {
    None
}

/// Checks that `bytes`, which `what` takes, are not more than are `left`.
///
/// # Errors
/// [`Error::Memory`] if they are.
pub(crate) fn require(bytes: u64, left: Option<u64>, what: impl FnOnce() -> String) -> Result<()> {
    match left.filter(|left| *left < bytes) {
        None => Ok(()),
        Some(left) => Err(Error::Memory(format!(
            "{} takes about {} MiB, and the limit on the address space (ulimit -v) leaves {} MiB: raise it",
            what(),
            bytes.div_ceil(1 << 20),
            left >> 20
        ))),
    }
}
