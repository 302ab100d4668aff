//! A job keeps to the memory limit of the configuration with any cloud.

use serde_json::Value;

use job::progress::stage::ProgressOutput;

use crate::clouds;
use crate::program::{Job, Said, gdt_batch, number};
use sys::ErrorKind;

#[track_caller]
fn stays_within(report: &Value, mebibytes: u64) {
    let Some(peak) = report["peak_memory"].as_u64() else {
        eprintln!("not tested: this system does not tell the peak memory of a process");
        return;
    };
    assert!(peak < mebibytes << 20, "{} MiB of {mebibytes} MiB", peak >> 20);
}

#[test]
fn three_million_points_fit_in_128_mib() {
    let folder = tempfile::tempdir().unwrap();
    gdt_batch(folder.path(), &["sample", "terrain.las", "--points", "3000000"]).succeeded();
    let job = Job::on(&[folder.path().join("terrain.las")]).usual_preview().with("limits", "memory = \"128 MiB\"");
    let report = job.report();
    assert_eq!(number(&report["points"]["read"]), 3_000_000);
    stays_within(&report, 128);
    let memory = ["verify", "out", "--memory", "128 MiB", "--json"];
    assert_eq!(gdt_batch(job.folder(), &memory).succeeded().json()["sites"], report["sites"]);
}

#[test]
fn a_crowd_in_one_corner_fits_in_128_mib() {
    let folder = tempfile::tempdir().unwrap();
    let mut cloud = clouds::uniform(1_500_000, 3_000, 8);
    cloud.extend([[6_000_000, 6_000_000, 0], [6_000_000, 0, 0], [0, 6_000_000, 0]]);
    let file = clouds::write(folder.path(), "crowd.csv", &cloud);
    drop(cloud);
    let job = Job::on(&[file]).usual_preview().with("limits", "memory = \"128 MiB\"");
    stays_within(&job.report(), 128);
    job.verified();
}

#[test]
fn two_million_points_on_one_spot_fit_in_128_mib() {
    let folder = tempfile::tempdir().unwrap();
    let mut cloud = vec![[500, 500, 7]; 2_000_000];
    cloud.extend(clouds::uniform(1_000, 1_000, 3));
    let file = clouds::write(folder.path(), "spot.csv", &cloud);
    let job = Job::on(&[file]).usual_preview().with("limits", "memory = \"128 MiB\"");
    let report = job.report();
    assert!(number(&report["duplicates"]) >= 1_999_999);
    stays_within(&report, 128);
    job.verified();
}

/// Every thread that makes a coarser tile holds the tiles below it, so sixteen at once would take 400 MB.
#[test]
fn coarser_tiles_of_many_threads_fit_in_256_mib() {
    let folder = tempfile::tempdir().unwrap();
    let file = clouds::write(folder.path(), "square.csv", &clouds::uniform(2_000_000, 100_000, 8));
    let job =
        Job::on(&[file]).usual_preview().with("limits", "memory = \"256 MiB\"").with("output", "format = \"3dtiles\"");
    stays_within(&job.threads(16).processors(8).tiles_of(5_000).report(), 256);
}

/// More threads only take each other's cache.
#[test]
fn no_more_than_two_threads_start_for_each_processor() {
    let folder = tempfile::tempdir().unwrap();
    let file = clouds::write(folder.path(), "few.csv", &clouds::uniform(1_000, 1_000, 3));
    let started = |threads: usize| number(&Job::on(&[&file]).threads(threads).report()["threads"]);
    let processors = started(0);
    assert_eq!((started(1), started(1_000)), (1, 2 * processors));
    if cfg!(feature = "fault-injection") {
        let report = Job::on(&[&file]).threads(16).processors(3).report();
        assert_eq!(number(&report["threads"]), 6);
    }
}

#[test]
fn tiles_too_large_for_the_memory_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let [few, many] = [1_000, 250_000].map(|count| {
        let file = clouds::write(folder.path(), &format!("{count}.csv"), &clouds::uniform(count, 100_000, 3));
        Job::on(&[file]).tiles_of(5_000_000).usual_preview().with("limits", "memory = \"128 MiB\"")
    });
    many.run().refused(2, &["max_points_per_tile", "memory"]);
    few.digest();
}

/// Returns the limit that the message says to set.
#[track_caller]
fn advised(said: &Said) -> String {
    let (_, after) = said.err.split_once("set memory = \"").unwrap_or_else(|| panic!("{}", said.err));
    after.split_once('"').unwrap().0.to_string()
}

#[test]
fn one_raise_of_the_memory_suffices_for_large_tiles() {
    let folder = tempfile::tempdir().unwrap();
    let file = clouds::write(folder.path(), "many.csv", &clouds::uniform(250_000, 100_000, 3));
    let job = |memory: &str| {
        Job::on(&[&file]).usual_preview().tiles_of(5_000_000).with("limits", &format!("memory = {memory:?}"))
    };
    let said = job("128M").run();
    said.refused(2, &["max_points_per_tile"]);
    let job = job(&advised(&said));
    job.run().succeeded();
    job.verified();
}

#[test]
fn one_raise_of_the_memory_suffices_for_points_that_no_tile_can_decide() {
    let folder = tempfile::tempdir().unwrap();
    // Two short lines far apart: the disc of every triangle is wider than any cell.
    let cloud: Vec<[i64; 3]> = (0..24_000).map(|i| [i / 2, i % 2 * 1_000_000, i % 7]).collect();
    let file = clouds::write(folder.path(), "lines.csv", &cloud);
    let job = Job::on(&[&file]).tiles_of(1_000).threads(1);
    let mut options = gdt_batch::config::load(&job.config()).unwrap();
    // Less than a configuration may say, so that few points are too many.
    options.limits.memory.0 = 11 << 20;
    let error = job::run(&options, ProgressOutput::Quiet).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Retry);
    let said = error.to_string();
    assert!(said.contains("no tile can decide") && said.contains("what is done is kept"), "{said}");
    let (_, after) = said.split_once("set memory = \"").unwrap();
    let mebibytes: u64 = after.split_once(" MiB").unwrap().0.parse().unwrap();
    options.limits.memory.0 = mebibytes << 20;
    job::run(&options, ProgressOutput::Quiet).unwrap();
    job.verified();
}
