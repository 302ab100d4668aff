//! What the fuzz targets do with their bytes. `fuzz/` shares these bodies, where cargo-fuzz drives them, with the tests, which run
//! them over `tests/corpus` and a bounded number of mutations. Whatever the bytes, a body returns, and its assertions hold.

pub(crate) mod cloud;
pub(crate) mod config;
pub(crate) mod job;
pub(crate) mod judge;
pub(crate) mod sites;

use std::path::Path;

/// Calls `work` with a file of `bytes` that has this `extension`.
fn with_file<T>(extension: &str, bytes: &[u8], work: impl FnOnce(&Path) -> T) -> T {
    let file = tempfile::Builder::new().suffix(extension).tempfile().expect("a temporary file");
    std::fs::write(file.path(), bytes).expect("room for it");
    work(file.path())
}
