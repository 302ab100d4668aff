//! Disks that cannot be read any more (EIO): the run stops with a clear error, or makes the lost results again. It never ends with
//! other bytes.

use std::process::Command;

use crate::rig::{Rig, Run, Setup};
use crate::scattered;

fn rig() -> Rig {
    Rig::new(&scattered::clusters(9_000), &Setup::tiles_of(2_500).output("max_edge = \"auto\""))
}

/// Lets the reads called `name` fail, from the n-th on or only the n-th, for `stride`-th n, in the first run and in the one that
/// goes on from it. Returns how many runs failed.
#[track_caller]
fn fail_at_each(rig: &Rig, name: &str, stride: usize) -> u64 {
    let mut failed = 0;
    for count in (1u64..).step_by(stride) {
        rig.forget();
        let end = run_with(rig, &format!("{name}:{count}"));
        if end.is_ok() {
            rig.is_complete(&format!("{name}, {count}"));
            return failed;
        }
        failed += 1;
        // The disk is still broken: the next run fails too, or does without.
        let what = format!("{name}, {count}");
        match run_with(rig, &format!("{name}:{}+", count / 2 + 1)) {
            Ok(()) => _ = rig.is_complete(&what),
            Err(()) => _ = rig.completes(&what),
        }
    }
    failed
}

/// Runs the job with this fault. If it fails, it must say what it could not read, with exit code 1.
#[track_caller]
fn run_with(rig: &Rig, fault: &str) -> Result<(), ()> {
    let end = Run::start(rig.command().env("GDT_FAULT", fault)).end();
    if end.status.success() {
        return Ok(());
    }
    assert_eq!(end.status.code(), Some(1), "{fault}: {end:?}");
    assert!(end.err.contains("Input/output error") && end.err.contains("error: cannot "), "{fault}: {}", end.err);
    Err(())
}

#[test]
fn a_read_error_on_an_input_stops_the_job_and_the_next_run_ends_with_the_same_bytes() {
    let rig = rig();
    assert!(fail_at_each(&rig, "read-input", 1) >= 10);
}

/// A sound file must not be left out because the disk is broken.
#[test]
fn a_read_error_on_a_laz_file_never_counts_as_a_bad_file() {
    let mut rig = rig();
    for name in ["terrain.laz", "terrain.las"] {
        let mut sample = Command::new(env!("CARGO_BIN_EXE_gdt-batch"));
        sample.args(["sample", name, "--points", "60000"]).current_dir(rig.folder.path());
        Run::start(&mut sample).end().succeeded();
        let input =
            format!("files = [\"{name}\", \"cloud.csv\"]\non_bad_file = \"skip\"\nmax_malformed_fraction = 1.0");
        std::fs::write(rig.folder.path().join("cloud.csv"), "x,y,z\n565000,5933000,1\n").unwrap();
        std::fs::remove_dir_all(rig.folder.path().join("undisturbed")).unwrap();
        rig.expect(&Setup { input, ..Setup::tiles_of(20_000) });
        assert!(fail_at_each(&rig, "read-input", 4) >= 5, "{name}");
    }
}

#[test]
fn a_read_error_on_the_points_stops_the_job_and_the_next_run_ends_with_the_same_bytes() {
    let rig = rig();
    assert!(fail_at_each(&rig, "read-points", 5) >= 5);
}

#[test]
fn a_read_error_on_the_store_stops_the_job_and_the_next_run_ends_with_the_same_bytes() {
    let rig = rig();
    assert!(fail_at_each(&rig, "read-store", 23) >= 10);
}

/// Levels and terrain.glb are made from the tiles.
#[test]
fn a_read_error_on_the_tiles_stops_the_job_and_the_next_run_ends_with_the_same_bytes() {
    let rig = rig();
    assert!(fail_at_each(&rig, "read-result", 4) >= 3);
}

#[test]
fn a_read_error_on_the_journal_or_the_results_stops_the_job_and_the_next_run_ends_with_the_same_bytes() {
    let rig = rig();
    for name in ["read-journal", "read-result"] {
        for count in [2, 4] {
            rig.forget();
            assert!(rig.run_to("committed", count).was_killed());
            for visit in [1, 2, 5] {
                _ = run_with(&rig, &format!("{name}:{visit}"));
            }
            rig.completes(&format!("{name}, {count}"));
        }
    }
}
