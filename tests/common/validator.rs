//! The Khronos glTF validator, run with Node.js from tests/npm.

use std::path::Path;
use std::process::Command;

/// Validates every GLB below `folder`, which must hold at least `least` of them: none may have an error or a warning. If the
/// validator is not installed, says so and tests nothing; under tests/run, fails.
#[track_caller]
pub(crate) fn validate(folder: &Path, least: usize) {
    let npm = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/npm");
    if !npm.join("node_modules/gltf-validator").is_dir() {
        assert!(std::env::var_os("GDT_TEST_ALL").is_none(), "no gltf-validator in {}", npm.display());
        eprintln!("not tested: no gltf-validator; run `npm ci` in tests/npm, or tests/run");
        return;
    }
    let output = Command::new("node").arg(npm.join("validate.mjs")).arg(folder).output().expect("node runs");
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{said}{}", String::from_utf8_lossy(&output.stderr));
    let summary = said.lines().last().expect("the validator ends with a summary");
    let files: usize =
        summary.split(' ').next().and_then(|files| files.parse().ok()).expect("the summary begins with a number");
    assert!(files >= least && summary.contains(" 0 errors, 0 warnings"), "{summary}");
}
