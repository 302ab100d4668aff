//! Runs the program and reads what it prints.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use tempfile::TempDir;

/// Longer than any job of the tests takes on a slow machine. A run that takes longer hangs.
const HANGS: Duration = Duration::from_secs(300);

/// Makes a preview as large as that of users. `tests/run` has smaller ones, which take less time.
const USUAL_PREVIEW: (&str, &str) = ("GDT_PREVIEW", "1024");

/// The exit code and the output of a run.
#[derive(Debug)]
pub(crate) struct Said {
    pub(crate) code: i32,
    pub(crate) out: String,
    pub(crate) err: String,
}

impl Said {
    /// Parses standard output as JSON.
    #[track_caller]
    pub(crate) fn json(&self) -> Value {
        serde_json::from_str(&self.out).unwrap_or_else(|e| panic!("{e}: {self:?}"))
    }

    #[track_caller]
    pub(crate) fn succeeded(self) -> Said {
        assert_eq!(self.code, 0, "{}", self.err);
        self
    }

    /// Asserts the exit code, and that the error message contains all `words`.
    #[track_caller]
    pub(crate) fn refused(&self, code: i32, words: &[&str]) {
        let message = &self.err[self.err.find("error: ").unwrap_or_else(|| panic!("no error: {self:?}"))..];
        assert_eq!(self.code, code, "{message}");
        assert!(words.iter().all(|word| message.contains(word)), "no {words:?} in: {message}");
    }
}

/// Runs the program in `folder`.
#[track_caller]
pub(crate) fn gdt_batch<S: AsRef<std::ffi::OsStr>>(folder: &Path, arguments: &[S]) -> Said {
    finish(Command::new(env!("CARGO_BIN_EXE_gdt-batch")).args(arguments).current_dir(folder))
}

/// Runs the program with variables in its environment.
#[track_caller]
pub(crate) fn gdt_batch_with(folder: &Path, arguments: &[&str], variables: &[(&str, &str)]) -> Said {
    let mut command = Command::new(env!("CARGO_BIN_EXE_gdt-batch"));
    finish(command.args(arguments).envs(variables.iter().copied()).current_dir(folder))
}

/// Runs the program with its standard output going to the file `out`.
#[track_caller]
pub(crate) fn gdt_batch_into(out: &str, folder: &Path, arguments: &[&str]) -> Said {
    let mut command = Command::new("sh");
    command.arg("-c").arg(format!("exec \"$0\" \"$@\" > {out}"));
    finish(command.arg(env!("CARGO_BIN_EXE_gdt-batch")).args(arguments).current_dir(folder))
}

/// Runs the program with `mebibytes` of address space, so that it cannot even ask for more.
#[track_caller]
pub(crate) fn gdt_batch_within(mebibytes: u64, folder: &Path, arguments: &[&str]) -> Said {
    finish(&mut within(mebibytes * 1024, folder, arguments))
}

/// Runs the program with `kibibytes` of address space. A preview takes what it takes of users.
#[track_caller]
pub(crate) fn gdt_batch_within_kib(kibibytes: u64, folder: &Path, arguments: &[&str]) -> Said {
    finish(within(kibibytes, folder, arguments).envs([USUAL_PREVIEW]))
}

fn within(kibibytes: u64, folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new("sh");
    command.arg("-c").arg(format!("ulimit -v {kibibytes} && exec \"$0\" \"$@\""));
    // Without memory a stack trace takes longer than the run.
    command.env("RUST_BACKTRACE", "0");
    command.arg(env!("CARGO_BIN_EXE_gdt-batch")).args(arguments).current_dir(folder);
    command
}

/// Waits for `command`, but not for ever, and asserts that it did not panic.
#[track_caller]
fn finish(command: &mut Command) -> Said {
    let logs = tempfile::tempdir().unwrap();
    let log = |name: &str| File::create(logs.path().join(name)).unwrap();
    let mut child =
        command.stdin(Stdio::null()).stdout(log("out")).stderr(log("err")).spawn().expect("the program starts");
    let start = Instant::now();
    let status = loop {
        match child.try_wait().unwrap() {
            Some(status) => break status,
            None if start.elapsed() > HANGS => {
                child.kill().unwrap();
                panic!("{command:?} hangs");
            }
            None => std::thread::sleep(Duration::from_millis(1)),
        }
    };
    let text = |name: &str| String::from_utf8_lossy(&fs::read(logs.path().join(name)).unwrap()).into_owned();
    let said = Said { code: status.code().unwrap_or(-1), out: text("out"), err: text("err") };
    assert!(!said.err.contains("panicked") && said.code >= 0, "{status}: {}", said.err);
    said
}

