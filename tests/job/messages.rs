//! What the program prints: about broken files, before a job, and as JSON.

use std::fs;

use crate::clouds;
use crate::common::shared;
use crate::program::{Job, gdt_batch, gdt_batch_into, gdt_batch_within, number};

/// Address space that is plenty for small files and far below what hostile headers claim.
const PLENTY_MIB: u64 = 1_536;

#[test]
fn broken_files_are_refused_or_read_as_far_as_possible() {
    let Some(shared) = shared() else { return };
    for (name, code, words) in [
        ("1.2-no-points.las", 3, &["1.2-no-points.las", "1065", "on_bad_file"][..]),
        ("1.2-with-color-clipped.las", 3, &["1.2-with-color-clipped.las", "1065", "max_malformed_fraction"]),
        ("badheader.txt", 3, &["badheader.txt", "2 columns x", "columns"]),
        ("git-lfs-pointer.laz", 3, &["git-lfs-pointer.laz", "git lfs pull"]),
        ("truncated-mid-chunk.laz", 3, &["truncated-mid-chunk.laz", "max_malformed_fraction"]),
        ("garbage_nVariableLength.las", 3, &["garbage_nVariableLength.las"]),
        ("bad_vlr_count.las", 0, &["3 variable length records", "2"]),
        ("simple-laszip-compressor-version-1.2r0.laz", 0, &[]),
    ] {
        let job = Job::on(&[shared.join("data/bad").join(name)]).threads(2);
        let said = gdt_batch_within(PLENTY_MIB, job.folder(), &[job.config().to_str().unwrap()]);
        if code == 0 {
            assert_eq!(said.code, 0, "{name}: {}", said.err);
            assert!(words.iter().all(|word| said.out.contains(word)), "{name}: {}", said.out);
            job.verified();
        } else {
            said.refused(code, words);
            let error = &said.err[said.err.find("error: ").unwrap()..];
            let sentences = error.trim_end().lines().filter(|line| !line.starts_with("  fix: ")).count();
            assert_eq!(sentences, 1, "{name}: one sentence and its remedy: {error}");
        }
    }
}

#[test]
fn the_good_points_of_a_broken_file_are_read_on_request() {
    let Some(shared) = shared() else { return };
    for (name, kept, lost) in [("1.2-with-color-clipped.las", 1_064, 1), ("truncated-mid-chunk.laz", 44_372, 29_031)] {
        let job = Job::on(&[shared.join("data/bad").join(name)]).with("input", "max_malformed_fraction = 0.5");
        let report = job.report();
        job.verified();
        let points = &report["points"];
        assert_eq!((number(&points["kept"]), number(&points["malformed"])), (kept, lost), "{name}");
        assert!(report["warnings"].to_string().contains(name), "{report}");
    }
}

#[test]
fn malformed_lines_are_shown_and_counted() {
    let folder = tempfile::tempdir().unwrap();
    let path = clouds::write(folder.path(), "cloud.csv", &clouds::uniform(200, 10_000, 4));
    let text = fs::read_to_string(&path).unwrap() + "1,2\nfour,5,6\n";
    fs::write(&path, text).unwrap();
    Job::on(&[&path]).run().refused(3, &["cloud.csv", "line 202", "max_malformed_fraction"]);
    let job = Job::on(&[&path]).with("input", "max_malformed_fraction = 0.05");
    let said = job.run().succeeded();
    assert!(said.out.contains("line 202") && said.out.contains("line 203"), "{}", said.out);
    assert_eq!(number(&job.report()["points"]["malformed"]), 2);
}

#[test]
fn unreadable_files_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let empty = folder.path().join("empty.las");
    fs::write(&empty, "").unwrap();
    Job::on(&[&empty]).run().refused(3, &["empty.las"]);
    gdt_batch(folder.path(), &["info", "."]).refused(3, &["empty.las", "is empty"]);
    fs::create_dir(folder.path().join("none")).unwrap();
    gdt_batch(folder.path(), &["info", "none"]).refused(2, &["none", "no point cloud"]);
    gdt_batch(folder.path(), &["info", "missing.las"]).refused(2, &["no file missing.las"]);
    for path in ["missing", ".", "empty.las"] {
        gdt_batch(folder.path(), &["verify", path]).refused(2, &[path, "output directory of a finished job"]);
    }
}

#[test]
#[cfg(unix)]
fn pipes_and_devices_are_refused_without_waiting_for_them() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir_all(folder.path().join("out/tiles")).unwrap();
    for name in ["pipe.csv", "out/tiles/000000.glb"] {
        let made = std::process::Command::new("mkfifo").arg(folder.path().join(name)).status().unwrap();
        assert!(made.success());
    }
    gdt_batch(folder.path(), &["verify", "out"]).refused(4, &["000000.glb", "regular file"]);
    for path in ["pipe.csv", "/dev/zero"] {
        gdt_batch(folder.path(), &["info", path]).refused(3, &[path, "regular file"]);
    }
    gdt_batch(folder.path(), &["info", "pipe.csv"]).refused(3, &["is a pipe", "cannot be read twice"]);
    for name in ["pipe.csv", "*.csv"] {
        Job::on(&[folder.path().join(name)])
            .run()
            .refused(2, &["pipe.csv", "files", "is a pipe", "cannot be read twice"]);
    }
}

