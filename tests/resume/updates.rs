//! Updates that are killed: the next run ends with the bytes of one that was not.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;

use crate::kills::PLACES;
use crate::rig::{Run, files};
use crate::scattered;

/// A survey of nine files, of which one is replaced after the first run.
struct Survey {
    folder: tempfile::TempDir,
}

impl Survey {
    fn new() -> Survey {
        let survey = Survey { folder: tempfile::tempdir().unwrap() };
        (0..9).for_each(|square| survey.write(square, square as u64 + 1));
        let config = "[input]\nfiles = [\"square_*.csv\"]\n[triangulation]\nmax_points_per_tile = 200\nmax_points_per_part = 800\n\
                      [output]\ndirectory = \"out\"\n[limits]\nthreads = 1\n";
        fs::write(survey.folder.path().join("job.toml"), config).unwrap();
        survey
    }

    fn write(&self, square: i64, seed: u64) {
        let (west, south) = (square % 3 * 4_000, square / 3 * 4_000);
        let cloud: Vec<[i64; 3]> =
            scattered::uniform(250, 4_000, seed).into_iter().map(|[x, y, z]| [x + west, y + south, z % 100]).collect();
        scattered::write(self.folder.path(), &format!("square_{square}.csv"), &cloud);
    }

    fn command(&self) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_gdt-batch"));
        command.args(["job.toml", "--update"]).current_dir(self.folder.path());
        command
    }

    /// Returns the results, without what the job keeps for itself.
    fn results(&self) -> BTreeMap<String, Vec<u8>> {
        let mut results = files(&self.folder.path().join("out"));
        results.retain(|name, _| !name.starts_with("job/"));
        results
    }
}

/// Makes `to` a copy of the folder `from`.
fn copy(from: &Path, to: &Path) {
    if to.exists() {
        fs::remove_dir_all(to).unwrap();
    }
    let copied = Command::new("cp").arg("-a").args([from, to]).status().unwrap();
    assert!(copied.success());
}

#[test]
fn an_update_that_is_killed_anywhere_ends_with_the_same_bytes() {
    let survey = Survey::new();
    let (out, before) = (survey.folder.path().join("out"), survey.folder.path().join("before"));
    Run::start(&mut survey.command()).end().succeeded();
    copy(&out, &before);
    let old = survey.results();
    survey.write(4, 77);
    Run::start(&mut survey.command()).end().succeeded();
    let expected = survey.results();
    assert!(old != expected && old.contains_key("tiles/000000.glb"));
    let mut kills = 0;
    for place in PLACES.iter().chain(&["replacing"]) {
        for count in (1u64..).step_by(7) {
            copy(&before, &out);
            let what = format!("{place}, {count}");
            let end = Run::start(survey.command().env("GDT_FAULT", format!("{place}:{count}"))).end();
            if !end.was_killed() {
                end.succeeded();
                break;
            }
            kills += 1;
            // Beside a report are the results of one run.
            let report = out.join("report.json").exists();
            let found = survey.results();
            let is_whole = |run: &BTreeMap<String, Vec<u8>>| {
                run.iter().all(|(name, bytes)| name == "update.json" || found.get(name) == Some(bytes))
            };
            assert!(!report || is_whole(&old) || is_whole(&expected), "{what}");
            Run::start(&mut survey.command()).end().succeeded();
            assert!(survey.results() == expected, "{what}");
        }
    }
    assert!(kills >= 12, "only {kills} kills");
}
