//! A job in a folder of its own, the bytes it must end with, and how to disturb it.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use gdt_batch::job::durable::directory::{JobDirectory, STORE_FILES};
use serde_json::Value;
use tempfile::TempDir;

use crate::scattered;

/// Longer than any job here takes on a slow machine: what runs on hangs.
const HANGS: Duration = Duration::from_secs(300);

/// What a job is, in the lines of its configuration.
#[derive(Clone)]
pub(crate) struct Setup {
    pub(crate) input: String,
    pub(crate) triangulation: String,
    pub(crate) output: String,
    pub(crate) limits: String,
}

impl Setup {
    /// On the cloud of the folder, cut into tiles of so many sites.
    pub(crate) fn tiles_of(sites: u64) -> Setup {
        Setup {
            input: "files = [\"cloud.csv\"]".into(),
            triangulation: format!("max_points_per_tile = {sites}"),
            output: "directory = \"out\"".into(),
            limits: "threads = 1".into(),
        }
    }

    pub(crate) fn threads(self, threads: usize) -> Setup {
        Setup { limits: format!("threads = {threads}"), ..self }
    }

    pub(crate) fn backend(mut self, backend: &str) -> Setup {
        self.triangulation += &format!("\nbackend = \"{backend}\"");
        self
    }

    /// With one more line in `[output]`.
    pub(crate) fn output(mut self, line: &str) -> Setup {
        self.output += &format!("\n{line}");
        self
    }

    fn text(&self) -> String {
        let Setup { input, triangulation, output, limits } = self;
        format!("[input]\n{input}\n[triangulation]\n{triangulation}\n[output]\n{output}\n[limits]\n{limits}\n")
    }
}

/// How a run ended.
#[derive(Debug)]
pub(crate) struct End {
    pub(crate) status: ExitStatus,
    pub(crate) out: String,
    pub(crate) err: String,
}

impl End {
    pub(crate) fn was_killed(&self) -> bool {
        self.status.signal() == Some(9)
    }

    #[track_caller]
    pub(crate) fn succeeded(self) -> End {
        assert!(self.status.success(), "{self:?}");
        self
    }

    /// Asserts exit code 1 and a message with all `words`.
    #[track_caller]
    pub(crate) fn stopped(self, words: &[&str]) -> End {
        assert_eq!(self.status.code(), Some(1), "{self:?}");
        assert!(words.iter().all(|word| self.err.contains(word)), "no {words:?} in: {}", self.err);
        self
    }
}

/// A run under way.
pub(crate) struct Run {
    pub(crate) child: Child,
    logs: TempDir,
}

impl Run {
    pub(crate) fn start(command: &mut Command) -> Run {
        let logs = tempfile::tempdir().unwrap();
        let log = |name: &str| File::create(logs.path().join(name)).unwrap();
        let child = command.stdin(Stdio::null()).stdout(log("out")).stderr(log("err")).spawn();
        Run { child: child.expect("the program starts"), logs }
    }

    /// Waits for the end, but not for ever, and makes sure that nothing has panicked.
    #[track_caller]
    pub(crate) fn end(mut self) -> End {
        let start = Instant::now();
        let status = loop {
            match self.child.try_wait().unwrap() {
                Some(status) => break status,
                None if start.elapsed() > HANGS => {
                    self.child.kill().unwrap();
                    panic!("a run hangs");
                }
                None => std::thread::sleep(Duration::from_millis(1)),
            }
        };
        let text = |name: &str| String::from_utf8_lossy(&fs::read(self.logs.path().join(name)).unwrap()).into_owned();
        let end = End { status, out: text("out"), err: text("err") };
        assert!(!end.err.contains("panicked"), "{end:?}");
        end
    }

    /// Sends a signal by its name.
    pub(crate) fn signal(&self, name: &str) {
        let sent = Command::new("kill").args(["-s", name, &self.child.id().to_string()]).status().unwrap();
        assert!(sent.success(), "{name} goes to a process that is there");
    }