#[test]
#[cfg(unix)]
fn a_pipe_in_the_place_of_a_file_of_the_job_is_named_and_not_waited_for() {
    let (_folder, job) = small_job();
    job.report();
    let done = job.out();
    let names = [
        "job/journal",
        "job/lock",
        "job/plan.json",
        "job/parts/0/journal",
        "job/parts/0/steps.3.store",
        "report.json",
        "XXH128SUMS",
        "tileset.json",
        "tiles/000001.glb",
        "tiles/000002.partial",
        "levels/000000.glb",
        "preview.partial",
    ];
    for name in names {
        let path = done.join(name);
        let _ = fs::remove_file(&path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
        job.run().refused(2, &[name, "is a pipe or a device", "move it away"]);
        let config = job.config();
        gdt_batch(job.folder(), &["check", config.to_str().unwrap()]).refused(2, &[name, "is a pipe or a device"]);
        if !name.starts_with("job/") && !name.ends_with(".partial") {
            let word = name.trim_start_matches("levels/000000.glb");
            let said = gdt_batch(job.folder(), &["verify", "out"]);
            assert!(said.code == 4 || name.starts_with("levels") && said.code == 0, "{name}: {said:?}");
            assert!(said.out.contains(word), "{name}: {}", said.out);
        }
        fs::remove_dir_all(&done).unwrap();
        job.report();
    }
}

#[test]
#[cfg(unix)]
fn a_path_that_leads_nowhere_is_no_reason_to_try_again() {
    let (_folder, job) = small_job();
    job.report();
    fs::write(job.folder().join("file.las"), "LASF").unwrap();
    std::os::unix::fs::symlink("loop.las", job.folder().join("loop.las")).unwrap();
    let long = "x".repeat(300);
    for path in ["file.las/x", "loop.las", "loop.las/x", &long] {
        gdt_batch(job.folder(), &["info", path]).refused(2, &[path]);
        gdt_batch(job.folder(), &["verify", path]).refused(2, &[path]);
        gdt_batch(job.folder(), &["sample", &format!("{path}/x.las")]).refused(2, &[path]);
        gdt_batch(job.folder(), &["verify", "out", "--input", path]).refused(2, &[path]);
        Job::on(&[job.folder().join(path)]).run().refused(2, &[path]);
        gdt_batch(job.folder(), &[path]).refused(2, &[path]);
    }
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_standard_output_does_not_undo_a_finished_job() {
    let (_folder, job) = small_job();
    let config = job.config();
    let config = config.to_str().unwrap();
    let said = gdt_batch_into("/dev/full", job.folder(), &[config]);
    assert_eq!(said.code, 0, "{}", said.err);
    assert!(
        said.err.contains("the job is done, and its report is in") && said.err.contains("No space left"),
        "{}",
        said.err
    );
    job.verified();
    let said = gdt_batch_into("/dev/full", job.folder(), &["--json", config]);
    said.refused(1, &["standard output", "No space left"]);
    assert!(said.err.contains("the job is done"), "{}", said.err);
    gdt_batch_into("/dev/full", job.folder(), &["verify", "out"]).refused(1, &["standard output"]);
    fs::remove_file(job.out().join("tiles/000001.glb")).unwrap();
    gdt_batch_into("/dev/full", job.folder(), &["verify", "out"]).refused(4, &["not the Delaunay triangulation"]);
}

/// To open a pipe for writing is to wait for a reader.
#[test]
#[cfg(unix)]
fn a_sample_never_goes_into_a_pipe_or_a_directory() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe.laz");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    std::fs::create_dir(folder.path().join("folder.las")).unwrap();
    for name in ["pipe.laz", "folder.las"] {
        for arguments in [&["sample", name, "--overwrite"][..], &["sample", name]] {
            gdt_batch(folder.path(), arguments).refused(2, &[name, "is not a regular file", "choose another name"]);
        }
    }
    assert!(pipe.exists());
}

#[test]
fn a_sample_overwrites_no_file_unless_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("new/terrain.laz");
    let sample =
        |more: &[&str]| gdt_batch(folder.path(), &[&["sample", "new/terrain.laz", "--points", "100"], more].concat());
    sample(&[]).succeeded();
    let first = fs::read(&path).unwrap();
    sample(&["--seed", "2"]).refused(2, &["new/terrain.laz exists", "--overwrite"]);
    assert!(fs::read(&path).unwrap() == first);
    sample(&["--seed", "2", "--overwrite"]).succeeded();
    assert!(fs::read(&path).unwrap() != first);
    let said = gdt_batch(folder.path(), &["info", "new/terrain.laz"]).succeeded();
    assert!(said.out.contains("LAZ 1.4") && said.out.contains("100"), "{}", said.out);
}

