//! What tasks left is damaged, or its inputs seem to be others, when another task comes.

use crate::rig::{End, Rig, Setup};
use crate::tasks::{job_of_parts, run, task, up_to};
use std::fs;
use std::path::PathBuf;
use std::time::{Duration, SystemTime};

/// Returns the inputs.
fn inputs(rig: &Rig) -> Vec<PathBuf> {
    let files = fs::read_dir(rig.folder.path()).unwrap().map(|entry| entry.unwrap().path());
    files.filter(|path| path.extension().is_some_and(|extension| extension == "csv")).collect()
}

fn set_times(rig: &Rig, time: SystemTime) {
    for path in inputs(rig) {
        fs::File::options().append(true).open(path).unwrap().set_modified(time).unwrap();
    }
}

fn parts_done(rig: &Rig, phase: usize) -> u64 {
    let status = run(rig.command_of(&["status", "job.toml", "--json"])).succeeded();
    let status: serde_json::Value = serde_json::from_str(&status.out).unwrap();
    status["phases"][phase]["done"].as_u64().unwrap()
}

/// Machines and file systems tell other times of one file.
#[test]
fn other_times_of_the_inputs_cost_tasks_nothing() {
    let rig = job_of_parts();
    up_to(&rig, "tiles", 1);
    let done = parts_done(&rig, 2);
    assert!(done > 3);
    let time = SystemTime::now() - Duration::from_secs(7_777);
    for later in [Duration::from_nanos(123_456), Duration::from_secs(90)] {
        set_times(&rig, time + later);
        run(task(&rig, "plan", "1/1")).succeeded();
        assert_eq!(parts_done(&rig, 2), done, "{later:?}");
    }
    run(task(&rig, "tiles", "1/1")).succeeded();
    run(task(&rig, "levels", "1/1")).succeeded();
    set_times(&rig, time);
    let end = run(task(&rig, "publish", "1/1")).succeeded();
    assert!(end.err.contains("publish: done") && !end.err.contains("mesh: done"), "{}", end.err);
    // Only a warning tells of the times.
    let report = rig.has_all_results("with other times");
    assert!(String::from_utf8(report).unwrap().contains("its modification time differs"));
}

#[test]
fn an_input_that_changes_before_publish_is_an_error_that_costs_nothing() {
    let rig = job_of_parts();
    up_to(&rig, "publish", 1);
    let added = rig.folder.path().join("part_new.csv");
    fs::write(&added, "x,y,z\n1,2,3\n").unwrap();
    let end = run(task(&rig, "publish", "1/1"));
    assert_eq!(end.status.code(), Some(2), "{end:?}");
    assert!(end.err.contains("part_new.csv (new): changed since the job was planned"), "{}", end.err);
    fs::remove_file(added).unwrap();
    run(task(&rig, "publish", "1/1")).succeeded();
    rig.is_complete("after another input");
}

fn publish_after(damage: impl Fn(&Rig)) -> (Rig, End) {
    let rig = job_of_parts();
    up_to(&rig, "publish", 2);
    damage(&rig);
    let end = run(task(&rig, "publish", "1/2"));
    (rig, end)
}

/// What a tile was made from may have been freed. But nobody loses what is left, and one process starts over.
#[test]
fn a_lost_or_damaged_tile_is_damage() {
    let tiles = |rig: &Rig| {
        let files = fs::read_dir(rig.out().join("job/results/tiles")).unwrap().map(|entry| entry.unwrap().path());
        files.filter(|path| path.is_file()).collect::<Vec<_>>()
    };
    let lose = |rig: &Rig| fs::remove_file(&tiles(rig)[0]).unwrap();
    let spoil = |rig: &Rig| {
        for path in tiles(rig) {
            let mut bytes = fs::read(&path).unwrap();
            let at = bytes.len() - 9;
            bytes[at] ^= 0x55;
            bytes[40] ^= 0x55;
            fs::write(path, bytes).unwrap();
        }
    };
    for (rig, end) in [publish_after(lose), publish_after(spoil)] {
        end.stopped(&["is damaged: submit the job with --restart"]);
        assert!(parts_done(&rig, 2) > 3);
        rig.run().succeeded();
        rig.is_complete("after damage");
    }
}

/// A store that is cut off cannot be made good, but nobody loses what is left, and one process starts over.
#[test]
fn a_store_that_is_cut_off_is_damage() {
    let cut = |rig: &Rig| {
        let path = rig.out().join("job/parts/1/steps.0.store");
        fs::File::options().write(true).open(path).unwrap().set_len(10).unwrap();
    };
    let (rig, end) = publish_after(cut);
    end.stopped(&["is damaged: submit the job with --restart"]);
    assert!(parts_done(&rig, 2) > 3);
    rig.run().succeeded();
    rig.is_complete("one process after damage");
}

/// Late tasks of a submission find its job done, whoever did it again since.
#[test]
fn the_number_of_a_submission_outlives_a_job_that_is_done_again_without_one() {
    let rig = Rig::new(&crate::scattered::gaussian(3_000), &Setup::tiles_of(700));
    let numbered =
        |phase: &str| rig.command_of(&["work", "job.toml", "--phase", phase, "--task", "1/1", "--submission", "5"]);
    run(numbered("plan")).succeeded();
    run(task(&rig, "publish", "1/1")).succeeded();
    for _ in 0..2 {
        let report = fs::read(rig.out().join("report.json")).unwrap();
        for phase in ["mesh", "plan", "publish"] {
            run(numbered(phase)).succeeded();
        }
        assert!(fs::read(rig.out().join("report.json")).unwrap() == report);
        rig.run().succeeded();
    }
}
