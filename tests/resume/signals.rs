//! Ctrl-C, SIGTERM and the hangup of a terminal.

use std::time::Duration;

use crate::rig::{Rig, Run, Setup};
use crate::scattered;

/// Returns a job of many steps that each wait for the disk, long enough for signals to arrive while it runs.
fn long_job(threads: usize) -> Rig {
    Rig::new(&scattered::gaussian(60_000), &Setup::tiles_of(500).threads(threads))
}

/// Tells whether this process, and so every job that it starts, ignores the hangup of its terminal.
fn hangups_are_ignored() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    // Signal 1 is the lowest bit.
    ignored.and_then(|bits| u64::from_str_radix(bits.trim(), 16).ok()).is_some_and(|bits| bits & 1 == 1)
}

#[test]
fn a_job_stopped_by_sigterm_ctrl_c_or_a_hangup_goes_on_where_it_stopped() {
    for (signal, threads) in [("TERM", 1), ("INT", 2), ("HUP", 2)] {
        if signal == "HUP" && hangups_are_ignored() {
            eprintln!("not tested: the hangup of a terminal, because these tests run under nohup");
            continue;
        }
        let rig = long_job(threads);
        // Among the leaves and tiles.
        for bytes in [50_000, 200_000, 500_000] {
            rig.forget();
            let mut run = Run::start(&mut rig.command());
            run.wait_until(|| rig.stored() > bytes);
            run.signal(signal);
            run.end().stopped(&["error: interrupted", "what is done is kept in out/job", "run the same command again"]);
            rig.has_nothing_half_written(signal);
        }
        assert_eq!(rig.completes(signal)["resumed"], 2);
    }
}

#[test]
fn a_signal_within_one_long_step_is_heeded_before_the_step_ends() {
    // All sites of a line are on the hull, so that the merge has all of them.
    let line = (0..70_000).map(|i| if i == 0 { [40_001, 70_000] } else { [2 * i, 0] });
    let wide = || Rig::new(&scattered::with_heights(line.clone()), &Setup::tiles_of(40_000));
    let one_tile = Setup::tiles_of(100_000);
    let dense = || Rig::new(&scattered::uniform(60_000, 100_000, 1), &one_tile).with_usual_preview(&one_tile);
    // The merge asks until the end of its triangulation, at every kind of place there, and between its parts; the drawing of one tile
    // asks often.
    for (rig, place, counts) in [
        (wide(), "divide_and_conquer", [1, 20, 36, 52]),
        (wide(), "merge", [1, 2, 3, 4]),
        (dense(), "canvas", [1, 2, 8, 16]),
    ] {
        for count in counts {
            rig.forget();
            let what = format!("signal-{place}");
            let end = rig.run_to(&what, count);
            assert_eq!(end.status.code(), Some(1), "{what}:{count}: {end:?}");
            end.stopped(&["error: interrupted"]);
            rig.has_nothing_half_written(&what);
        }
        rig.completes(place);
    }
}

#[test]
fn a_job_under_nohup_does_not_end_with_its_terminal() {
    let rig = long_job(2);
    let mut command = std::process::Command::new("sh");
    command.args(["-c", "trap '' HUP; exec \"$0\" job.toml", env!("CARGO_BIN_EXE_gdt-batch")]);
    let mut run = Run::start(command.current_dir(rig.folder.path()));
    run.wait_until(|| rig.stored() > 50_000);
    run.signal("HUP");
    run.end().succeeded();
    rig.is_complete("after a hangup");
}

#[test]
fn a_job_interrupted_before_its_first_step_leaves_nothing() {
    let rig = Rig::new(&scattered::gaussian(400_000), &Setup::tiles_of(20_000));
    let mut run = Run::start(&mut rig.command());
    let points = rig.out().join("job/points-by-part");
    run.wait_until(|| points.exists());
    run.signal("INT");
    let end = run.end().stopped(&["error: interrupted"]);
    if !end.err.contains("run the same command again") {
        assert!(!rig.out().join("job").exists());
    }
    rig.completes("after an interruption");
}

#[test]
fn the_reference_is_left_behind_when_the_job_is_stopped() {
    // One leaf, which takes `spade` longer than a run may last here.
    let line = (0..300_000).map(|i| if i == 0 { [40_000, 70_000] } else { [2 * i, 0] });
    let setup = Setup::tiles_of(1_000_000);
    let rig = Rig::new(&scattered::with_heights(line), &setup);
    rig.configure(&setup.clone().backend("reference"));
    let mut run = Run::start(&mut rig.command());
    run.wait_until(|| rig.phases() == 2);
    std::thread::sleep(Duration::from_millis(50));
    run.signal("TERM");
    run.end().stopped(&["error: interrupted"]);
    rig.configure(&setup);
    rig.completes("with another backend");
}

#[test]
fn a_second_ctrl_c_ends_the_job_at_once() {
    // One leaf that takes long and does not check for signals.
    let rig = Rig::new(&scattered::uniform(800_000, 1_000_000, 1), &Setup::tiles_of(1_000_000));
    let mut run = Run::start(&mut rig.command());
    run.wait_until(|| rig.phases() == 2);
    std::thread::sleep(Duration::from_millis(50));
    run.signal("INT");
    std::thread::sleep(Duration::from_millis(20));
    run.signal("INT");
    let end = run.end();
    assert_eq!(end.status.code(), Some(1), "{end:?}");
    assert!(!end.err.contains("interrupted"), "the job ended before it could say so: {}", end.err);
    rig.completes("after a second Ctrl-C");
}
