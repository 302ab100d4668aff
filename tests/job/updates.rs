//! `--update`: what has changed is computed again, and nothing else; the mesh is that of a fresh run, and the bytes are those of a fresh run
//! with the same cuts.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use serde_json::Value;

use crate::clouds::{self, Cloud};
use crate::parts::in_parts;
use crate::program::{Job, Said, gdt_batch};
use crate::random::Random;

/// The width of the square that a file covers.
const SIDE: i64 = 4_000;

/// A survey in a folder, a file for each square of four by four.
struct Survey {
    folder: tempfile::TempDir,
    job: Job,
    changes: u64,
}

impl Survey {
    fn new(output: &str) -> Survey {
        let folder = tempfile::tempdir().unwrap();
        let pattern = folder.path().join("*.csv");
        let job = in_parts(&[pattern], 1_500).with("output", output);
        let mut survey = Survey { folder, job, changes: 0 };
        (0..16).for_each(|square| survey.write(square, 400));
        survey
    }

    fn file(&self, square: i64) -> PathBuf {
        self.folder.path().join(format!("square_{square:02}.csv"))
    }

    /// Writes other points into a square; a few lie beyond its border.
    fn write(&mut self, square: i64, points: usize) {
        self.changes += 1;
        let mut random = Random(self.changes);
        let mut below = |limit: i64| random.below(limit as u64) as i64;
        let (west, south) = (square % 4 * SIDE, square / 4 * SIDE);
        let cloud: Cloud = (0..points)
            .map(|_| [west + below(SIDE + 40), south + below(SIDE + 40), below(60) + (west + south) / 50])
            .collect();
        let path = clouds::write(self.folder.path(), &format!("square_{square:02}.csv"), &cloud);
        self.date(&path);
    }

    /// Gives a file another time than it has had: files are told apart by their times in whole seconds too.
    fn date(&self, path: &Path) {
        let time = SystemTime::UNIX_EPOCH.checked_add(Duration::from_secs(1_500_000_000 + self.changes * 10)).unwrap();
        File::options().write(true).open(path).unwrap().set_modified(time).unwrap();
    }

    #[track_caller]
    fn update(&self) -> Said {
        self.job.run_with(&["--update"]).succeeded()
    }

    /// Returns what `update.json` names under `key`.
    fn changes(&self, key: &str) -> BTreeSet<String> {
        let text = fs::read(self.job.out().join("update.json")).unwrap();
        let changes: Value = serde_json::from_slice(&text).unwrap();
        changes[key].as_array().unwrap().iter().map(|name| name.as_str().unwrap().to_owned()).collect()
    }

    /// Updates the terrain, and asserts that it is the mesh of a fresh run.
    #[track_caller]
    fn is_that_of_a_fresh_run(&self) {
        self.update();
        let fresh = Job::on(&[self.folder.path().join("*.csv")]).tiles_of(700);
        assert_eq!(self.job.verified()["digest"], fresh.digest());
    }

    /// Asserts that the bytes are those of a run that finds nothing of the parts, only how they are cut.
    #[track_caller]
    fn has_the_bytes_of_a_run_with_the_same_cuts(&mut self) {
        let before = list(&self.job.out());
        let own = self.job.out().join("job");
        ["parts", "points-by-part", "join", "results"]
            .iter()
            .for_each(|name| fs::remove_dir_all(own.join(name)).unwrap());
        // The points are the same at another time.
        self.changes += 1;
        self.date(&self.file(15));
        let said = self.update();
        assert!(said.err.contains("changed since the last run") && !said.err.contains("again"), "{said:?}");
        assert_eq!(list(&self.job.out()), before);
    }
}

/// Returns the checksums of all results.
fn list(out: &Path) -> BTreeSet<String> {
    fs::read_to_string(out.join("XXH128SUMS")).unwrap().lines().map(str::to_owned).collect()
}

#[test]
fn files_that_change_come_and_go() {
    let mut survey = Survey::new("max_edge = 9000.0");
    survey.update();
    let all = list(&survey.job.out()).len();
    assert!(!survey.job.out().join("update.json").exists());
    survey.write(5, 350);
    survey.is_that_of_a_fresh_run();
    let changed = survey.changes("changed");
    assert!(changed.contains("tileset.json") && changed.len() < all / 2, "{} of {all}", changed.len());
    survey.has_the_bytes_of_a_run_with_the_same_cuts();
    fs::remove_file(survey.file(10)).unwrap();
    fs::remove_file(survey.file(0)).unwrap();
    survey.is_that_of_a_fresh_run();
    survey.write(10, 900);
    survey.write(6, 100);
    fs::remove_file(survey.file(1)).unwrap();
    survey.is_that_of_a_fresh_run();
    survey.has_the_bytes_of_a_run_with_the_same_cuts();
    let said = survey.update();
    assert!(said.err.contains("nothing has changed since the last run"), "{said:?}");
}

