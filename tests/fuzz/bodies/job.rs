//! Whole jobs: whatever the input, a job ends with an error that a user can act on, or with an output that verifies.

use job::Error;
use job::options::{JobOptions, RunOptions};
use job::preflight::check;
use job::progress::stage::ProgressOutput;

use super::with_file;
use sys::ErrorKind;

/// Memory for verifying, in bytes.
const MEMORY: u64 = 1 << 28;

/// Options for small jobs that have all the steps of a large one: many tiles, merges and levels.
pub(crate) const OPTIONS: &str = "[input]\nfiles = [\"any\"]\n[triangulation]\nbackend = \"cpu\"\nmax_points_per_tile = 20\n\
    [output]\ndirectory = \"any\"\nmax_points_per_level_tile = 100\n[limits]\nthreads = 1\nmemory = \"128 MiB\"\n";

/// Reads a configuration of this text.
pub(crate) fn options(text: &str) -> JobOptions {
    with_file(".toml", text.as_bytes(), gdt_batch::config::load).expect("a configuration")
}

/// Scans the inputs. Returns whether there is a job to run.
pub(crate) fn preflight(options: &JobOptions) -> bool {
    match check::check(options) {
        Ok(preflight) => {
            assert!(!preflight.to_string().is_empty());
            true
        }
        Err(error) => {
            assert_is_for_the_user(&error);
            false
        }
    }
}

/// Runs the job and verifies what it has written.
pub(crate) fn run_and_verify(mut options: JobOptions) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    options.output.directory = folder.path().join("out");
    // The free memory of this machine must not matter.
    let run = RunOptions { progress: ProgressOutput::Quiet, force: true, restart: false, update: false, submission: 0 };
    let report = match job::run(&options, run) {
        Ok(report) => report,
        Err(error) => return assert_is_for_the_user(&error),
    };
    serde_json::to_string(&report).expect("a report is JSON");
    let verdict = verify::verify(&options.output.directory, MEMORY).expect("tiles that can be read");
    assert!(verdict.holds() && verdict.unproved.is_none(), "{verdict}");
}

/// Asserts that the error is about the inputs, the configuration or the memory limit, and short.
fn assert_is_for_the_user(error: &Error) {
    assert!(
        matches!(error.kind(), ErrorKind::Usage | ErrorKind::Input)
            || matches!(error, Error::System(sys::Error::Memory(_))),
        "{error}"
    );
    assert!(error.to_string().len() < 4000, "{error}");
}
