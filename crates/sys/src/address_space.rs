//! The memory that the process may take, where a limit is set: on its address space (`ulimit -v`) or on its data (`ulimit -d`).

use crate::{Error, Result};
use std::sync::OnceLock;

static AT_START: OnceLock<Option<Left>> = OnceLock::new();

/// What a limit leaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Left {
    /// How many bytes.
    pub bytes: u64,
    /// The limit, for people.
    limit: &'static str,
}

/// Returns what [`left`] returned when this was called for the first time. The program calls it before it starts threads: they reserve
/// far more address space than they take, and give it back when others need it.
pub fn at_start() -> Option<Left> {
    *AT_START.get_or_init(left)
}

/// Returns what the tighter limit leaves; `None` if there is no limit or the system does not tell.
#[cfg(target_os = "linux")]
pub fn left() -> Option<Left> {
    use rustix::process::{Resource, getrlimit};
    let limits = [
        (Resource::As, "VmSize:", "address space (ulimit -v)"),
        (Resource::Data, "VmData:", "data of a process (ulimit -d)"),
    ];
    let mut limits = limits.into_iter().filter_map(|(what, row, limit)| Some((getrlimit(what).current?, row, limit)));
    let first = limits.next()?;
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let left = |(bytes, row, limit): (u64, &str, &'static str)| {
        let taken = status.lines().find_map(|line| line.strip_prefix(row))?;
        let kibibytes: u64 = taken.split_whitespace().next()?.parse().ok()?;
        Some(Left { bytes: bytes.saturating_sub(kibibytes * 1024), limit })
    };
    std::iter::once(first).chain(limits).filter_map(left).min()
}

/// Returns what the tighter limit leaves; `None` if there is no limit or the system does not tell.
#[cfg(not(target_os = "linux"))]
pub(crate) fn left() -> Option<Left> {
    None
}

/// Checks that `bytes`, which `what` takes, are not more than are `left`.
///
/// # Errors
/// [`Error::Memory`] if they are.
pub fn require(bytes: u64, left: Option<Left>, what: impl FnOnce() -> String) -> Result<()> {
    match left.filter(|left| left.bytes < bytes) {
        None => Ok(()),
        Some(left) => Err(Error::Memory(format!(
            "{} takes about {} MiB, and {}: raise it",
            what(),
            bytes.div_ceil(1 << 20),
            left.sentence()
        ))),
    }
}

impl Left {
    /// Says what is left of which limit.
    pub(crate) fn sentence(self) -> String {
        format!("the limit on the {} leaves {} MiB", self.limit, self.bytes >> 20)
    }
}
