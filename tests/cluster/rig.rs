//! A job over several real files in a folder of its own, and the files that one process writes.

use crate::common::shared;
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use tempfile::TempDir;

/// Files of one area: a trail of a survey, and three thin samples of all of it. They are cut into parts that are crowded, thin and empty.
const FILES: [&str; 4] = ["autzen_trim.las", "1.2-with-color.las", "100-points.las", "extrabytes.las"];

pub(crate) struct Rig {
    folder: TempDir,
    expected: BTreeMap<String, Vec<u8>>,
}

impl Rig {
    /// Writes the configuration, and runs the job in one process into another directory. `None` without the files.
    pub(crate) fn new() -> Option<Rig> {
        let data = shared()?.join("data").canonicalize().unwrap();
        let mut rig = Rig { folder: tempfile::tempdir().unwrap(), expected: BTreeMap::new() };
        let files = FILES.map(|name| format!("{:?}", data.join(name))).join(", ");
        for name in ["alone", "out"] {
            let text = format!(
                "[input]\nfiles = [{files}]\n\
                 [triangulation]\nmax_points_per_part = 12000\nmax_points_per_tile = 3000\n\
                 [output]\ndirectory = \"{name}\"\n[limits]\nmemory = \"1 GiB\"\n"
            );
            fs::write(rig.folder.path().join(format!("{name}.toml")), text).unwrap();
        }
        succeeded(rig.program().arg("alone.toml").output().unwrap());
        rig.expected = files_below(&rig.folder.path().join("alone"));
        assert!(rig.expected.keys().filter(|name| name.ends_with(".glb")).count() > 40);
        Some(rig)
    }

    pub(crate) fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Returns the configuration of the job that many tasks do.
    pub(crate) fn config(&self) -> PathBuf {
        self.folder.path().join("out.toml")
    }

    /// Returns the program, in the folder.
    pub(crate) fn program(&self) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_gdt-batch"));
        command.current_dir(self.folder.path());
        command
    }

    /// Removes what tasks have written, and their logs.
    #[cfg(target_os = "linux")]
    pub(crate) fn forget(&self) {
        for name in ["out", "out.slurm"] {
            let _ = fs::remove_dir_all(self.folder.path().join(name));
        }
    }

    /// Asserts that many tasks have written what one process has, and nothing else, and that it can be proved.
    #[track_caller]
    pub(crate) fn is_complete(&self) {
        let out = self.folder.path().join("out");
        let found = files_below(&out);
        assert!(found.keys().eq(self.expected.keys()), "{:?}", found.keys());
        let differ = self.expected.iter().filter(|(name, bytes)| found[*name] != **bytes);
        let differ: Vec<&String> = differ.map(|(name, _)| name).collect();
        assert!(differ.is_empty(), "other bytes in {differ:?}");
        succeeded(self.program().args(["verify", "out"]).output().unwrap());
    }
}

/// Asserts that a program has ended with exit code 0, and returns what it printed.
#[track_caller]
pub(crate) fn succeeded(output: Output) -> String {
    assert!(output.status.success(), "{output:?}");
    String::from_utf8(output.stdout).unwrap()
}

/// Returns the path of a program of the system. If there is none, says so; under tests/run, fails.
#[cfg(target_os = "linux")]
pub(crate) fn program_of_system(name: &str) -> Option<PathBuf> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folders = std::env::split_paths(&path).chain(["/usr/sbin", "/sbin"].map(PathBuf::from));
    let found = folders.map(|folder| folder.join(OsStr::new(name))).find(|file| file.is_file());
    if found.is_none() {
        assert!(std::env::var_os("GDT_TEST_ALL").is_none(), "no {name}");
        eprintln!("not tested: no {name}; run tests/run, which installs it");
    }
    found
}

/// Returns all files below `folder` except the report, which holds times.
fn files_below(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let (mut found, mut folders) = (BTreeMap::new(), vec![folder.to_path_buf()]);
    while let Some(below) = folders.pop() {
        for entry in fs::read_dir(below).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.file_name() != Some(OsStr::new("report.json")) {
                let name = path.strip_prefix(folder).unwrap().to_str().unwrap().to_owned();
                found.insert(name, fs::read(&path).unwrap());
            }
        }
    }
    found
}
