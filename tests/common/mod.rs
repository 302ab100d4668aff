//! What several test files need.

use std::path::PathBuf;

/// The folder of shared test data: beside the repository, or where GDT_SHARED says. Tests that need it say plainly when
/// it is absent and pass.
pub(crate) fn shared() -> Option<PathBuf> {
    let beside = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared");
    let folder = std::env::var_os("GDT_SHARED").map_or_else(beside, PathBuf::from);
    if folder.join("data").is_dir() {
        return Some(folder);
    }
    eprintln!("skipped: no test data in {}; set GDT_SHARED", folder.display());
    None
}