#[test]
fn what_depends_on_all_points_is_decided_again() {
    for options in ["max_error = 3.0", "max_edge = \"auto\"\nlevels = false"] {
        let mut survey = Survey::new(options);
        survey.update();
        survey.write(9, 500);
        survey.update();
        survey.has_the_bytes_of_a_run_with_the_same_cuts();
    }
}

#[test]
fn what_an_update_cannot_keep_is_computed_again() {
    let mut survey = Survey::new("levels = false");
    survey.update();
    // A square beyond the area of the first run.
    survey.write(19, 300);
    let said = survey.update();
    assert!(said.err.contains("everything is computed again: the files reach beyond the area"), "{said:?}");
    survey.is_that_of_a_fresh_run();
    // Another style keeps the mesh.
    survey.job = survey.job.with("output", "compression = \"none\"");
    survey.write(3, 300);
    let said = survey.update();
    assert!(said.err.contains("all tiles are written again"), "{said:?}");
    survey.is_that_of_a_fresh_run();
}

#[test]
fn results_that_were_changed_since_are_put_back() {
    let mut survey = Survey::new("levels = false");
    survey.update();
    let tile = survey.job.out().join("tiles/000000.glb");
    let whole = fs::read(&tile).unwrap();
    fs::remove_file(&tile).unwrap();
    fs::write(&tile, "theirs").unwrap();
    fs::remove_file(survey.job.out().join("report.json")).unwrap();
    let said = survey.update();
    assert_eq!(fs::read(&tile).unwrap(), whole);
    for words in ["put back: report.json, tiles/000000.glb", "nothing else has changed since the last run"] {
        assert!(said.err.contains(words), "{said:?}");
    }
    // Everything that a person sees.
    let all = fs::read_dir(survey.job.out()).unwrap().map(|entry| entry.unwrap().path());
    all.filter(|path| !path.ends_with("job")).for_each(|path| match path.is_dir() {
        true => fs::remove_dir_all(&path).unwrap(),
        false => fs::remove_file(&path).unwrap(),
    });
    let said = survey.update();
    assert!(said.err.contains("put back: XXH128SUMS, ") && !said.err.contains("interrupted"), "{said:?}");
    assert_eq!(fs::read(&tile).unwrap(), whole);
    // The same file, under both of its names.
    fs::write(&tile, "theirs").unwrap();
    let said = survey.update();
    assert_eq!(fs::read(&tile).unwrap(), whole);
    for words in ["damaged since the last run, and computed again: tiles/000000.glb", "left of 1 part is damaged"] {
        assert!(said.err.contains(words) && !said.err.contains("interrupted"), "{said:?}");
    }
    fs::write(&tile, "theirs").unwrap();
    survey.write(15, 200);
    let said = survey.update();
    assert!(said.err.contains("damaged"), "{said:?}");
    survey.is_that_of_a_fresh_run();
}

#[test]
fn results_of_which_no_copy_is_whole_are_computed_again() {
    let mut survey = Survey::new("levels = false");
    survey.update();
    survey.write(15, 200);
    survey.update();
    let before = list(&survey.job.out());
    let copies = [survey.job.out(), survey.job.out().join("job/results")];
    let names = before.iter().map(|line| line.split_once("  ").unwrap().1).chain(["XXH128SUMS", "report.json"]);
    names.for_each(|name| copies.iter().for_each(|folder| fs::write(folder.join(name), "damaged").unwrap()));
    let said = survey.update();
    assert!(said.err.contains("and put back: job/results/XXH128SUMS, XXH128SUMS\n"), "{said:?}");
    assert_eq!(list(&survey.job.out()), before);
    survey.job.verified();
    let said = survey.update();
    assert!(said.err.contains("nothing has changed since the last run"), "{said:?}");
    // Journals that are cut off name fewer results than there are.
    for part in 0..3 {
        let journal = survey.job.out().join(format!("job/parts/{part}/journal"));
        let text = fs::read(&journal).unwrap();
        fs::write(&journal, &text[..text.len() / 2]).unwrap();
    }
    survey.update();
    assert_eq!(list(&survey.job.out()), before);
    survey.job.verified();
    // What says how the plane is cut is gone, and so is the journal.
    for name in ["first-plan.json", "journal"] {
        fs::write(survey.job.out().join("job").join(name), "{}").unwrap();
        survey.write(15, 200);
        let said = survey.update();
        assert!(said.err.contains(name.trim_end_matches(".json")) && said.err.contains("damaged"), "{said:?}");
        survey.is_that_of_a_fresh_run();
    }
}

#[test]
fn a_run_without_the_option_leaves_nothing_for_updates() {
    let survey = Survey::new("levels = false");
    survey.update();
    assert!(survey.job.out().join("job/first-plan.json").exists());
    let expected = survey.job.verified()["digest"].clone();
    survey.job.run().succeeded();
    assert!(!survey.job.out().join("job").exists());
    assert_eq!(survey.job.verified()["digest"], expected);
    let config = survey.job.config();
    gdt_batch(survey.job.folder(), &["work", config.to_str().unwrap(), "--phase", "plan"]).succeeded();
}
