//! An input is the same file wherever the program runs and however its path is written. So a run goes on with what another run of
//! the job left, from another working directory, through a link, or after the folder has moved.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use crate::rig::{End, Rig, Run, Setup, files};
use crate::scattered;

/// A job on a cloud with two bad lines, whose report names the file.
fn rig() -> Rig {
    let mut cloud = scattered::gaussian(12_000);
    cloud.sort_unstable();
    let setup = Setup::tiles_of(2_000);
    let setup = Setup { input: setup.input + "\nmax_malformed_fraction = 0.1", ..setup };
    let mut rig = Rig::new(&cloud, &setup);
    let path = rig.folder.path().join("cloud.csv");
    fs::write(&path, fs::read_to_string(&path).unwrap() + "1,2\n1,two,3\n").unwrap();
    rig.expect(&setup);
    rig
}

/// Runs the configuration at `config` in `directory`.
fn run_in(directory: &Path, config: &str) -> End {
    let mut command = Command::new(env!("CARGO_BIN_EXE_gdt-batch"));
    Run::start(command.arg(config).current_dir(directory)).end()
}

/// Asserts that a run went on from an interrupted one, ended with the right bytes in `out`, and calls the input `name`.
#[track_caller]
fn went_on(rig: &Rig, end: End, out: &Path, name: &str) {
    let said = end.succeeded().err;
    assert!(said.contains("continuing an interrupted run") && !said.contains("starting over"), "{said}");
    let found = files(out);
    assert!(found == rig.expected, "{:?}", found.keys());
    let report: Value = serde_json::from_slice(&fs::read(out.join("report.json")).unwrap()).unwrap();
    for lines in [&report["points"]["examples"], &report["warnings"]] {
        assert!(lines.to_string().contains(&format!("\"{name}: line 12002")), "{name}: {lines}");
    }
}

#[test]
fn a_run_from_another_working_directory_goes_on() {
    let rig = rig();
    let folder = rig.folder.path();
    let absolute = folder.join("job.toml");
    let cloud = folder.join("cloud.csv");
    fs::create_dir_all(folder.join("a/b")).unwrap();
    for (directory, config, name) in [
        ("a/b", "../../job.toml", "../../cloud.csv"),
        ("/", absolute.to_str().unwrap(), cloud.to_str().unwrap()),
        ("a/../a/..", "./job.toml", "cloud.csv"),
    ] {
        // Among the leaves, and among the tiles.
        for count in [2, 4] {
            rig.forget();
            assert!(rig.run_to("committed", count).was_killed());
            went_on(&rig, run_in(&folder.join(directory), config), &rig.out(), name);
        }
    }
}

#[test]
fn every_run_may_have_another_working_directory() {
    let rig = rig();
    let folder = rig.folder.path();
    fs::create_dir_all(folder.join("a/b")).unwrap();
    assert!(rig.run_to("committed", 2).was_killed());
    let mut again = Command::new(env!("CARGO_BIN_EXE_gdt-batch"));
    again.arg("../job.toml").current_dir(folder.join("a")).env("GDT_FAULT", "committed:1");
    assert!(Run::start(&mut again).end().was_killed());
    went_on(&rig, run_in(&folder.join("a/b"), "../../job.toml"), &rig.out(), "../../cloud.csv");
}

#[test]
fn another_spelling_of_the_path_or_a_link_to_the_file_goes_on() {
    let rig = rig();
    let folder = rig.folder.path();
    fs::create_dir(folder.join("links")).unwrap();
    std::os::unix::fs::symlink("../cloud.csv", folder.join("links/renamed.csv")).unwrap();
    std::os::unix::fs::symlink(folder, folder.join("links/folder")).unwrap();
    let configuration = fs::read_to_string(folder.join("job.toml")).unwrap();
    for spelling in ["./cloud.csv", "links/../cloud.csv", "links/renamed.csv", "links/folder/cloud.csv", "cl*.csv"] {
        rig.forget();
        fs::write(folder.join("job.toml"), &configuration).unwrap();
        assert!(rig.run_to("committed", 2).was_killed());
        fs::write(folder.join("job.toml"), configuration.replace("cloud.csv", spelling)).unwrap();
        let name = spelling.trim_start_matches("./").replace('*', "oud");
        went_on(&rig, rig.run(), &rig.out(), &name);
    }
}

#[test]
fn a_job_goes_on_after_its_folder_has_moved() {
    let rig = rig();
    let moved = tempfile::tempdir().unwrap();
    for (count, damage_points) in [(2, false), (4, false), (2, true)] {
        rig.forget();
        let absolute = rig.folder.path().join("job.toml");
        let mut first = Command::new(env!("CARGO_BIN_EXE_gdt-batch"));
        first.arg(&absolute).current_dir("/").env("GDT_FAULT", format!("committed:{count}"));
        assert!(Run::start(&mut first).end().was_killed());
        let to: PathBuf = moved.path().join(format!("{count} {damage_points}"));
        fs::create_dir(&to).unwrap();
        for name in ["cloud.csv", "job.toml", "out"] {
            fs::rename(rig.folder.path().join(name), to.join(name)).unwrap();
        }
        if damage_points {
            // The inputs are read again, where they are now.
            fs::write(to.join("out/job/points-by-part/0/0.points"), "").unwrap();
            let said = run_in(&to, "job.toml").succeeded().err;
            assert!(said.contains("is damaged; starting over"), "{said}");
            assert!(files(&to.join("out")) == rig.expected);
        } else {
            went_on(&rig, run_in(&to, "job.toml"), &to.join("out"), "cloud.csv");
        }
        for name in ["cloud.csv", "job.toml"] {
            fs::rename(to.join(name), rig.folder.path().join(name)).unwrap();
        }
    }
}

#[test]
fn a_file_that_two_paths_lead_to_is_read_once() {
    let rig = rig();
    let folder = rig.folder.path();
    std::os::unix::fs::symlink("cloud.csv", folder.join("again.csv")).unwrap();
    let text = fs::read_to_string(folder.join("job.toml")).unwrap();
    let twice = text.replace("[\"cloud.csv\"]", "[\"cloud.csv\", \"./cloud.csv\", \"*.csv\"]");
    assert_ne!(text, twice);
    fs::write(folder.join("job.toml"), twice).unwrap();
    let report = rig.completes("the same file four times");
    assert_eq!(report["files"], 1);
}
