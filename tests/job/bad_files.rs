//! Bad files among good ones: the job stops, or leaves them out as if nobody had named them and says so. Files that change while
//! a job reads them.

use std::fs;
use std::path::{Path, PathBuf};

use job::durable::directory::JobDirectory;
use job::durable::lock::Lock;
use job::index::PartIndex;
use job::partition::part_points::read_inputs;
use job::partition::parts::Parts;
use job::plan::job_plan::Plan;
use job::plan::lattice_choice::LatticeCoarsening;
use job::plan::make_plan::make_plan;
use job::progress::stage::ProgressOutput;
use points::options::OnBadFile;
use serde_json::Value;
use sys::ErrorKind;

use crate::las_file::{LasFile, points_at};
use crate::program::{Job, Said, number};

/// Writes `bytes` to a file called `name`.
pub(crate) fn write(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    fs::write(&path, bytes).unwrap();
    path
}

pub(crate) fn good(folder: &Path) -> PathBuf {
    write(folder, "good.laz", &LasFile::new(4, 7, 0, 3000).laz(&[500], false))
}

/// Returns a layered LAZ of 900 points in steps of `scale`. Its second chunk, 300 points, is damaged.
pub(crate) fn damaged(scale: f64) -> Vec<u8> {
    let file = LasFile::new(4, 7, 0, 900);
    let mut bytes = file.laz(&[300], false);
    let mut at = points_at(&bytes) + 8;
    let numbers = |bytes: &[u8], at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    // Skip the first chunk: a record, its number of points, the sizes of its ten layers, and the layers.
    let layers: usize = (1..=10).map(|layer| numbers(&bytes, at + file.length() as usize + 4 * layer)).sum();
    at += file.length() as usize + 4 + 4 * 10 + layers;
    let size_of_a_layer = at + file.length() as usize + 4;
    bytes[size_of_a_layer..size_of_a_layer + 4].copy_from_slice(&u32::MAX.to_le_bytes());
    for axis in 0..2 {
        bytes[131 + 8 * axis..139 + 8 * axis].copy_from_slice(&scale.to_le_bytes());
    }
    bytes
}

fn skipping(files: &[PathBuf]) -> Job {
    Job::on(files).with("input", "on_bad_file = \"skip\"").tiles_of(200).threads(2)
}

/// Runs a job on `files` that skips bad ones. Asserts that its mesh is that of `good` alone. Returns its output and its report.
#[track_caller]
fn skips(files: &[PathBuf], good: &Path) -> (Said, Value) {
    let job = skipping(files);
    let said = job.run().succeeded();
    let report: Value = serde_json::from_slice(&fs::read(job.out().join("report.json")).unwrap()).unwrap();
    assert_eq!(job.verified()["digest"], Job::on(&[good]).tiles_of(200).digest());
    assert_eq!(number(&report["points"]["read"]), 3000);
    assert_eq!(number(&report["files"]), 1);
    (said, report)
}

#[test]
fn bad_files_that_the_plan_finds_are_left_out_and_listed() {
    let folder = tempfile::tempdir().unwrap();
    let good = good(folder.path());
    let whole = fs::read(&good).unwrap();
    let bad = [
        write(folder.path(), "empty.las", b""),
        write(folder.path(), "page.laz", b"<html>not found</html>"),
        write(folder.path(), "cut.laz", &whole[..whole.len() / 2]),
    ];
    let files = [&bad[..1], std::slice::from_ref(&good), &bad[1..]].concat();
    Job::on(&files).run().refused(3, &["empty.las", "is empty"]);
    let (said, report) = skips(&files, &good);
    for words in ["LEFT OUT: 3 of 4 input files", "empty.las: is empty", "page.laz: ", "cut.laz: claims 3000"] {
        assert!(said.out.contains(words), "{words}: {}", said.out);
    }
    assert!(said.err.trim_end().lines().last().unwrap().starts_with("LEFT OUT: 3 of 4 input files"), "{}", said.err);
    assert!(said.err.contains("left out: ") && said.err.contains("page.laz"), "{}", said.err);
    let files_of = |report: &Value| report["skipped"].as_array().unwrap().len();
    assert_eq!(files_of(&report), 3);
    let job = skipping(&files);
    let check = job.run_with(&["check"]).succeeded().out;
    assert!(check.contains("LEFT OUT: 3 of 4 input files") && check.contains("page.laz"), "{check}");
    let quiet = job.run_with(&["--quiet", "--json"]).succeeded();
    assert_eq!((quiet.err.lines().count(), files_of(&quiet.json())), (1, 3), "one line when quiet: {}", quiet.err);
}

