//! Broken, hostile and odd inputs, in a table of what each must give: a sentence and an exit code, or the points that can be read
//! and a warning about the others. Each runs with little memory. None may hang or panic.

mod files;
mod las;
mod laz;
mod shapes;
mod text;

use std::fs::{self, File};
use std::io::Write;

use crate::common::shared;
use crate::program::{Job, Said, gdt_batch_within, number};

/// Enough address space for small files, and far below what hostile headers claim.
const PLENTY_MIB: u64 = 1_536;

/// The content of the file.
enum Content {
    Bytes(Vec<u8>),
    /// These bytes, repeated this many times: for files that are too large to be held in memory.
    Repeated(Vec<u8>, usize),
}

/// What the job must give.
enum Gives {
    /// An error with this exit code and these words in its one sentence.
    Refused(i32, &'static str),
    /// A mesh: the number of records that were read, the number of malformed ones, and words of a warning.
    Read(u64, u64, &'static str),
}
use Gives::{Read, Refused};

/// One row of the table.
struct Case {
    name: String,
    extension: &'static str,
    content: Content,
    /// Lines for `[input]`.
    settings: &'static str,
    gives: Gives,
}

fn case(name: impl Into<String>, extension: &'static str, bytes: Vec<u8>, gives: Gives) -> Case {
    Case { name: name.into(), extension, content: Content::Bytes(bytes), settings: "", gives }
}

impl Case {
    fn with(self, settings: &'static str) -> Case {
        Case { settings, ..self }
    }

    /// Runs the job. Returns the difference between what it gives and what it must give.
    fn difference(&self) -> Option<String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(format!("cloud{}", self.extension));
        match &self.content {
            Content::Bytes(bytes) => fs::write(&path, bytes).unwrap(),
            Content::Repeated(bytes, times) => {
                let mut file = File::create(&path).unwrap();
                (0..*times).for_each(|_| file.write_all(bytes).unwrap());
            }
        }
        let job = Job::on(&[path]).with("input", self.settings).threads(2);
        let said = gdt_batch_within(PLENTY_MIB, job.folder(), &["--json", "--quiet", job.config().to_str().unwrap()]);
        self.gives.difference(&said).map(|difference| format!("{}: {difference}", self.name))
    }
}

impl Gives {
    fn difference(&self, said: &Said) -> Option<String> {
        // A remedy has a line of its own.
        let sentences = said.err.trim_end().lines().filter(|line| !line.starts_with("  fix: ")).count();
        match self {
            _ if said.code != 0 && (sentences != 1 || !said.err.starts_with("error: ")) => {
                Some(format!("more than one sentence: {}", said.err))
            }
            Refused(code, words) => {
                let as_wanted = said.code == *code && said.err.contains(words);
                (!as_wanted).then(|| format!("not {code} with {words:?}, but {}: {}", said.code, said.err))
            }
            Read(..) if said.code != 0 => Some(format!("not read: {}", said.err)),
            Read(read, malformed, words) => {
                let report = said.json();
                let points = &report["points"];
                let found = (number(&points["read"]), number(&points["malformed"]));
                let as_wanted = found == (*read, *malformed) && report["warnings"].to_string().contains(words);
                (!as_wanted).then(|| format!("{found:?} of {read}, {malformed}; {words:?} in {}", report["warnings"]))
            }
        }
    }
}

#[track_caller]
fn hold(cases: Vec<Case>, least: usize) {
    assert!(cases.len() >= least, "only {} rows", cases.len());
    let differences: Vec<String> = cases.iter().filter_map(Case::difference).collect();
    assert!(differences.is_empty(), "{} of {}:\n{}", differences.len(), cases.len(), differences.join("\n"));
}

#[test]
fn wrong_header_fields() {
    hold(las::header_fields(), 120);
}

#[test]
fn wrong_records_and_cuts() {
    hold(las::records_and_cuts(), 25);
}

#[test]
fn wrong_compression() {
    hold(laz::cases(), 35);
}

#[test]
fn wrong_texts() {
    hold(text::cases(), 35);
}

#[test]
fn shapes_that_make_no_terrain_or_an_odd_one() {
    hold(shapes::cases(), 12);
}

#[test]
fn files_from_elsewhere() {
    let Some(shared) = shared() else { return };
    hold(files::cases(&shared.join("data/bad")), 10);
}