fn small_job() -> (tempfile::TempDir, Job) {
    let folder = tempfile::tempdir().unwrap();
    let path = clouds::write(folder.path(), "cloud.csv", &clouds::uniform(5_000, 10_000, 4));
    let job = Job::on(&[&path]).tiles_of(1_000);
    (folder, job)
}

#[test]
fn check_describes_the_job_and_writes_nothing() {
    let (_folder, job) = small_job();
    let files = || {
        let mut names: Vec<_> = fs::read_dir(job.folder()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        names.sort();
        names
    };
    job.config();
    let before = files();
    let text = job.run_with(&["check"]).succeeded().out;
    let json = job.run_with(&["check", "--json"]).succeeded().json();
    assert_eq!(files(), before);
    assert!(text.contains("cloud.csv") && text.contains("5 000"), "{text}");
    assert_eq!(number(&json["records"]), 5_000);
    let (tiles, real) = (number(&json["tiles"]), number(&job.report()["tiles"]));
    assert!(real <= 2 * tiles && tiles <= 2 * real, "about {tiles} tiles, {real} in fact");
}

#[test]
fn quiet_prints_nothing_and_json_prints_only_json() {
    let (_folder, job) = small_job();
    let quiet = job.run_with(&["--quiet"]).succeeded();
    assert_eq!((quiet.out.as_str(), quiet.err.as_str()), ("", ""));
    let summary = job.run().succeeded().out;
    for words in ["triangles between 5 000 points", "Delaunay triangulation", "tileset.json", "preview.png", "next "] {
        assert!(summary.contains(words), "{words}: {summary}");
    }
    assert!(
        summary.lines().filter(|line| !line.contains("warning") && !line.contains("fix:")).count() <= 8,
        "{summary}"
    );
    let loud = job.run_with(&["--verbose"]).succeeded();
    for words in ["points read", "peak memory", "triangulate", summary.lines().next().unwrap()] {
        assert!(loud.out.contains(words), "{words}: {}", loud.out);
    }
    assert!(loud.err.contains("mesh: done"), "a log gets a line for each stage: {}", loud.err);
    let json = job.run_with(&["--json", "-q"]).succeeded();
    assert_eq!(json.err, "");
    let lines = job.run_with(&["--progress", "json"]).succeeded().err;
    let mesh =
        |line: &serde_json::Value| line["stage"] == "mesh" && line["finished"] == true && line["done"] == line["total"];
    let lines: Vec<serde_json::Value> = lines.lines().map(|line| serde_json::from_str(line).expect(line)).collect();
    assert!(lines.iter().any(mesh), "{lines:?}");
    let stages = json.json()["stages"].as_array().unwrap().len();
    assert!(stages >= 5, "{stages} stages");
    let quiet = gdt_batch(job.folder(), &["verify", "out", "-q"]).succeeded();
    assert_eq!((quiet.out.as_str(), quiet.err.as_str()), ("", ""));
}

#[test]
fn verify_finds_a_missing_a_turned_and_a_truncated_tile() {
    let (_folder, job) = small_job();
    // Without packing the corners are at the end of a tile.
    let job = job.with("output", "compression = \"none\"");
    let digest = job.digest();
    let tiles = job.out().join("tiles");
    let mut names: Vec<_> = fs::read_dir(&tiles).unwrap().map(|entry| entry.unwrap().path()).collect();
    names.sort();
    let (victim, good) = (&names[names.len() / 2], fs::read(&names[names.len() / 2]).unwrap());
    let verify = || gdt_batch(job.folder(), &["verify", "out"]);
    fs::remove_file(victim).unwrap();
    verify().refused(4, &["failed: not the Delaunay triangulation"]);
    assert!(verify().out.contains("FAILS: "));
    // Swap two corners of the last triangle, so that it turns the wrong way.
    let mut turned = good.clone();
    let end = good.len() - (good.len() - 2) % 2;
    let last = (0..end).rev().find(|&at| at % 2 == 0 && good[at..at + 2] != good[at - 2..at]).unwrap();
    (turned[last - 2], turned[last - 1], turned[last], turned[last + 1]) =
        (good[last], good[last + 1], good[last - 2], good[last - 1]);
    fs::write(victim, &turned).unwrap();
    verify().refused(4, &["failed: not the Delaunay triangulation"]);
    fs::write(victim, &good[..good.len() / 2]).unwrap();
    verify().refused(4, &["failed: not the Delaunay triangulation"]);
    fs::write(victim, &good).unwrap();
    assert_eq!(job.verified()["digest"], digest.as_str());
}
