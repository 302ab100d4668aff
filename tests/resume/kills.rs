//! SIGKILL at every commit of the journal and at random moments.

use std::time::{Duration, Instant};

use crate::random::Random;
use crate::rig::{Rig, Run, Setup};
use crate::scattered;

/// Where a commit can be cut off: before it; with the results under their names and no record; in the middle of the record;
/// after it.
const PLACES: [&str; 4] = ["commit", "published", "torn", "committed"];

fn small_job(setup: &Setup) -> Rig {
    Rig::new(&scattered::clusters(20_000), setup).committing_every(0)
}

/// Kills the run at every `stride`-th time that it comes to `place`, each time from the start, and goes on; returns the kills.
#[track_caller]
fn kill_at_each(rig: &Rig, place: &str, stride: usize) -> u64 {
    let mut kills = 0;
    for count in (1u64..).step_by(stride) {
        rig.forget();
        if !rig.run_to(place, count).was_killed() {
            rig.is_complete(place);
            break;
        }
        kills += 1;
        let what = format!("{place}, {count}");
        rig.has_nothing_half_written(&what);
        let was_over = rig.out().join("report.json").exists();
        let resumed = rig.completes(&what)["resumed"].as_u64().unwrap();
        // The record under way may be there or not, those before it must.
        assert!(was_over || resumed + 1 >= count, "{what}: only {resumed} steps were taken over");
    }
    kills
}

#[test]
fn killed_at_every_commit() {
    let rig = small_job(&Setup::tiles_of(3_500));
    let kills: u64 = PLACES.iter().map(|place| kill_at_each(&rig, place, 1)).sum();
    assert!(kills >= 110, "only {kills} kills");
}

#[test]
fn killed_at_commits_with_two_threads() {
    let rig = small_job(&Setup::tiles_of(3_500).threads(2));
    let kills: u64 = PLACES.iter().map(|place| kill_at_each(&rig, place, 4)).sum();
    assert!(kills >= 25, "only {kills} kills");
}

#[test]
fn killed_while_triangles_are_left_out_below_levels() {
    let setup = Setup::tiles_of(2_000).output("max_edge = \"auto\"").output("max_points_per_level_tile = 1000");
    let rig = small_job(&setup);
    for folder in ["cut/", "levels/"] {
        assert!(rig.expected.keys().filter(|name| name.starts_with(folder)).count() > 2, "{folder}");
    }
    let kills: u64 = PLACES.iter().map(|place| kill_at_each(&rig, place, 8)).sum();
    assert!(kills >= 16, "only {kills} kills");
}

#[test]
fn killed_again_and_again_while_it_goes_on() {
    let rig = small_job(&Setup::tiles_of(3_500).threads(2));
    for place in PLACES {
        rig.forget();
        let mut kills = 0;
        // Every run gets two commits further.
        while rig.run_to(place, 3).was_killed() {
            rig.has_nothing_half_written(place);
            kills += 1;
            assert!(kills < 100, "{place}: it does not get on");
        }
        assert!(kills >= 5, "{place}: only {kills} kills");
        rig.is_complete(place);
    }
}

#[test]
fn killed_while_it_cleans_up() {
    let rig = small_job(&Setup::tiles_of(5_000));
    // The store, the points and, last of all, the journal.
    let steps = rig.stores().len() as u64 + 2;
    assert!(!rig.run_to("cleaning", steps + 1).was_killed());
    rig.forget();
    for count in 1..=steps {
        assert!(rig.run_to("cleaning", count).was_killed());
        let before = std::fs::read(rig.out().join("report.json")).unwrap();
        rig.completes(&format!("cleaning, {count}"));
        // As long as the journal is there, the job is known to be complete, and nothing is done again.
        let after = std::fs::read(rig.out().join("report.json")).unwrap();
        assert!(before == after || count == steps, "cleaning, {count}: done again");
        rig.forget();
    }
}

fn kills_wanted(otherwise: u64) -> u64 {
    std::env::var("GDT_KILLS").ok().and_then(|text| text.parse().ok()).unwrap_or(otherwise)
}

/// Kills runs at random moments until there were `kills` of them; every run goes on where the one before was.
#[track_caller]
fn kill_at_random(rig: &Rig, seed: u64, kills: u64) {
    let mut random = Random(seed);
    let start = Instant::now();
    rig.run().succeeded();
    let usual = start.elapsed();
    let mut killed = 0;
    rig.forget();
    while killed < kills {
        let mut run = Run::start(&mut rig.command());
        let moment = usual.mul_f64(random.below(1 << 20) as f64 / (1u64 << 20) as f64);
        let start = Instant::now();
        while start.elapsed() < moment && run.child.try_wait().unwrap().is_none() {
            std::thread::sleep(Duration::from_micros(500));
        }
        run.child.kill().unwrap();
        let end = run.end();
        killed += u64::from(end.was_killed());
        assert!(end.was_killed() || end.status.success(), "{end:?}");
        rig.has_nothing_half_written(&format!("{seed}: kill {killed}"));
        if end.status.success() {
            rig.is_complete(&format!("{seed}: after {killed} kills"));
            rig.forget();
        }
    }
    rig.completes(&format!("{seed}: after {killed} kills"));
}

#[test]
fn killed_at_random_with_one_thread() {
    let rig = Rig::new(&scattered::gaussian(40_000), &Setup::tiles_of(2_000)).committing_every(10);
    kill_at_random(&rig, 1, kills_wanted(45));
}

#[test]
fn killed_at_random_with_two_threads() {
    let rig = Rig::new(&scattered::gaussian(40_000), &Setup::tiles_of(2_000).threads(2)).committing_every(10);
    kill_at_random(&rig, 2, kills_wanted(45));
}

#[test]
fn killed_with_a_gpu() {
    let setup = Setup::tiles_of(3_500).threads(2).backend("gpu");
    let there = std::process::Command::new(env!("CARGO_BIN_EXE_gdt-batch")).arg("gpu").arg("--side").arg("64").output();
    if !there.is_ok_and(|output| output.status.success()) {
        assert!(std::env::var_os("GDT_TEST_ALL").is_none(), "no GPU, not even of software");
        eprintln!("skipped: there is no GPU here; Debian's mesa-vulkan-drivers brings one of software that will do");
        return;
    }
    let rig = small_job(&setup);
    let kills = ["commit", "torn"].iter().map(|place| kill_at_each(&rig, place, 6)).sum::<u64>();
    assert!(kills >= 8, "only {kills} kills");
    kill_at_random(&rig, 3, kills_wanted(8));
}
