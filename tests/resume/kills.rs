//! SIGKILL at every place that matters, and at random moments.

use std::time::{Duration, Instant};

use crate::random::Random;
use crate::rig::{Rig, Run, Setup, files};
use crate::scattered;

/// Where a kill can hit: before the results of a phase get their names; when they have them but the journal lacks the line; when half of
/// the line is written; after it; and while a part is meshed, after a leaf or a tile.
pub(crate) const PLACES: [&str; 6] = ["commit", "published", "torn", "committed", "leaf", "tile"];

pub(crate) fn small_job(setup: &Setup) -> Rig {
    Rig::new(&scattered::clusters(8_000), setup)
}

/// For every `stride`-th time that a run comes to `place`: starts over, kills the run there and runs the job again. Returns the
/// number of kills.
#[track_caller]
pub(crate) fn kill_at_each(rig: &Rig, place: &str, stride: usize) -> u64 {
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
        // The next run finds all results, and only puts them in place.
        let waiting = rig.out().join("job/results/report.json");
        let was_over = rig.out().join("report.json").exists() || place == "committed" && waiting.exists();
        let resumed = rig.completes(&what)["resumed"].as_u64().unwrap();
        // The phases that were recorded stay.
        let recorded = match place {
            "committed" => count,
            "torn" => count - 1,
            _ => 0,
        };
        assert!(was_over || resumed >= recorded, "{what}: only {resumed} phases were kept");
    }
    kills
}

#[test]
fn a_job_killed_anywhere_goes_on_where_it_stopped() {
    let rig = small_job(&Setup::tiles_of(1_400));
    let kills: u64 = PLACES.iter().map(|place| kill_at_each(&rig, place, 1)).sum();
    assert!(kills >= 40, "only {kills} kills");
}

#[test]
fn a_job_of_two_threads_killed_anywhere_goes_on_where_it_stopped() {
    let rig = small_job(&Setup::tiles_of(1_400).threads(2));
    let kills: u64 = PLACES.iter().map(|place| kill_at_each(&rig, place, 2)).sum();
    assert!(kills >= 20, "only {kills} kills");
}

#[test]
fn a_job_with_max_edge_and_levels_goes_on_where_it_was_killed() {
    let setup = Setup::tiles_of(800).output("max_edge = \"auto\"").output("max_points_per_level_tile = 400");
    let rig = small_job(&setup);
    for folder in ["cut/", "levels/"] {
        assert!(rig.expected.keys().filter(|name| name.starts_with(folder)).count() > 2, "{folder}");
    }
    let kills: u64 = PLACES.iter().map(|place| kill_at_each(&rig, place, 3)).sum();
    assert!(kills >= 16, "only {kills} kills");
}

#[test]
fn a_job_with_max_error_goes_on_where_it_was_killed() {
    let rig = small_job(&Setup::tiles_of(800).output("max_error = 0.05"));
    let kills: u64 = PLACES.iter().chain(&["select"]).map(|place| kill_at_each(&rig, place, 4)).sum();
    assert!(kills >= 12, "only {kills} kills");
}

#[test]
fn a_job_that_finds_the_ground_goes_on_where_it_was_killed() {
    let input = "files = [\"cloud.csv\"]\nsurface = \"bare-earth\"".into();
    // Ground is looked for on a grid of metres, so the cloud is not wide.
    let mut cloud = scattered::uniform(8_000, 400, 5);
    cloud.iter_mut().for_each(|[_, _, z]| *z %= 5);
    let rig = Rig::new(&cloud, &Setup { input, ..Setup::tiles_of(800) });
    let kills: u64 = PLACES.iter().chain(&["ground"]).map(|place| kill_at_each(&rig, place, 4)).sum();
    assert!(kills >= 12, "only {kills} kills");
}

#[test]
fn a_job_killed_again_and_again_still_ends() {
    let rig = small_job(&Setup::tiles_of(1_400).threads(2));
    // Every run records a phase more than the one before.
    for (place, count) in [("committed", 1), ("torn", 2)] {
        rig.forget();
        let mut kills = 0;
        while rig.run_to(place, count).was_killed() {
            rig.has_nothing_half_written(place);
            kills += 1;
            assert!(kills < 100, "{place}: it makes no progress");
        }
        assert!(kills >= 4, "{place}: only {kills} kills");
        rig.is_complete(place);
    }
}

