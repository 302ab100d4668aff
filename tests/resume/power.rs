//! Power failures: what was not synced may be lost. Whatever is left, the next run ends with the same bytes, and results beside a
//! report are whole.

use std::path::PathBuf;

use serde_json::Value;

use crate::disk_model::{Change, Disk, Files, Loss, read_trace, restore};
use crate::random::Random;
use crate::rig::{Rig, Run, Setup};
use crate::scattered;

/// How many power failures each test tries; `GDT_POWER_FAILURES` raises it.
fn failures_wanted(otherwise: usize) -> usize {
    std::env::var("GDT_POWER_FAILURES").ok().and_then(|text| text.parse().ok()).unwrap_or(otherwise)
}

/// A run whose changes were written down.
pub(crate) struct TracedRun {
    pub(crate) before: Disk,
    pub(crate) changes: Vec<Change>,
    /// How many changes there were at each moment that is worth a power failure.
    moments: Vec<usize>,
}

/// Runs the job to its end and writes down every change.
#[track_caller]
pub(crate) fn traced(rig: &Rig, what: &str) -> TracedRun {
    let trace: PathBuf = rig.folder.path().join("trace");
    let before = Disk::read(rig.folder.path(), "out");
    let end = Run::start(rig.command().env("GDT_TRACE", &trace)).end();
    assert!(end.status.success(), "{what}: {end:?}");
    rig.is_complete(what);
    let changes = read_trace(&trace);
    let decisive = changes.iter().enumerate().filter(|(_, change)| change.is_decisive());
    let moments = decisive.map(|(at, _)| at + 1).collect();
    TracedRun { before, changes, moments }
}

/// Returns the results without the report, which holds times.
fn results(files: &Files) -> Files {
    let is_result = |name: &str| !name.starts_with("out/job") && name != "out/report.json";
    let results = files.iter().filter(|(name, bytes)| bytes.is_some() && is_result(name));
    results.map(|(name, bytes)| (name.clone(), bytes.clone())).collect()
}

/// Makes the output directory hold what a power failure left. If there is a report, all results beside it must be those of one job.
#[track_caller]
fn fail(rig: &Rig, left: &Files, whole: &[Files], what: &str) {
    if let Some(report) = left.get("out/report.json") {
        let is_whole = report.as_ref().is_some_and(|text| serde_json::from_slice::<Value>(text).is_ok());
        assert!(is_whole && whole.contains(&results(left)), "{what}: not all is whole beside a report");
    }
    restore(rig.folder.path(), "out", left);
}

/// Lets the power fail at about `wanted` moments spread over a whole run, each time with another loss, and once more in the run
/// that goes on from what was left.
#[track_caller]
pub(crate) fn fail_again_and_again(rig: &Rig, wanted: usize) {
    let first = traced(rig, "without a power failure");
    let whole = [results(&first.before.files()), results(&Disk::read(rig.folder.path(), "out").files())];
    let step = (first.moments.len() / failures_wanted(wanted)).max(1);
    let mut random = Random(20_261_122);
    for (turn, moment) in first.moments.iter().copied().step_by(step).enumerate() {
        let loss = match (turn % 5, Loss::Some(random.below(1 << 40))) {
            (0, _) => Loss::Everything,
            (1, _) => Loss::Bytes,
            (2, _) => Loss::Names,
            (_, some) => some,
        };
        let what = format!("after change {moment} ({}), {loss:?}", first.changes[moment - 1]);
        fail(rig, &first.before.after(&first.changes[..moment], loss), &whole, &what);
        let second = traced(rig, &what);
        let moment = second.moments[random.below(second.moments.len() as u64) as usize];
        let what = format!("{what}, and again after change {moment} ({})", second.changes[moment - 1]);
        let loss = Loss::Some(random.below(1 << 40));
        fail(rig, &second.before.after(&second.changes[..moment], loss), &whole, &what);
        rig.completes(&what);
    }
}

/// Counts the moments at which a power failure leaves a report beside results that are not whole, if only those of the program's
/// changes were made that `is_made` keeps.
fn broken_promises(run: &TracedRun, whole: &[Files], is_made: impl Fn(&Change) -> bool) -> usize {
    let changes: Vec<Change> = run.changes.iter().filter(|change| is_made(change)).cloned().collect();
    let is_broken = |moment: usize, loss| {
        let left = run.before.after(&changes[..moment], loss);
        left.contains_key("out/report.json") && !whole.contains(&results(&left))
    };
    let moments = (0..=changes.len()).filter(|&at| at == changes.len() || changes[at].is_decisive());
    moments.filter(|&at| (0..40).any(|seed| is_broken(at, Loss::Some(seed))) || is_broken(at, Loss::Bytes)).count()
}

/// A job with files of every kind.
pub(crate) fn setup() -> Setup {
    Setup::tiles_of(2_500).output("max_edge = 4000").output("max_points_per_level_tile = 1500")
}

#[test]
fn a_job_goes_on_after_a_power_failure() {
    let rig = Rig::new(&scattered::clusters(12_000), &setup()).syncing();
    for folder in ["cut/", "levels/"] {
        assert!(rig.expected.keys().any(|name| name.starts_with(folder)), "{folder}");
    }
    fail_again_and_again(&rig, 50);
}

/// Results of the store need not be on the disk when the points go.
#[test]
fn a_job_of_two_threads_that_commits_now_and_then_goes_on_after_a_power_failure() {
    let rig = Rig::new(&scattered::clusters(12_000), &setup().threads(2));
    fail_again_and_again(&rig, 30);
}

#[test]
fn a_job_of_parts_goes_on_after_a_power_failure() {
    let setup = setup();
    let setup = Setup { triangulation: format!("{}\nmax_points_per_part = 4000", setup.triangulation), ..setup };
    let folder = tempfile::tempdir().unwrap();
    let rig = Rig::of_files(folder, &scattered::gaussian(14_000), 60_000, &setup).syncing();
    fail_again_and_again(&rig, 25);
}

#[test]
fn a_power_failure_leaves_the_results_of_the_earlier_job_or_those_of_this_one() {
    let folder_of = |rig: &Rig, cloud| scattered::write(rig.folder.path(), "cloud.csv", cloud);
    let mut rig = Rig::new(&scattered::gaussian(9_000), &setup()).syncing();
    rig.completes("the earlier job");
    folder_of(&rig, &scattered::clusters(12_000));
    rig.expect(&setup());
    fail_again_and_again(&rig, 50);
}

/// Every sync is needed, and the model of the disk notices if it is left out.
#[test]
fn a_program_that_does_not_sync_breaks_its_promise() {
    let mut rig = Rig::new(&scattered::gaussian(3_000), &setup()).syncing();
    rig.completes("the earlier job");
    scattered::write(rig.folder.path(), "cloud.csv", &scattered::clusters(4_000));
    rig.expect(&setup());
    let run = traced(&rig, "without a power failure");
    let whole = [results(&run.before.files()), results(&Disk::read(rig.folder.path(), "out").files())];
    assert_eq!(broken_promises(&run, &whole, |_| true), 0);
    assert!(broken_promises(&run, &whole, |change| !matches!(change, Change::Sync { .. })) > 0, "no file is synced");
    assert!(broken_promises(&run, &whole, |change| !matches!(change, Change::SyncFolder { .. })) > 0, "no folder is");
    for folder in ["out", "out/tiles", "out/levels", "out/cut"] {
        let is_made = |change: &Change| !matches!(change, Change::SyncFolder { path } if path == folder);
        assert!(broken_promises(&run, &whole, is_made) > 0, "{folder} is not synced");
    }
}