#[test]
fn a_file_that_is_damaged_in_its_middle_is_left_out_whole() {
    let folder = tempfile::tempdir().unwrap();
    let good = good(folder.path());
    // With the step of the good file, and with a finer one, which would make the lattice of the whole job finer.
    for scale in [0.01, 0.0005] {
        let bad = write(folder.path(), "damaged.laz", &damaged(scale));
        for files in [[bad.clone(), good.clone()], [good.clone(), bad.clone()]] {
            Job::on(&files).run().refused(3, &["damaged.laz", "chunk 1 is damaged", "on_bad_file"]);
            let (said, report) = skips(&files, &good);
            assert!(said.out.contains("damaged.laz: 300 of 900 records are malformed"), "{}", said.out);
            assert_eq!(report["lattice"]["resolution"], "0.01");
            assert!(said.err.contains("measuring all files and starting again"), "{}", said.err);
        }
    }
}

#[test]
fn with_skip_the_malformed_fraction_applies_to_each_file() {
    let folder = tempfile::tempdir().unwrap();
    let rows = |count: usize| (0..count).map(|i| format!("{},{},{}\n", i * 7 % 101, i * i % 89, i)).collect::<String>();
    let good = write(folder.path(), "large.csv", rows(1000).as_bytes());
    let sound = write(folder.path(), "sound.csv", (rows(96) + &"1,2\n".repeat(4)).as_bytes());
    let bad = write(folder.path(), "bad.csv", (rows(94) + &"1,2\n".repeat(6)).as_bytes());
    let job = Job::on(&[good, sound, bad]).with("input", "max_malformed_fraction = 0.05");
    assert_eq!(number(&job.report()["points"]["malformed"]), 10, "one fraction for all files: 10 of 1200 is little");
    let report = job.with("input", "on_bad_file = \"skip\"").report();
    assert_eq!((number(&report["points"]["read"]), number(&report["points"]["malformed"])), (1100, 4));
    assert!(report["skipped"][0]["file"].as_str().unwrap().ends_with("bad.csv"), "{}", report["skipped"]);
}

#[test]
fn a_job_with_only_bad_files_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let empty = write(folder.path(), "empty.las", b"");
    let bad = write(folder.path(), "damaged.laz", &damaged(0.01));
    skipping(std::slice::from_ref(&empty)).run().refused(3, &["no input is left", "all 1 are bad", "empty.las"]);
    skipping(&[empty, bad]).run().refused(3, &["no input is left", "all 2 are bad"]);
}

/// Makes the plan of a job on one good file.
fn planned(folder: &Path) -> (JobDirectory, Plan) {
    let good = good(folder);
    let job = skipping(&[good]);
    let plan = make_plan(&gdt_batch::config::load(&job.config()).unwrap(), LatticeCoarsening::default()).unwrap();
    (JobDirectory::new(&folder.join("out")), plan)
}

/// Returns the error of the step that reads the points when `change` alters the input after the plan was made.
fn error_after(change: impl Fn(&Path)) -> job::Error {
    let folder = tempfile::tempdir().unwrap();
    let (directory, plan) = planned(folder.path());
    let _lock = Lock::take(directory.job()).unwrap();
    change(&plan.inputs[0].source.path);
    assert_eq!(plan.options.input.on_bad_file, OnBadFile::Skip);
    let (parts, stage) = (Parts::of(&plan), ProgressOutput::Quiet.stage("read", 0, "points"));
    read_inputs(&plan, &parts, &directory, PartIndex::FIRST, 0, false, &stage).unwrap_err()
}

#[test]
fn a_job_whose_file_changes_after_the_plan_may_be_retried_even_with_skip() {
    let cut = |path: &Path| {
        let bytes = fs::read(path).unwrap();
        fs::write(path, &bytes[..bytes.len() / 2]).unwrap();
    };
    for (error, words) in [
        (error_after(|path| fs::remove_file(path).unwrap()), "good.laz"),
        (error_after(cut), "has changed while it was in use"),
        (error_after(|path| fs::write(path, vec![7; 1 << 20]).unwrap()), "to 1048576; run again"),
    ] {
        assert_eq!(error.kind(), ErrorKind::Retry, "{error}");
        assert!(error.to_string().contains(words), "{error}");
    }
}
