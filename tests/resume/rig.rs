//! A job in a folder of its own, the bytes that it must end with, and ways to disturb it.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use job::durable::directory::{JobDirectory, STORE_FILES};
use job::index::PartIndex;
use serde_json::Value;
use tempfile::TempDir;

use crate::scattered;

/// Longer than any job here takes on a slow machine. A run that takes longer hangs.
const HANGS: Duration = Duration::from_secs(300);

/// The lines of a job's configuration, by section.
#[derive(Clone)]
pub(crate) struct Setup {
    pub(crate) input: String,
    pub(crate) triangulation: String,
    pub(crate) output: String,
    pub(crate) limits: String,
}

impl Setup {
    /// Returns a job on the cloud in its folder, cut into tiles of at most `sites` points.
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

    /// Frees what no step needs any more.
    pub(crate) fn freeing(mut self) -> Setup {
        self.limits += "\nkeep_steps = false";
        self
    }

    /// Adds a line to `[output]`.
    pub(crate) fn input(mut self, line: &str) -> Setup {
        self.input += &format!("\n{line}");
        self
    }

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

    /// Starts a run and waits until it has stopped itself where `place`, a name, comes for the `count`-th time.
    #[track_caller]
    pub(crate) fn stopped_at(command: &mut Command, place: &str, count: u32) -> Run {
        let mut run = Run::start(command.env("GDT_FAULT", format!("{place}:{count}")).env("GDT_STOPS", "1"));
        let process = run.child.id();
        run.wait_until(|| {
            // The name before the state may have parentheses of its own, the rest has none.
            let status = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap();
            status.rsplit(')').next().unwrap().trim_start().starts_with('T')
        });
        run
    }

