//! Before a job, the program estimates the disk and memory that it needs, and refuses it if there is less, unless forced.

use std::fs;
use std::path::Path;

use gdt_batch::job::preflight::check::{self, Preflight};

use crate::clouds;
use crate::las_file::{LasFile, points_at};
use crate::program::{Job, number};

fn small_job(folder: &Path) -> Job {
    let file = clouds::write(folder, "cloud.csv", &clouds::uniform(100_000, 1_000_000, 4));
    Job::on(&[file])
}

#[test]
fn a_job_refused_for_disk_or_memory_may_be_retried_and_one_below_a_file_not() {
    let folder = tempfile::tempdir().unwrap();
    let preflight = check::check(&gdt_batch::config::load(&small_job(folder.path()).config()).unwrap()).unwrap();
    preflight.passes().unwrap();
    let need = preflight.disk;
    let below_a_file = folder.path().join("cloud.csv/out");
    for (lacking, code, words) in [
        (Preflight { disk_free: Some(need - 1), ..preflight.clone() }, 1, ["make room or choose another", "--force"]),
        (Preflight { memory_free: Some(1 << 20), ..preflight.clone() }, 1, ["lower [limits] threads", "--force"]),
        // No retry can make a folder below a file.
        (Preflight { output: below_a_file, ..preflight.clone() }, 2, ["cannot write to", "cloud.csv/out"]),
    ] {
        let error = lacking.passes().unwrap_err();
        assert_eq!(error.exit_code(), code, "{error}");
        assert!(words.iter().all(|word| error.to_string().contains(word)), "{error}");
    }
    Preflight { disk_free: Some(need), memory_free: None, ..preflight }.passes().unwrap();
}

#[test]
fn the_disk_estimate_is_close_to_what_the_job_writes() {
    let folder = tempfile::tempdir().unwrap();
    let job = small_job(folder.path());
    let estimate = job.run_with(&["check", "--json"]).succeeded().json();
    let report = job.report();
    for (estimated, real) in [("temporary", "bytes_temporary"), ("results", "bytes_written")] {
        let ratio = number(&estimate[estimated]) as f64 / number(&report[real]) as f64;
        assert!((0.9..2.0).contains(&ratio), "{estimated}: {ratio} times the real size");
    }
}

/// Returns a small file that claims to hold four thousand million points in one chunk.
fn bomb() -> Vec<u8> {
    let mut bytes = LasFile::new(4, 7, 0, 1000).laz(&[1000], false);
    let chunk_size = 375 + 54 + 12;
    bytes[chunk_size..chunk_size + 4].copy_from_slice(&(u32::MAX - 1).to_le_bytes());
    bytes[247..255].copy_from_slice(&4_000_000_000u64.to_le_bytes());
    assert!(points_at(&bytes) > chunk_size);
    bytes
}

#[test]
fn a_job_larger_than_the_disk_is_refused_unless_forced() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("bomb.laz");
    fs::write(&file, bomb()).unwrap();
    let job = Job::on(&[file]);
    let check = job.run_with(&["check", "--json"]);
    let [need, free] = ["disk", "disk_free"].map(|name| number(&check.json()[name]));
    assert!(need > 100 << 30, "{need}");
    if need > free {
        check.refused(1, &["make room", "--force"]);
        job.run().refused(1, &["make room", "--force"]);
    }
    assert!(!job.out().exists(), "a refused job writes nothing");
    job.run_with(&["--force"]).refused(3, &["bomb.laz", "only 1000 points"]);
}
