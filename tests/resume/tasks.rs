//! Tasks that are killed, run twice, or come while another process works on the job.

use crate::kills::kills_wanted;
use crate::rig::{End, Rig, Run, Setup};
use crate::scattered;
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::Command;

const PHASES: [&str; 7] = ["plan", "read", "mesh", "join", "tiles", "levels", "publish"];

/// Returns a job of several parts, on files of neighbouring points.
pub(crate) fn job_of_parts() -> Rig {
    let setup = Setup::tiles_of(280);
    let setup = Setup { triangulation: format!("{}\nmax_points_per_part = 1600", setup.triangulation), ..setup };
    let rig = Rig::of_files(tempfile::tempdir().unwrap(), &scattered::gaussian(9_600), 60_000, &setup);
    assert!(rig.expected.len() > 60);
    rig
}

pub(crate) fn task(rig: &Rig, phase: &str, task: &str) -> Command {
    rig.command_of(&["work", "job.toml", "--phase", phase, "--task", task])
}

fn local(rig: &Rig, tasks: u32) -> Command {
    rig.command_of(&["submit", "job.toml", "--engine", "local", "--tasks", &tasks.to_string()])
}

pub(crate) fn run(mut command: Command) -> End {
    Run::start(&mut command).end()
}

/// Does all tasks of the phases before `phase`.
#[track_caller]
pub(crate) fn up_to(rig: &Rig, phase: &str, tasks: u32) {
    for before in PHASES.iter().take_while(|before| **before != phase) {
        (1..=tasks).for_each(|number| _ = run(task(rig, before, &format!("{number}/{tasks}"))).succeeded());
    }
}

#[track_caller]
fn completes(rig: &Rig, tasks: u32, what: &str) {
    let end = run(local(rig, tasks));
    assert!(end.status.success(), "{what}: {end:?}");
    rig.is_complete(what);
    rig.forget();
}

#[test]
fn tasks_killed_at_any_place_of_any_phase_leave_the_same_bytes() {
    let rig = job_of_parts();
    let (mut kills, mut of_phase) = (0, BTreeSet::new());
    let places = ["commit", "published", "torn", "committed"];
    let more = [("mesh", "leaf"), ("mesh", "tile"), ("publish", "replacing"), ("publish", "cleaning")];
    let all = PHASES.iter().flat_map(|phase| places.map(|place| (*phase, place)));
    for (at, (phase, place)) in all.chain(more).enumerate() {
        up_to(&rig, phase, 2);
        let count = if phase == "plan" || phase == "join" { 1 } else { 1 + at as u64 % 4 };
        for number in 1..=2 {
            let mut killed = task(&rig, phase, &format!("{number}/2"));
            let end = run({
                killed.env("GDT_FAULT", format!("{place}:{count}"));
                killed
            });
            assert!(end.was_killed() || end.status.success(), "{end:?}");
            if end.was_killed() {
                kills += 1;
                of_phase.insert(phase);
            }
            rig.has_nothing_half_written(&format!("{phase}: {place} {count}"));
        }
        completes(&rig, 3, &format!("{phase}: {place} {count}"));
    }
    assert!(kills >= 32 && of_phase.len() == PHASES.len(), "{kills} kills in {of_phase:?}");
}

/// Returns the processes that `parent` has started.
fn children(parent: u32) -> Vec<u32> {
    let list = fs::read_to_string(format!("/proc/{parent}/task/{parent}/children")).unwrap_or_default();
    list.split_whitespace().map(|process| process.parse().unwrap()).collect()
}

#[test]
fn processes_of_local_killed_at_random_moments_leave_the_same_bytes() {
    let rig = job_of_parts();
    let mut random = crate::random::Random(11);
    let (wanted, mut killed, mut runs) = (kills_wanted(30), 0, 0);
    while killed < wanted && runs < 8 * wanted {
        runs += 1;
        let run = Run::start(&mut local(&rig, 3));
        std::thread::sleep(std::time::Duration::from_millis(random.below(400)));
        // A task of it, or the engine itself.
        let tasks = children(run.child.id());
        let victim = match random.below(4) {
            0 => Some(run.child.id()),
            other => tasks.get(other as usize - 1).copied(),
        };
        let kill =
            |process: u32| Command::new("kill").args(["-9", &process.to_string()]).output().unwrap().status.success();
        killed += u64::from(victim.is_some_and(kill));
        let end = run.end();
        assert!(end.was_killed() || matches!(end.status.code(), Some(0 | 1)), "{end:?}");
        if end.was_killed() {
            // Its tasks end without it, as soon as they notice.
            while tasks.iter().any(|task| fs::metadata(format!("/proc/{task}")).is_ok()) {
                std::thread::sleep(std::time::Duration::from_millis(1));
            }
        }
        rig.has_nothing_half_written(&format!("kill {killed}"));
        if end.status.success() {
            rig.is_complete(&format!("after {killed} kills"));
            rig.forget();
        }
    }
    assert!(killed >= wanted * 2 / 3, "only {killed} kills");
    completes(&rig, 8, "in the end");
}

