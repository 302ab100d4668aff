//! The program that users install says what it is built from, and has no faults on purpose built in: see CONTRIBUTING.md.
#![cfg(not(feature = "fault-injection"))]

use std::fs;
use std::path::Path;
use std::process::Command;

use tiles::preview::canvas::LONGER_SIDE;

#[path = "../build.rs"]
#[expect(dead_code, reason = "cargo runs it")]
mod build_script;

/// Each of these ends a run of a build that has the feature: at its first commit, when results take their places, when it cleans
/// up, or with a read error.
const FAULTS: [&str; 10] = [
    "commit:1",
    "published:1",
    "torn:1",
    "committed:1",
    "replacing:1",
    "cleaning:1",
    "read-input:1",
    "read-store:1+",
    "stat:1",
    "change:1",
];

/// A program without the page says how to build one with it.
#[test]
fn view_says_how_it_is_built_in() {
    if tiles::page::is_built_in() {
        return;
    }
    let output = Command::new(env!("CARGO_BIN_EXE_gdt-batch")).args(["view", "out"]).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("npm ci --prefix viewer") && said.contains("cargo install"), "{said}");
}

#[test]
fn no_environment_variable_kills_the_installed_program() {
    let folder = tempfile::tempdir().unwrap();
    let job = "[input]\nfiles = [\"cloud.csv\"]\n[output]\ndirectory = \"out\"\n";
    fs::write(folder.path().join("job.toml"), job).unwrap();
    fs::write(folder.path().join("cloud.csv"), "0,0,1\n9,0,2\n9,9,3\n0,9,4\n4,5,6\n").unwrap();
    for fault in FAULTS {
        let mut program = Command::new(env!("CARGO_BIN_EXE_gdt-batch"));
        program.arg("job.toml").current_dir(folder.path()).env("GDT_FAULT", fault);
        let output =
            program.envs([("GDT_TRACE", "trace"), ("GDT_STOPS", "1"), ("GDT_PREVIEW", "100")]).output().unwrap();
        assert!(output.status.success(), "{fault}: {output:?}");
        assert!(!folder.path().join("trace").exists(), "changes of files are written down");
        let preview = fs::read(folder.path().join("out/preview.png")).unwrap();
        let preview = png::Decoder::new(std::io::Cursor::new(preview)).read_info().unwrap();
        assert_eq!(preview.info().width, LONGER_SIDE as u32);
    }
}

#[test]
fn the_version_says_the_commit_and_no_result_does() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        let output =
            Command::new(env!("CARGO_BIN_EXE_gdt-batch")).args(arguments).current_dir(folder.path()).output().unwrap();
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stdout).unwrap()
    };
    let Some(commit) = build_script::commit(Path::new(env!("CARGO_MANIFEST_DIR"))) else {
        eprintln!("not tested: this is no checkout, or git is not installed");
        return;
    };
    let version = run(&["--version"]);
    assert!(version.contains(&format!("({commit}; features: ")), "{version} is not of {commit}");
    fs::write(folder.path().join("cloud.csv"), "0,0,1\n9,0,2\n9,9,3\n0,9,4\n4,5,6\n").unwrap();
    run(&["init", "--quiet"]);
    run(&["job.toml", "--quiet"]);
    let hash = &commit[..7];
    for file in [
        "job.toml",
        "out/report.json",
        "out/tileset.json",
        "out/terrain.glb",
        "out/georeference.json",
        "out/preview.png",
    ] {
        let bytes = fs::read(folder.path().join(file)).unwrap();
        assert!(!String::from_utf8_lossy(&bytes).contains(hash), "{file} names the commit");
    }
}
