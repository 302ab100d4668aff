//! A job keeps to the memory limit of the configuration with any cloud.

use serde_json::Value;

use crate::clouds;
use crate::program::{Job, gdt_batch, number};

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
    let job = Job::on(&[folder.path().join("terrain.las")]).with("limits", "memory = \"128 MiB\"");
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
    let job = Job::on(&[file]).with("limits", "memory = \"128 MiB\"");
    stays_within(&job.report(), 128);
    job.verified();
}

#[test]
fn two_million_points_on_one_spot_fit_in_128_mib() {
    let folder = tempfile::tempdir().unwrap();
    let mut cloud = vec![[500, 500, 7]; 2_000_000];
    cloud.extend(clouds::uniform(1_000, 1_000, 3));
    let file = clouds::write(folder.path(), "spot.csv", &cloud);
    let job = Job::on(&[file]).with("limits", "memory = \"128 MiB\"");
    let report = job.report();
    assert!(number(&report["duplicates"]) >= 1_999_999);
    stays_within(&report, 128);
    job.verified();
}

#[test]
fn tiles_too_large_for_the_memory_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let [few, many] = [1_000, 250_000].map(|count| {
        let file = clouds::write(folder.path(), &format!("{count}.csv"), &clouds::uniform(count, 100_000, 3));
        Job::on(&[file]).tiles_of(5_000_000).with("limits", "memory = \"128 MiB\"")
    });
    many.run().refused(2, &["max_points_per_tile", "memory"]);
    few.digest();
}
