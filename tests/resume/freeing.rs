//! Jobs that free what no later phase needs. They take less of the disk, and end with the same bytes as others
//! whatever stops them.

use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

use crate::disk_model::{Change, Loss, restore};
use crate::kills::{PLACES, kill_at_each, kill_at_random, kills_wanted, small_job};
use crate::power::{TracedRun, fail_again_and_again, setup, traced};
use crate::rig::{Rig, Run, Setup};
use crate::scattered;

/// Tells whether the file system of temporary folders can free a part of a file.
fn can_free() -> bool {
    let rig = Rig::new(&scattered::gaussian(3_000), &Setup::tiles_of(1_000).freeing()).syncing();
    let run = traced(&rig, "a small job");
    let can = run.changes.iter().any(|change| matches!(change, Change::Free { .. }));
    if !can {
        eprintln!("skipped: this file system cannot free a part of a file");
    }
    can
}

#[test]
fn a_job_that_frees_its_mesh_goes_on_where_it_was_killed() {
    let rig = small_job(&Setup::tiles_of(800).freeing());
    let kills: u64 = PLACES.iter().map(|place| kill_at_each(&rig, place, 2)).sum();
    assert!(kills >= 20, "only {kills} kills");
}

#[test]
fn a_job_of_two_threads_that_frees_its_mesh_is_killed_at_random_moments() {
    let setup = Setup::tiles_of(800).threads(2).freeing().output("max_edge = 6000");
    let rig = Rig::new(&scattered::gaussian(16_000), &setup);
    kill_at_random(&rig, 4, kills_wanted(20));
}

#[test]
fn with_auto_no_leaf_is_freed_that_the_next_run_counts() {
    let rig = small_job(&Setup::tiles_of(800).output("max_edge = \"auto\"").freeing());
    let kills = kill_at_each(&rig, "committed", 1);
    assert!(kills >= 6, "only {kills} kills");
}

#[test]
fn a_job_that_frees_its_mesh_goes_on_after_a_power_failure() {
    let rig = Rig::new(&scattered::clusters(12_000), &setup().freeing()).syncing();
    fail_again_and_again(&rig, 30);
    let rig = Rig::new(&scattered::clusters(12_000), &setup().threads(2).freeing());
    fail_again_and_again(&rig, 15);
}

/// Lets the power fail after each of some frees. The points are on the disk, because reading is long ago, and of all else only what
/// was synced. Returns how often the next run started over.
fn starts_over(rig: &Rig, run: &TracedRun, is_made: impl Fn(&Change) -> bool) -> usize {
    let points_in = |changes: &[Change]| -> Vec<u64> {
        let point_file = |change: &Change| match change {
            Change::Create { inode, path } if path.ends_with(".points") => Some(*inode),
            _ => None,
        };
        changes.iter().filter_map(point_file).collect()
    };
    let is_free = |change: &Change| matches!(change, Change::Free { .. });
    let frees = run.changes.iter().enumerate().filter(|(_, change)| is_free(change)).map(|(at, _)| at + 1);
    let frees: Vec<usize> = frees.collect();
    assert!(frees.len() >= 5, "only {} frees", frees.len());
    let mut started_over = 0;
    for &moment in frees.iter().step_by(frees.len() / 5) {
        let mut changes: Vec<Change> = run.changes[..moment].iter().filter(|change| is_made(change)).cloned().collect();
        changes.extend(points_in(&run.changes[..moment]).into_iter().map(|inode| Change::Sync { inode }));
        restore(rig.folder.path(), "out", &run.before.after(&changes, Loss::Bytes));
        let said = rig.run().succeeded().err;
        rig.is_complete(&said);
        started_over += usize::from(said.contains("starting over"));
        rig.forget();
    }
    started_over
}

#[test]
fn nothing_is_freed_before_what_replaces_it_is_on_the_disk() {
    if !can_free() {
        return;
    }
    let setup = Setup::tiles_of(500).freeing();
    let setup = Setup { triangulation: format!("{}\nmax_points_per_part = 4000", setup.triangulation), ..setup };
    let folder = tempfile::tempdir().unwrap();
    let rig = Rig::of_files(folder, &scattered::gaussian(14_000), 60_000, &setup).syncing();
    let run = traced(&rig, "without a power failure");
    rig.forget();
    assert_eq!(starts_over(&rig, &run, |_| true), 0);
    let stores: Vec<u64> = run
        .changes
        .iter()
        .filter_map(|change| match change {
            Change::Create { inode, path } if path.ends_with(".store") => Some(*inode),
            _ => None,
        })
        .collect();
    let is_made = |change: &Change| !matches!(change, Change::Sync { inode } if stores.contains(inode));
    assert!(starts_over(&rig, &run, is_made) > 0, "the store need not be synced");
}

#[test]
fn another_style_after_freeing_starts_over_and_says_why() {
    if !can_free() {
        return;
    }
    let base = || Setup::tiles_of(2_000).output("color = \"elevation\"");
    let mut rig = Rig::new(&scattered::gaussian(20_000), &base()).syncing();
    for (setup, starts_over) in [(base().freeing(), true), (base(), false)] {
        rig.forget();
        rig.configure(&setup);
        assert!(rig.run_to("committed", 3).was_killed());
        rig.expect(&setup.output("normals = false"));
        let said = rig.run().succeeded().err;
        assert_eq!(said.contains("starting over"), starts_over, "{said}");
        assert_eq!(said.contains("keep_steps"), starts_over, "{said}");
        rig.is_complete(&said);
    }
}

/// Returns the bytes of disk that the temporary files of a job take, and those that its points take.
fn temporary_bytes(job: &Path) -> [u64; 2] {
    let bytes = |folder: &str| {
        let files = fs::read_dir(job.join(folder)).into_iter().flatten().flatten();
        let data = files.filter_map(|file| file.metadata().ok()).filter(|data| data.is_file());
        data.map(|data| data.blocks() * 512).sum::<u64>()
    };
    let points = bytes("points-by-part/0");
    [bytes("parts/0") + points, points]
}

/// The most that a small job takes is when its last tiles are triangulated.
#[test]
fn a_job_that_frees_its_mesh_takes_fewer_bytes_of_disk() {
    const POINTS: usize = 200_000;
    let can_free = can_free();
    let peaks = |setup: &Setup| {
        let rig = Rig::new(&scattered::gaussian(POINTS), setup);
        let (job, mut peaks) = (rig.out().join("job"), [0, 0]);
        let mut run = Run::start(rig.command().env("GDT_PREVIEW", "1024"));
        while run.child.try_wait().unwrap().is_none() {
            let now = temporary_bytes(&job);
            peaks = [peaks[0].max(now[0]), peaks[1].max(now[1])];
        }
        run.end().succeeded();
        peaks.map(|bytes| bytes as f64 / POINTS as f64)
    };
    let [[kept, points], [freed, _]] = [Setup::tiles_of(8_000), Setup::tiles_of(8_000).freeing()].map(|s| peaks(&s));
    // A bucket takes whole pages.
    assert!(points < 12.0, "{points} bytes for the points");
    // The pixels of the preview take 60 of them, whatever the number of points.
    assert!(!can_free || freed < kept - 10.0 && freed < 90.0, "{freed} bytes a point instead of {kept}");
}
