//! The cloud of the benchmarks of whole jobs.

use std::path::{Path, PathBuf};

pub(crate) type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// Returns autzen.laz from the test data, or a sample terrain of 4 million points if there is none.
pub(crate) fn default_file(scratch: &Path) -> Outcome<PathBuf> {
    let shared = std::env::var_os("GDT_SHARED")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared"), PathBuf::from);
    let autzen = shared.join("data/autzen.laz");
    if autzen.is_file() {
        return Ok(autzen);
    }
    let sample = scratch.join("sample.laz");
    gdt_batch::sample::write(&sample, 4_000_000, 1, true)?;
    Ok(sample)
}