    /// Waits for the end, but not for ever, and asserts that nothing panicked.
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
        assert!(sent.success(), "no process to send {name} to");
    }

    /// Waits until `condition` holds, and asserts that the run goes on until then.
    #[track_caller]
    pub(crate) fn wait_until(&mut self, condition: impl Fn() -> bool) {
        while !condition() {
            assert!(self.child.try_wait().unwrap().is_none(), "the run ended too early");
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

/// A job, and what it writes when nothing disturbs it.
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

    /// Writes the cloud as files of neighbouring points, which are in squares with sides of `side`, and runs the job once, undisturbed.
    #[track_caller]
    pub(crate) fn of_files(folder: TempDir, cloud: &[[i64; 3]], side: i64, setup: &Setup) -> Rig {
        let mut files: BTreeMap<[i64; 2], Vec<[i64; 3]>> = BTreeMap::new();
        cloud.iter().for_each(|point| files.entry([0, 1].map(|k| point[k].div_euclid(side))).or_default().push(*point));
        for ([x, y], points) in &files {
            scattered::write(folder.path(), &format!("part_{x}_{y}.csv"), points);
        }
        let setup = Setup { input: setup.input.replace("cloud.csv", "part_*.csv"), ..setup.clone() };
        let mut rig = Rig { folder, expected: BTreeMap::new(), report: Value::Null, environment: Vec::new() };
        rig.expect(&setup);
        rig
    }

    /// Makes `setup` the job from here on, and runs it undisturbed in another directory to learn what it must write.
    #[track_caller]
    pub(crate) fn expect(&mut self, setup: &Setup) {
        let undisturbed = Setup { output: setup.output.replace("\"out\"", "\"undisturbed\""), ..setup.clone() };
        self.configure(&undisturbed);
        Run::start(&mut self.command()).end().succeeded();
        let out = self.folder.path().join("undisturbed");
        // Whatever has the same bytes is proved too, and a report is compared with its own checksum.
        let verdict = verify::verify(&out, 1 << 28).unwrap();
        assert_eq!(verdict.verdict, verify::Conclusion::Proved, "{verdict}");
        self.expected = files(&out);
        self.report = lasting(&fs::read(out.join("report.json")).unwrap());
        self.configure(setup);
    }

    pub(crate) fn configure(&self, setup: &Setup) {
        fs::write(self.folder.path().join("job.toml"), setup.text()).unwrap();
    }

    /// Lets the job draw a preview of the usual size, as `tests/run` does not, and learns anew what it must write.
    #[track_caller]
    pub(crate) fn with_usual_preview(mut self, setup: &Setup) -> Rig {
        fs::remove_dir_all(self.folder.path().join("undisturbed")).unwrap();
        self.environment.push(("GDT_PREVIEW", "1024".into()));
        self.expect(setup);
        self
    }

    /// Lets the job wait for the disk as often as one that has run for long.
    pub(crate) fn syncing(mut self) -> Rig {
        self.environment.push(("GDT_SYNC", "1".into()));
        self
    }

    pub(crate) fn out(&self) -> PathBuf {
        self.folder.path().join("out")
    }

    /// Returns the command that runs the program on the configuration.
    pub(crate) fn command(&self) -> Command {
        self.command_of(&["job.toml"])
    }

    /// Returns the command that runs the program with these arguments beside the configuration.
    pub(crate) fn command_of(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_gdt-batch"));
        command.args(arguments).current_dir(self.folder.path()).envs(self.environment());
        command
    }

    /// Returns the variables that the program gets.
    pub(crate) fn environment(&self) -> impl Iterator<Item = (&'static str, &str)> {
        self.environment.iter().map(|(name, value)| (*name, value.as_str()))
    }

    #[track_caller]
    pub(crate) fn run(&self) -> End {
        Run::start(&mut self.command()).end()
    }

    /// Runs until the process comes to the place `name` for the `count`-th time, which kills it.
    #[track_caller]
    pub(crate) fn run_to(&self, name: &str, count: u64) -> End {
        Run::start(self.command().env("GDT_FAULT", format!("{name}:{count}"))).end()
    }

    /// Stops runs at places, each when it is reached for so many times, and kills one after each phase. All end with the same bytes.
    #[track_caller]
    pub(crate) fn ends_alike_wherever_it_is_stopped(&mut self, places: &[(&str, u64)]) {
        for (place, count) in places {
            self.forget();
            let what = format!("signal-{place}");
            self.run_to(&what, *count).stopped(&["error: interrupted"]);
            self.has_nothing_half_written(&what);
            assert!(self.completes(&what)["resumed"].as_u64() >= Some(5));
        }
        self.forget();
        while self.run_to("committed", 1).was_killed() {
            self.has_nothing_half_written("a kill after a phase");
        }
        self.is_complete("kills after phases");
    }

    /// Runs to the end and compares everything that was written. Returns the report.
    #[track_caller]
    pub(crate) fn completes(&self, what: &str) -> Value {
        let end = self.run();
        assert!(end.status.success(), "{what}: {end:?}");
        self.is_complete(what)
    }

    /// Asserts that the results are what they must be. Returns the report.
    #[track_caller]
    pub(crate) fn is_complete(&self, what: &str) -> Value {
        let text = self.has_all_results(what);
        assert_eq!(lasting(&text), self.report, "{what}");
        serde_json::from_slice(&text).unwrap()
    }

    /// Asserts that the results are those of the job, whatever its report warns of. Returns the report.
    #[track_caller]
    pub(crate) fn has_all_results(&self, what: &str) -> Vec<u8> {
        let found = files(&self.out());
        assert!(found.keys().eq(self.expected.keys()), "{what}: {:?}", found.keys());
        let differ = self.expected.iter().filter(|(name, bytes)| found[*name] != **bytes);
        let differ: Vec<&String> = differ.map(|(name, _)| name).collect();
        assert!(differ.is_empty(), "{what}: other bytes in {differ:?}");
        terrain::FinishedTerrain::open(&self.out()).unwrap_or_else(|error| panic!("{what}: {error}"));
        fs::read(self.out().join("report.json")).unwrap()
    }

    /// Asserts that every file with its final name is whole.
    #[track_caller]
    pub(crate) fn has_nothing_half_written(&self, what: &str) {
        for (name, bytes) in files(&self.out()) {
            let name = name.strip_prefix("job/results/").unwrap_or(&name).to_owned();
            if !name.starts_with("job/") && !name.ends_with(".partial") {
                assert!(self.expected.get(&name) == Some(&bytes), "{what}: {name} is not what it will be");
            }
        }
    }

    /// Returns the number of phases that the journals of the job and of its first part name.
    pub(crate) fn phases(&self) -> usize {
        let lines = |path: &str| {
            let journal = fs::read(self.out().join(path)).unwrap_or_default();
            journal.iter().filter(|&&byte| byte == b'\n').count().saturating_sub(1)
        };
        lines("job/journal") + lines("job/parts/0/journal")
    }

    /// Returns the files in which the first part keeps what its phases leave.
    pub(crate) fn stores(&self) -> [PathBuf; STORE_FILES] {
        JobDirectory::new(&self.out()).part(PartIndex::FIRST).store()
    }

    /// Returns the bytes in these files.
    pub(crate) fn stored(&self) -> u64 {
        self.stores().iter().filter_map(|path| fs::metadata(path).ok()).map(|data| data.len()).sum()
    }

    /// Removes the output directory.
    pub(crate) fn forget(&self) {
        if self.out().exists() {
            fs::remove_dir_all(self.out()).unwrap();
        }
    }
}

/// Returns all files below `folder` except the report, which holds times.
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

/// Returns a report without the figures that differ between runs.
fn lasting(text: &[u8]) -> Value {
    let mut report: Value = serde_json::from_slice(text).unwrap();
    // The temporary bytes differ because an interrupted step leaves bytes in the store that no step needs. A job also knows the times of its
    // inputs, which some tests write again.
    let changing = [
        "wall_s",
        "cpu_s",
        "stages",
        "steps",
        "peak_memory",
        "resumed",
        "threads",
        "memory_limit",
        "bytes_temporary",
        "slowest_part",
        "job_fingerprint",
        "gpu_figures",
        "checksum",
    ];
    for name in changing {
        report.as_object_mut().unwrap().remove(name).unwrap();
    }
    let counts = &mut report["leaves"]["outcome"]["counts"];
    counts["nanoseconds"].take();
    if counts["on_gpu"] != 0 {
        // Which edges a GPU flips first depends on where the leaf lies in the atlas, beside which others.
        ["flips", "inverted", "removed"].iter().for_each(|name| _ = counts[name].take());
    }
    report
}