/// A configuration in a folder of its own, to which the job also writes.
pub(crate) struct Job {
    folder: TempDir,
    sections: BTreeMap<&'static str, String>,
    environment: Vec<(&'static str, String)>,
}

impl Job {
    /// Returns the smallest configuration for these files.
    pub(crate) fn on<P: AsRef<Path>>(files: &[P]) -> Job {
        let names: Vec<&str> = files.iter().map(|file| file.as_ref().to_str().unwrap()).collect();
        let job = Job { folder: tempfile::tempdir().unwrap(), sections: BTreeMap::new(), environment: Vec::new() };
        job.with("input", &format!("files = {names:?}")).with("output", "directory = \"out\"")
    }

    /// Adds a line to a section.
    pub(crate) fn with(mut self, section: &'static str, line: &str) -> Job {
        *self.sections.entry(section).or_default() += &format!("{line}\n");
        self
    }

    pub(crate) fn tiles_of(self, sites: u64) -> Job {
        self.with("triangulation", &format!("max_points_per_tile = {sites}"))
    }

    pub(crate) fn threads(self, threads: usize) -> Job {
        self.with("limits", &format!("threads = {threads}"))
    }

    /// Lets a program with the feature `fault-injection` believe that it has so many processors.
    pub(crate) fn processors(self, processors: usize) -> Job {
        self.variable("GDT_PROCESSORS", &processors.to_string())
    }

    /// Lets the program draw a preview of the usual size.
    pub(crate) fn usual_preview(self) -> Job {
        self.variable(USUAL_PREVIEW.0, USUAL_PREVIEW.1)
    }

    /// Sets a variable of the program's environment.
    pub(crate) fn variable(mut self, name: &'static str, value: &str) -> Job {
        self.environment.push((name, value.to_owned()));
        self
    }

    /// Lets the program run without the variables that were set.
    pub(crate) fn calm(&mut self) {
        self.environment.clear();
    }

    pub(crate) fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Returns the output directory.
    pub(crate) fn out(&self) -> PathBuf {
        self.folder.path().join("out")
    }

    /// Writes the configuration and returns its path.
    pub(crate) fn config(&self) -> PathBuf {
        let text: String = self.sections.iter().map(|(name, lines)| format!("[{name}]\n{lines}")).collect();
        let path = self.folder.path().join("job.toml");
        fs::write(&path, text).unwrap();
        path
    }

    /// Runs the job with these arguments before the configuration.
    #[track_caller]
    pub(crate) fn run_with(&self, arguments: &[&str]) -> Said {
        let mut command = Command::new(env!("CARGO_BIN_EXE_gdt-batch"));
        command.envs(self.environment.iter().map(|(name, value)| (name, value)));
        finish(command.args(arguments).arg(self.config()).current_dir(self.folder()))
    }

    #[track_caller]
    pub(crate) fn run(&self) -> Said {
        self.run_with(&[])
    }

    /// Runs the job, asserts that it succeeds, and returns the report.
    #[track_caller]
    pub(crate) fn report(&self) -> Value {
        self.run_with(&["--json", "--quiet"]).succeeded().json()
    }

    /// Runs `verify` on the output, asserts that it holds, and returns what `verify` prints.
    #[track_caller]
    pub(crate) fn verified(&self) -> Value {
        let verdict = gdt_batch(self.folder(), &["verify", "out", "--json"]).succeeded().json();
        assert_eq!(verdict["failures"], serde_json::json!([]));
        verdict
    }

    /// Runs the job, asserts that the mesh is exact, and returns its digest.
    #[track_caller]
    pub(crate) fn digest(&self) -> String {
        self.report();
        self.verified()["digest"].as_str().unwrap().to_owned()
    }
}

/// Returns a number of a report.
#[track_caller]
pub(crate) fn number(value: &Value) -> u64 {
    value.as_u64().unwrap_or_else(|| panic!("{value} is not a number"))
}