    /// Waits until `condition` holds while the run is under way.
    #[track_caller]
    pub(crate) fn wait_until(&mut self, condition: impl Fn() -> bool) {
        while !condition() {
            assert!(self.child.try_wait().unwrap().is_none(), "the run is over too early");
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

/// A job, and what it writes if nobody disturbs it.
pub(crate) struct Rig {
    pub(crate) folder: TempDir,
    pub(crate) expected: BTreeMap<String, Vec<u8>>,
    report: Value,
    environment: Vec<(&'static str, String)>,
}

impl Rig {
    /// Writes the cloud and runs the job once, undisturbed.
    #[track_caller]
    pub(crate) fn new(cloud: &[[i64; 3]], setup: &Setup) -> Rig {
        let folder = tempfile::tempdir().unwrap();
        scattered::write(folder.path(), "cloud.csv", cloud);
        let mut rig = Rig { folder, expected: BTreeMap::new(), report: Value::Null, environment: Vec::new() };
        rig.expect(setup);
        rig
    }

    /// From here on the job is `setup`, and what it must write is found out in another directory.
    #[track_caller]
    pub(crate) fn expect(&mut self, setup: &Setup) {
        let undisturbed = Setup { output: setup.output.replace("\"out\"", "\"undisturbed\""), ..setup.clone() };
        self.configure(&undisturbed);
        Run::start(&mut self.command()).end().succeeded();
        let out = self.folder.path().join("undisturbed");
        self.expected = files(&out);
        self.report = lasting(&fs::read(out.join("report.json")).unwrap());
        self.configure(setup);
    }

    pub(crate) fn configure(&self, setup: &Setup) {
        fs::write(self.folder.path().join("job.toml"), setup.text()).unwrap();
    }

    /// With so many milliseconds between two commits of the journal; without any, every record is a commit of its own.
    pub(crate) fn committing_every(mut self, milliseconds: u64) -> Rig {
        self.environment.push(("GDT_COMMIT_MS", milliseconds.to_string()));
        self
    }

    pub(crate) fn out(&self) -> PathBuf {
        self.folder.path().join("out")
    }

    /// The program on the configuration.
    pub(crate) fn command(&self) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_gdt-batch"));
        command.arg("job.toml").current_dir(self.folder.path()).envs(self.environment.iter().map(|(k, v)| (k, v)));
        command
    }

    #[track_caller]
    pub(crate) fn run(&self) -> End {
        Run::start(&mut self.command()).end()
    }

    /// Runs until the place `name` is come to for the `count`-th time, where the process is killed.
    #[track_caller]
    pub(crate) fn run_to(&self, name: &str, count: u64) -> End {
        Run::start(self.command().env("GDT_FAULT", format!("{name}:{count}"))).end()
    }

    /// Runs to the end, and compares all that is written.
    #[track_caller]
    pub(crate) fn completes(&self, what: &str) -> Value {
        let end = self.run();
        assert!(end.status.success(), "{what}: {end:?}");
        self.is_complete(what)
    }

    /// Asserts that the results are what they must be; gives the report.
    #[track_caller]
    pub(crate) fn is_complete(&self, what: &str) -> Value {
        let found = files(&self.out());
        assert!(found.keys().eq(self.expected.keys()), "{what}: {:?}", found.keys());
        let differ = self.expected.iter().filter(|(name, bytes)| found[*name] != **bytes);
        let differ: Vec<&String> = differ.map(|(name, _)| name).collect();
        assert!(differ.is_empty(), "{what}: other bytes in {differ:?}");
        let text = fs::read(self.out().join("report.json")).unwrap();
        assert_eq!(lasting(&text), self.report, "{what}");
        serde_json::from_slice(&text).unwrap()
    }

    /// Asserts that whatever is there under its final name is whole.
    #[track_caller]
    pub(crate) fn has_nothing_half_written(&self, what: &str) {
        for (name, bytes) in files(&self.out()) {
            if !name.starts_with("job/") && !name.ends_with(".partial") {
                assert!(self.expected.get(&name) == Some(&bytes), "{what}: {name} is not what it will be");
            }
        }
    }

    /// How many steps the journal has.
    pub(crate) fn steps(&self) -> usize {
        let journal = fs::read(self.out().join("job/journal")).unwrap_or_default();
        journal.iter().filter(|&&byte| byte == b'\n').count().saturating_sub(1)
    }

    /// The files with the results of the steps.
    pub(crate) fn stores(&self) -> [PathBuf; STORE_FILES] {
        JobDirectory::new(&self.out()).store()
    }

    pub(crate) fn forget(&self) {
        if self.out().exists() {
            fs::remove_dir_all(self.out()).unwrap();
        }
    }
}

/// All files below `folder` but the report, which holds times.
pub(crate) fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    let Ok(entries) = fs::read_dir(folder) else { return found };
    for entry in entries {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        if path.is_dir() {
            found.extend(files(&path).into_iter().map(|(below, bytes)| (format!("{name}/{below}"), bytes)));
        } else if name != "report.json" {
            found.insert(name, fs::read(&path).unwrap());
        }
    }
    found
}

/// A report without what no two runs have in common.
fn lasting(text: &[u8]) -> Value {
    let mut report: Value = serde_json::from_slice(text).unwrap();
    // A step that was cut off has left bytes in the store that nobody needs.
    let changing =
        ["wall_s", "cpu_s", "stages", "steps", "peak_memory", "resumed", "threads", "memory_limit", "bytes_temporary"];
    for name in changing {
        report.as_object_mut().unwrap().remove(name).unwrap();
    }
    report["leaves"]["outcome"]["counts"]["nanoseconds"].take();
    report
}