#[test]
fn tasks_of_local_end_with_the_engine() {
    let rig = job_of_parts();
    up_to(&rig, "mesh", 1);
    let before = stored(&rig, 0);
    let mut engine = Run::start(&mut local(&rig, 1));
    engine.wait_until(|| stored(&rig, 0) > before);
    let tasks = children(engine.child.id());
    assert!(!tasks.is_empty());
    engine.signal("KILL");
    assert!(engine.end().was_killed());
    while tasks.iter().any(|task| fs::metadata(format!("/proc/{task}")).is_ok()) {
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    // They were not done: without a task, the phase is not complete.
    let again = run(rig.command_of(&["status", "job.toml", "--json"])).succeeded();
    let status: serde_json::Value = serde_json::from_str(&again.out).unwrap();
    assert!(status["phases"][2]["done"].as_u64() < status["phases"][2]["of"].as_u64(), "{status}");
    completes(&rig, 2, "after the engine was killed");
}

/// Begins all parts of `phase`, and stops the process at a `place` within the first.
#[track_caller]
fn stopped_worker(rig: &Rig, phase: &str, place: &str) -> Run {
    up_to(rig, phase, 1);
    Run::stopped_at(&mut task(rig, phase, "1/1"), place, 1)
}

/// Returns the bytes in the store of a part.
fn stored(rig: &Rig, part: u32) -> u64 {
    let folder = rig.out().join(format!("job/parts/{part}"));
    let store = (0..8).map(|file| folder.join(format!("steps.{file}.store")));
    store.filter_map(|path| fs::metadata(path).ok()).map(|data| data.len()).sum()
}

#[test]
fn a_second_worker_leaves_a_part_that_another_has() {
    let rig = job_of_parts();
    let first = stopped_worker(&rig, "mesh", "leaf");
    let second = run(task(&rig, "mesh", "1/1")).stopped(&["is left out: process", "is working in"]);
    assert!(second.err.contains(&format!("process {} on", first.child.id())), "{}", second.err);
    // It has done the others.
    run(task(&rig, "join", "1/1")).stopped(&["mesh is not complete: task 1 of 1 is missing"]);
    // One process must wait for the tasks, and so must the phases that need the job alone.
    rig.run().stopped(&["another task of this job is working in"]);
    first.signal("CONT");
    first.end().succeeded();
    run(task(&rig, "join", "1/1")).succeeded();
    completes(&rig, 2, "after a second worker");
}

/// The first may know from before that the second has written what it comes to.
#[test]
fn two_workers_of_the_phase_tiles_write_each_tile_once() {
    let rig = job_of_parts();
    let first = stopped_worker(&rig, "tiles", "tile");
    run(task(&rig, "tiles", "1/1")).stopped(&["is left out: process", "is working in"]);
    first.signal("CONT");
    first.end().succeeded();
    run(task(&rig, "levels", "1/1")).succeeded();
    run(task(&rig, "publish", "1/1")).succeeded();
    rig.is_complete("two workers");
}

/// A small job that one process began has no tasks either.
#[test]
fn a_small_job_that_was_interrupted_may_be_submitted() {
    let rig = Rig::new(&scattered::gaussian(3_000), &Setup::tiles_of(700));
    assert!(rig.run_to("leaf", 2).was_killed());
    completes(&rig, 2, "submitted");
}

#[test]
fn tasks_wait_for_a_process_that_has_the_job_alone() {
    let rig = job_of_parts();
    let alone = Run::stopped_at(&mut rig.command(), "leaf", 1);
    for phase in ["read", "mesh", "join", "tiles", "levels"] {
        run(task(&rig, phase, "1/1")).stopped(&[&format!("process {} on", alone.child.id()), "is working in"]);
    }
    alone.signal("CONT");
    alone.end().succeeded();
    rig.is_complete("beside tasks");
}

#[test]
fn a_task_that_is_asked_to_stop_keeps_what_it_has_done() {
    let rig = job_of_parts();
    up_to(&rig, "mesh", 1);
    // The first part is done.
    let asked = Run::stopped_at(&mut task(&rig, "mesh", "1/1"), "committed", 1);
    asked.signal("TERM");
    asked.signal("CONT");
    asked.end().stopped(&["interrupted"]);
    let again = run(rig.command_of(&["status", "job.toml", "--json"])).succeeded();
    let status: serde_json::Value = serde_json::from_str(&again.out).unwrap();
    assert!(status["phases"][2]["done"].as_u64() >= Some(1), "{status}");
    completes(&rig, 3, "after a signal");
}

fn copy(from: &Path, to: &Path) {
    let copied = Command::new("cp").arg("-r").args([from, to]).status().unwrap();
    assert!(copied.success());
}

/// Does all phases but the last, kills `publish` at every place where it removes something, and then lets tasks, a submission or one process
/// come. `tasks` is how many tasks there are.
#[track_caller]
fn kill_while_cleaning(rig: &Rig, tasks: u32) -> u64 {
    up_to(rig, "publish", tasks);
    let before = rig.folder.path().join("before");
    copy(&rig.out(), &before);
    let publish = || task(rig, "publish", "1/1");
    for count in 1.. {
        rig.forget();
        copy(&before, &rig.out());
        let killed = Run::start(publish().env("GDT_FAULT", format!("cleaning:{count}"))).end();
        if !killed.was_killed() {
            killed.succeeded();
            return count - 1;
        }
        let what = &format!("cleaning, {count}");
        let report = fs::read(rig.out().join("report.json")).unwrap();
        let status = run(rig.command_of(&["status", "job.toml", "--json"])).succeeded();
        assert_eq!(serde_json::from_str::<serde_json::Value>(&status.out).unwrap()["state"], "done", "{what}");
        for phase in &PHASES[..6] {
            let said = run(task(rig, phase, "1/1")).succeeded().out;
            assert!(said.contains("all results are in place"), "{what}, {phase}: {said}");
        }
        let again = match count % 3 {
            0 => publish(),
            1 => rig.command(),
            _ => local(rig, 2),
        };
        run(again).succeeded();
        assert!(!rig.out().join("job").exists(), "{what}");
        // The job was not done again.
        assert!(fs::read(rig.out().join("report.json")).unwrap() == report, "{what}");
        rig.is_complete(what);
        run(publish()).succeeded();
        rig.is_complete(what);
    }
    0
}

#[test]
fn publish_killed_while_it_cleans_up_leaves_a_finished_job() {
    assert!(kill_while_cleaning(&job_of_parts(), 2) > 20);
}

#[test]
fn publish_of_a_small_job_killed_while_it_cleans_up_leaves_a_finished_job() {
    let rig = Rig::new(&scattered::gaussian(3_000), &Setup::tiles_of(700));
    assert!(kill_while_cleaning(&rig, 1) > 12);
}

/// Without a plan, the report alone cannot tell that a job with another style is done.
#[test]
fn another_job_is_not_finished_by_the_rest_of_the_first() {
    let mut rig = job_of_parts();
    up_to(&rig, "publish", 1);
    while rig.out().join("job/journal").exists() {
        let killed = Run::start(task(&rig, "publish", "1/1").env("GDT_FAULT", "cleaning:5")).end();
        assert!(killed.was_killed() && rig.out().join("job").exists(), "{killed:?}");
    }
    let setup = Setup::tiles_of(700).output("compression = \"none\"");
    let triangulation = format!("{}\nmax_points_per_part = 4000", setup.triangulation);
    rig.expect(&Setup { triangulation, input: "files = [\"part_*.csv\"]".into(), ..setup });
    run(task(&rig, "publish", "1/1")).stopped(&["the phase plan is not complete"]);
    completes(&rig, 2, "another style");
}

/// A scheduler starts the task again that was killed, and nothing else.
#[test]
fn publish_that_does_a_small_job_alone_goes_on_by_itself() {
    let rig = Rig::new(&scattered::gaussian(3_000), &Setup::tiles_of(700));
    up_to(&rig, "publish", 1);
    for _ in 0..5 {
        assert!(Run::start(task(&rig, "publish", "1/1").env("GDT_FAULT", "committed:1")).end().was_killed());
    }
    run(task(&rig, "publish", "1/1")).succeeded();
    rig.is_complete("publish alone");
}
