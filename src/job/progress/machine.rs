//! What the machine has to offer, as far as it tells.

use crate::{Error, Result};
use std::path::Path;

/// Bytes free where `directory` is, or will be; `None` where the system does not tell.
pub(crate) fn free_disk(directory: &Path) -> Option<u64> {
    fs4::available_space(existing(directory)).ok()
}

/// Whether a file can be made where `directory` is, or will be. Leaves nothing behind.
///
/// # Errors
/// [`Error::Io`] if not.
pub(crate) fn check_writable(directory: &Path) -> Result<()> {
    tempfile::tempfile_in(existing(directory)).map(drop).map_err(Error::io("write to", directory))
}

/// The nearest of it and what is above it that is there already.
fn existing(directory: &Path) -> &Path {
    directory.ancestors().find(|d| d.exists()).unwrap_or(Path::new("."))
}

/// Bytes of memory that a process can have without others being swapped out; `None` where the system does not tell.
pub(crate) fn free_memory() -> Option<u64> {
    let table = std::fs::read_to_string("/proc/meminfo").ok()?;
    let machine = kibibytes(&table, "MemAvailable:")? * 1024;
    Some(group_memory().map_or(machine, |group| group.min(machine)))
}

/// What the limit of a container, if there is one, leaves.
fn group_memory() -> Option<u64> {
    let number =
        |name: &str| std::fs::read_to_string(format!("/sys/fs/cgroup/{name}")).ok()?.trim().parse::<u64>().ok();
    Some(number("memory.max")?.saturating_sub(number("memory.current")?))
}

/// The largest resident set of this process so far, in bytes; `None` where the system does not tell.
pub(crate) fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    kibibytes(&status, "VmHWM:").map(|kibibytes| kibibytes * 1024)
}

/// The number after `name` in a table of the kernel's.
fn kibibytes(table: &str, name: &str) -> Option<u64> {
    let line = table.lines().find(|line| line.starts_with(name))?;
    line.split_whitespace().nth(1)?.parse().ok()
}
