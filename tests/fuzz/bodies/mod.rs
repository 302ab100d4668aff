//! What the fuzz targets do with their bytes. Shared by `fuzz/`, where cargo-fuzz drives them, and by the tests, which run them
//! over `tests/corpus` and a bounded number of mutations. Whatever the bytes, a body comes back, and what it asserts holds.

pub(crate) mod cloud;
pub(crate) mod config;
pub(crate) mod judge;
pub(crate) mod sites;

use std::path::Path;

/// Hands `work` a file of `bytes` under a name with `extension`.
fn with_file<T>(extension: &str, bytes: &[u8], work: impl FnOnce(&Path) -> T) -> T {
    let file = tempfile::Builder::new().suffix(extension).tempfile().expect("a temporary file");
    std::fs::write(file.path(), bytes).expect("room for it");
    work(file.path())
}