#[test]
fn a_job_killed_while_it_cleans_up_is_not_done_again() {
    let rig = small_job(&Setup::tiles_of(2_000));
    // It removes the store, the plan, the journals, and folders.
    let least = rig.stores().len() as u64 + 3;
    for count in 1.. {
        if !rig.run_to("cleaning", count).was_killed() {
            assert!(count > least, "{count}");
            break;
        }
        let before = std::fs::read(rig.out().join("report.json")).unwrap();
        rig.completes(&format!("cleaning, {count}"));
        // The journal shows that the job is complete, and after that the report does.
        let after = std::fs::read(rig.out().join("report.json")).unwrap();
        assert!(before == after && !rig.out().join("job").exists(), "cleaning, {count}: done again");
        rig.forget();
    }
}

pub(crate) fn kills_wanted(otherwise: u64) -> u64 {
    std::env::var("GDT_KILLS").ok().and_then(|text| text.parse().ok()).unwrap_or(otherwise)
}

/// Kills runs at random moments, `kills` times. Every run goes on where the one before was killed.
#[track_caller]
pub(crate) fn kill_at_random(rig: &Rig, seed: u64, kills: u64) {
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
fn a_job_of_one_thread_killed_at_random_moments_ends_with_the_same_bytes() {
    let rig = Rig::new(&scattered::gaussian(16_000), &Setup::tiles_of(800));
    kill_at_random(&rig, 1, kills_wanted(45));
}

#[test]
fn a_job_of_two_threads_killed_at_random_moments_ends_with_the_same_bytes() {
    let rig = Rig::new(&scattered::gaussian(16_000), &Setup::tiles_of(800).threads(2));
    kill_at_random(&rig, 2, kills_wanted(45));
}

/// Returns a job of several parts, on files of neighbouring points.
fn job_of_parts(setup: Setup) -> Rig {
    let cloud = scattered::gaussian(9_600);
    let folder = tempfile::tempdir().unwrap();
    let rig = Rig::of_files(folder, &cloud, 60_000, &setup);
    assert!(rig.expected.len() > 60);
    rig
}

fn parts_of(points: u64, threads: usize) -> Setup {
    let setup = Setup::tiles_of(280).threads(threads);
    Setup { triangulation: format!("{}\nmax_points_per_part = {points}", setup.triangulation), ..setup }
}

#[test]
fn a_job_of_parts_killed_anywhere_goes_on_where_it_stopped() {
    for setup in [parts_of(1_600, 1), parts_of(1_600, 1).freeing()] {
        let rig = job_of_parts(setup);
        let kills: u64 = PLACES.iter().map(|place| kill_at_each(&rig, place, 9)).sum();
        assert!(kills >= 20, "only {kills} kills");
    }
}

#[test]
fn a_job_of_parts_killed_at_random_moments_ends_with_the_same_bytes() {
    for (seed, threads) in [(5, 1), (6, 2)] {
        let rig = job_of_parts(parts_of(1_200, threads));
        kill_at_random(&rig, seed, kills_wanted(45));
    }
}

/// What was freed cannot be done again. So if a result is gone by then, the job starts over.
#[test]
fn a_job_of_parts_whose_results_are_lost_while_it_is_interrupted_starts_over() {
    let rig = job_of_parts(parts_of(1_600, 1));
    for lost in [1, 40] {
        assert!(rig.run_to("replacing", 1).was_killed());
        let results = rig.out().join("job/results");
        let mut names: Vec<String> = files(&results).into_keys().collect();
        names.retain(|name| name.starts_with("tiles/") && name.ends_with(".glb"));
        assert!(names.len() > 40, "{names:?}");
        names.iter().take(lost).for_each(|name| std::fs::remove_file(results.join(name)).unwrap());
        rig.completes("after results were lost");
    }
}

#[test]
fn a_job_on_a_gpu_goes_on_where_it_was_killed() {
    let setup = Setup::tiles_of(1_400).threads(2).backend("gpu");
    let there = std::process::Command::new(env!("CARGO_BIN_EXE_gdt-batch")).args(["gpu", "--leaves", "0"]).output();
    if !there.is_ok_and(|output| output.status.success()) {
        assert!(std::env::var_os("GDT_TEST_ALL").is_none(), "no GPU, not even a software renderer");
        eprintln!("skipped: there is no GPU here; the software renderer of Debian's mesa-vulkan-drivers is enough");
        return;
    }
    let rig = Rig::new(&scattered::uniform(8_000, 100_000, 5), &setup);
    let counts = &rig.completes("without a kill")["leaves"]["outcome"]["counts"];
    assert!(counts["on_gpu"].as_u64().unwrap() >= 6, "{counts}");
    let kills = ["leaf", "torn"].iter().map(|place| kill_at_each(&rig, place, 2)).sum::<u64>();
    assert!(kills >= 5, "only {kills} kills");
    kill_at_random(&rig, 3, kills_wanted(8));
}
