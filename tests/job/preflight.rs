//! Before a job, the program estimates the disk and memory that it needs, and refuses it if there is less, unless forced.

use std::fs;
use std::path::Path;

use job::preflight::check;
use job::preflight::check::Preflight;

use crate::clouds;
use crate::las_file::{LasFile, points_at};
use crate::program::{Job, number};
use sys::ErrorKind;

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
    for (lacking, kind, words) in [
        (
            Preflight { disk_free: Some(need - 1), ..preflight.clone() },
            ErrorKind::Retry,
            ["free some space or choose another", "--force"],
        ),
        (
            Preflight { memory_free: Some(1 << 20), ..preflight.clone() },
            ErrorKind::Retry,
            ["lower [limits] threads", "--force"],
        ),
        // No retry can make a folder below a file.
        (
            Preflight { output: below_a_file, ..preflight.clone() },
            ErrorKind::Usage,
            ["cannot write to", "cloud.csv/out"],
        ),
    ] {
        let error = lacking.passes().unwrap_err();
        assert_eq!(error.kind(), kind, "{error}");
        assert!(words.iter().all(|word| error.to_string().contains(word)), "{error}");
    }
    Preflight { disk_free: Some(need), memory_free: None, ..preflight }.passes().unwrap();
}

#[test]
fn the_disk_estimate_is_close_to_what_the_job_writes() {
    let folder = tempfile::tempdir().unwrap();
    // A square, and a strip whose preview has a tenth of the pixels.
    let strip: Vec<_> = clouds::uniform(60_000, 1_000_000, 4).into_iter().map(|[x, y, z]| [x, y / 10, z]).collect();
    let strip = || Job::on(&[clouds::write(folder.path(), "strip.csv", &strip)]);
    let few = || Job::on(&[clouds::write(folder.path(), "few.csv", &clouds::uniform(2_000, 1_000_000, 5))]);
    for (what, job) in [
        ("square", small_job(folder.path())),
        ("one format", small_job(folder.path()).with("output", "format = \"3dtiles\"")),
        ("strip", strip()),
        ("strip in parts", strip().with("triangulation", "max_points_per_part = 10000")),
        ("few points", few()),
    ] {
        let job = job.usual_preview();
        let estimate = job.run_with(&["check", "--json"]).succeeded().json();
        let report = job.report();
        let ratio = |estimated: u64, real: u64| estimated as f64 / real as f64;
        let [temporary, results] = ["temporary", "results"].map(|name| number(&estimate[name]));
        let [real, written] = ["bytes_temporary", "bytes_written"].map(|name| number(&report[name]));
        let ratios = [ratio(temporary, real), ratio(results, written), ratio(temporary + results, real + written)];
        assert!(ratios.iter().all(|ratio| *ratio >= 1.0) && ratios[2] < 1.6, "{what}: {ratios:?} times the real size");
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

/// They are kept until the new ones are complete, so their room is not free.
#[test]
fn the_results_of_an_earlier_job_do_not_count_as_room_on_the_disk() {
    let folder = tempfile::tempdir().unwrap();
    let file = crate::clouds::write(folder.path(), "cloud.csv", &crate::clouds::uniform(40_000, 100_000, 5));
    let job = Job::on(&[file]);
    let check = || job.run_with(&["check", "--json"]).succeeded().json();
    assert_eq!(number(&check()["disk_earlier"]), 0);
    let written = number(&job.report()["bytes_written"]);
    let earlier = number(&check()["disk_earlier"]);
    // And the report.
    assert!((written..written + 20_000).contains(&earlier), "{earlier} instead of {written}");
    let text = job.run_with(&["check"]).succeeded().out;
    assert!(text.contains("are kept until the new ones are complete"), "{text}");
}

#[test]
fn a_job_larger_than_the_disk_is_refused_unless_forced() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("bomb.laz");
    fs::write(&file, bomb()).unwrap();
    let job = Job::on(&[&file]);
    let lenient = Job::on(&[&file]).with("input", "max_malformed_fraction = 1.0");
    let check = lenient.run_with(&["check", "--json"]);
    let [need, free] = ["disk", "disk_free"].map(|name| number(&check.json()[name]));
    assert!(need > 100 << 30, "{need}");
    if need > free {
        check.refused(1, &["free some space", "--force"]);
        lenient.run().refused(1, &["free some space", "--force"]);
    }
    assert!(!lenient.out().exists(), "a refused job writes nothing");
    job.run_with(&["--force"]).refused(3, &["bomb.laz", "only 1000 points"]);
}

/// Returns the header of a LAS file with `count` points between 0 and these greatest x, y and z.
fn header(count: u32, max: [f64; 3]) -> Vec<u8> {
    let mut bytes = vec![0; 227];
    let mut put = |at: usize, value: &[u8]| bytes[at..at + value.len()].copy_from_slice(value);
    put(0, b"LASF");
    put(24, &[1, 2]);
    put(94, &227u16.to_le_bytes());
    put(96, &227u32.to_le_bytes());
    put(105, &20u16.to_le_bytes());
    put(107, &count.to_le_bytes());
    for (axis, greatest) in max.into_iter().enumerate() {
        put(131 + 8 * axis, &1.0f64.to_le_bytes());
        put(179 + 16 * axis, &greatest.to_le_bytes());
    }
    bytes
}

/// Writes a LAS file of points along the x axis, a metre apart in rows of eight, in the order of x. Every eighth is ground.
fn strip(path: &Path, count: u32) {
    let mut bytes = header(count, [(count / 8) as f64, 7.0, 99.0]);
    for i in 0..count {
        for value in [i / 8, i % 8, i * 7 % 100] {
            bytes.extend(value.to_le_bytes());
        }
        bytes.extend([0, 0, 9, if i % 8 == 0 { 2 } else { 1 }, 0, 0, 0, 0]);
    }
    fs::write(path, bytes).unwrap();
}

#[test]
fn the_estimates_count_what_bounds_and_classes_leave() {
    let folder = tempfile::tempdir().unwrap();
    let count = 2_000_000;
    let file = folder.path().join("strip.las");
    strip(&file, count);
    let check = |line: &str| Job::on(&[&file]).with("input", line).run_with(&["check", "--json"]).succeeded().json();
    let all = check("");
    assert_eq!(number(&all["kept"]), count as u64);
    let kept_and_disk = |line: &str| {
        let json = check(line);
        [number(&json["kept"]), number(&json["results"]) + number(&json["temporary"])]
    };
    let whole = number(&all["results"]) + number(&all["temporary"]);
    // A fortieth of the strip: a chunk. The sample allows for what it does not see.
    let [kept, disk] = kept_and_disk("bounds = [100000, 0, 106249, 7]");
    assert!((50_000..300_000).contains(&kept), "{kept}");
    assert!(disk < whole / 4, "{disk} of {whole}");
    let elsewhere = Job::on(&[&file]).with("input", "bounds = [-5, -5, -1, -1]");
    elsewhere.run_with(&["check"]).refused(3, &["no point is left", "the inputs lie in [0.00, 0.00, 250000.00, 7.00]"]);
    let [kept, _] = kept_and_disk("bounds = [-5, -5, 1e6, 8]");
    assert_eq!(kept, count as u64, "the header's box is inside");
    let [kept, _] = kept_and_disk("classes = [2]");
    assert!((250_000..320_000).contains(&kept), "an eighth is ground: {kept}");
    Job::on(&[&file]).with("input", "classes = [40]").run_with(&["check"]).refused(3, &["no point is left"]);
}

#[test]
fn a_job_on_a_part_of_a_cloud_takes_no_more_disk_than_estimated() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("strip.las");
    strip(&file, 400_000);
    let job = Job::on(&[&file]).with("input", "bounds = [10000, 0, 19999, 7]");
    let estimate = job.run_with(&["check", "--json"]).succeeded().json();
    assert_eq!(number(&estimate["kept"]), 80_000, "all chunks are in the sample");
    let report = job.report();
    for (estimated, real) in [("temporary", "bytes_temporary"), ("results", "bytes_written")] {
        let ratio = number(&estimate[estimated]) as f64 / number(&report[real]) as f64;
        // These points pack far better than those of a survey: heights below a hundred, no colours, whole steps.
        assert!((0.9..6.0).contains(&ratio), "{estimated}: {ratio} times the real size");
    }
}

#[test]
fn a_job_on_a_small_part_of_a_cloud_larger_than_the_disk_is_not_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("huge.las");
    let count = 2_000_000_000u32;
    fs::write(&path, header(count, [1e6; 3])).unwrap();
    // A hole takes no disk: all points are at 0, 0, 0.
    fs::OpenOptions::new().write(true).open(&path).unwrap().set_len(227 + 20 * count as u64).unwrap();
    let check = |line: &str| Job::on(&[&path]).with("input", line).run_with(&["check", "--json"]);
    let [need, free] = ["disk", "disk_free"].map(|name| number(&check("").json()[name]));
    assert!(need > 80 << 30, "{need}");
    if need > free {
        check("").refused(1, &["free some space"]);
        // The headers do not tell how much the bounds leave. The more it takes to know, the larger the sample.
        let part = check("bounds = [500000, 500000, 600000, 600000]").succeeded().json();
        assert!(number(&part["disk"]) <= free && number(&part["kept"]) < count as u64 / 20, "{part}");
    }
}
