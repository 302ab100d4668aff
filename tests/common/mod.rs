//! Helpers that several tests share.

use std::path::PathBuf;

/// Returns the folder of shared test data: next to the repository, or the folder that GDT_SHARED names. If there is none, says so
/// on standard error; the test that asks for it then passes.
pub(crate) fn shared() -> Option<PathBuf> {
    let beside = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared");
    let folder = std::env::var_os("GDT_SHARED").map_or_else(beside, PathBuf::from);
    if folder.join("data").is_dir() {
        return Some(folder);
    }
    eprintln!("skipped: no test data in {}; set GDT_SHARED", folder.display());
    None
}
