//! Runs what the manual shows: every configuration in a folder of its own, and in that folder the commands that follow it.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Command, Stdio};

use tempfile::TempDir;
use toml::{Table, Value};

use super::data;
use super::markdown::{Block, Page, root};
use crate::program::gdt_batch;

/// The configuration of commands before which no page shows one.
const USUAL: &str = "[input]\nfiles = [\"clouds/*.laz\"]\n[output]\ndirectory = \"out\"\n";

/// Languages of blocks that are neither configurations nor commands.
const SHOWN: [&str; 5] = ["text", "json", "js", "python", "dockerfile"];

/// Programs of others that no test of the manual runs, and why.
const ELSEWHERE: [(&str, &str); 7] = [
    ("npm", "tests/run installs and builds what the page takes"),
    ("cargo", "it builds the program, which has happened before any test"),
    ("tests/run", "it runs this test"),
    ("pdal", "it is a program of others, and not installed for tests"),
    ("python3", "it serves a folder until somebody stops it, or draws pictures"),
    ("curl", "it needs a network"),
    ("xxhsum", "the tests of `tampering` run it"),
];

/// A configuration, and the commands that follow it.
pub(super) struct Episode {
    configuration: Option<Block>,
    commands: Vec<(Vec<String>, String)>,
}

/// Returns what the page wants to be run.
pub(super) fn episodes(page: &Page) -> Vec<Episode> {
    let mut episodes = vec![Episode { configuration: None, commands: Vec::new() }];
    for block in page.blocks() {
        match block.language.as_str() {
            "toml" => episodes.push(Episode { configuration: Some(block), commands: Vec::new() }),
            "sh" | "console" => {
                let found = commands(&block).into_iter().map(|command| (command, block.place.clone()));
                episodes.last_mut().unwrap().commands.extend(found);
            }
            other => {
                assert!(SHOWN.contains(&other), "{}: say what {other:?} is, in tests/job/manual/run.rs", block.place)
            }
        }
    }
    episodes
}

/// Returns the words of every command of a block. In a `console` block, commands begin with `$ `, and the other lines are answers.
fn commands(block: &Block) -> Vec<Vec<String>> {
    let text = block.text.replace("\\\n", " ");
    let lines = text.lines().filter_map(|line| match block.language.as_str() {
        "console" => line.strip_prefix("$ "),
        _ => Some(line),
    });
    let mut commands = Vec::new();
    for line in lines {
        let line = line.split(" #").next().unwrap();
        for command in line.split("&&").filter(|command| !command.trim().is_empty() && !command.starts_with('#')) {
            assert!(
                !command.contains(['"', '\'', '|', '>', '$', ';']),
                "{}: too much of a shell: {command}",
                block.place
            );
            commands.push(command.split_whitespace().map(String::from).collect());
        }
    }
    commands
}

/// Returns the arguments of this program, also if cargo starts it.
fn own(words: &[String]) -> Option<Vec<String>> {
    let by_cargo = ["cargo", "run", "--release", "--"];
    if words[0] == "gdt-batch" {
        Some(words[1..].to_vec())
    } else if words.iter().zip(by_cargo).filter(|(word, wanted)| word == wanted).count() == by_cargo.len() {
        Some(words[by_cargo.len()..].to_vec())
    } else {
        None
    }
}

impl Episode {
    /// Runs everything in a new folder.
    pub(super) fn run(&self) {
        let mut place = Place::new(self.configuration.as_ref());
        if self.configuration.is_some() && !place.is_remote() {
            place.run_job();
        }
        for (words, at) in &self.commands {
            match (own(words), words[0].as_str()) {
                (Some(arguments), _) => place.run(&arguments, at),
                (None, "cd") => place.base = root().join(&words[1]),
                (None, other) => {
                    let is_known = ELSEWHERE.iter().any(|(program, _)| *program == other);
                    assert!(is_known, "{at}: decide whether a test runs {other}: ELSEWHERE in tests/job/manual/run.rs");
                }
            }
        }
    }
}

/// A folder with `job.toml` and all files that it names.
struct Place {
    folder: TempDir,
    job: Table,
    at: String,
    /// The folder of the repository that the commands believe to be in.
    base: PathBuf,
}

impl Place {
    fn new(block: Option<&Block>) -> Place {
        let text = block.map_or(USUAL, |block| block.text.as_str());
        let at = block.map_or(String::from("the usual configuration"), |block| block.place.clone());
        let shown: Table = text.parse().unwrap_or_else(|error| panic!("{at}: {error}"));
        let job = completed(shown.clone());
        let folder = tempfile::tempdir().unwrap();
        // A whole configuration is run to the letter.
        let written = if job == shown { text.to_owned() } else { toml::to_string(&job).unwrap() };
        fs::write(folder.path().join("job.toml"), written).unwrap();
        let place = Place { folder, job, at, base: root().to_owned() };
        if place.is_remote() {
            // There is no network in tests: such a configuration is only read.
            gdt_batch::config::load(&place.folder.path().join("job.toml")).unwrap();
        } else {
            data::prepare(place.folder.path(), &place.job);
        }
        place
    }

    /// Tells whether the configuration names files of the network.
    fn is_remote(&self) -> bool {
        self.job["input"]["files"].to_string().contains("://")
    }

    #[track_caller]
    fn run_job(&self) {
        let said = gdt_batch(self.folder.path(), &["job.toml", "--quiet"]);
        assert_eq!(said.code, 0, "{}: {}", self.at, said.err);
    }

    /// Runs the program in the folder.
    fn run(&self, arguments: &[String], at: &str) {
        let mut words: Vec<String> = arguments.iter().flat_map(|word| self.expanded(word, &arguments[0])).collect();
        let insert = |words: &mut Vec<String>, added: &[&str]| {
            drop(words.splice(1..1, added.iter().map(|word| (*word).to_owned())));
        };
        match words[0].as_str() {
            "view" => return self.view(&words, at),
            "verify" if !self.folder.path().join(&words[1]).exists() => self.run_job(),
            "diff" => words[1..3].iter().for_each(|output| self.copy_output(output)),
            "sample" if !words.iter().any(|word| word == "--points") => insert(&mut words, &["--points", "1000"]),
            // It writes the configuration that is there already.
            "init" => _ = fs::remove_file(self.folder.path().join("job.toml")),
            // Nothing is sent to an engine that is not there.
            "submit" => insert(&mut words, &["--dry-run"]),
            _ => {}
        }
        let said = gdt_batch(self.folder.path(), &words);
        assert_eq!(said.code, 0, "{at}: {words:?}: {}", said.err);
    }

    /// Puts a copy of the results in the folder of this name, if it is not there.
    fn copy_output(&self, name: &str) {
        let to = self.folder.path().join(name);
        if !to.exists() {
            self.run_job();
            let out = self.folder.path().join("out");
            assert!(Command::new("cp").arg("-r").arg(out).arg(to).status().unwrap().success());
        }
    }

    /// Returns the files that a word stands for, as a shell would. They are made, or come from the repository, if they are not there.
    fn expanded(&self, word: &str, command: &str) -> Vec<String> {
        let path = self.folder.path().join(word);
        let is_cloud = [".las", ".laz", ".csv", ".xyz"].iter().any(|extension| word.ends_with(extension));
        if word.ends_with(".toml") && !path.exists() && self.base.join(word).is_file() {
            let folder = path.parent().unwrap();
            fs::create_dir_all(folder).unwrap();
            fs::copy(self.base.join(word), &path).unwrap();
            data::prepare(folder, &fs::read_to_string(&path).unwrap().parse().unwrap());
        } else if is_cloud && command != "sample" {
            data::cloud(self.folder.path(), word, self.job["input"].as_table().unwrap());
        }
        if !word.contains('*') {
            return vec![word.to_owned()];
        }
        let found = glob::glob(path.to_str().unwrap()).unwrap();
        let relative = |path: PathBuf| path.strip_prefix(self.folder.path()).unwrap().to_str().unwrap().to_owned();
        found.map(|path| relative(path.unwrap())).collect()
    }

    /// Serves the results and looks whether it says its address. A program without the page says how it is built in.
    fn view(&self, words: &[String], at: &str) {
        if !tiles::page::is_built_in() {
            return gdt_batch(self.folder.path(), words).refused(2, &["npm run build --prefix viewer"]);
        }
        if !self.folder.path().join(&words[1]).exists() {
            self.run_job();
        }
        let mut program = Command::new(env!("CARGO_BIN_EXE_gdt-batch"));
        program.args(words).args(["--no-open", "--quiet"]).current_dir(self.folder.path());
        let mut program = program.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let mut url = String::new();
        BufReader::new(program.stdout.take().unwrap()).read_line(&mut url).unwrap();
        let _ = program.kill();
        let _ = program.wait();
        assert!(url.starts_with("http://127.0.0.1:"), "{at}: {words:?}: {url:?}");
    }
}

/// Returns a configuration with all that a fragment leaves out. Without the page built in, it wants none.
fn completed(mut job: Table) -> Table {
    let usual: Table = USUAL.parse().unwrap();
    for (table, least) in usual {
        let own = job.entry(table).or_insert(Table::new().into()).as_table_mut().unwrap();
        for (key, value) in least.as_table().unwrap() {
            own.entry(key.clone()).or_insert(value.clone());
        }
    }
    let page = job["output"].get("page").and_then(Value::as_bool);
    if page == Some(true) && !tiles::page::is_built_in() {
        job["output"].as_table_mut().unwrap().insert("page".into(), false.into());
    }
    job
}
