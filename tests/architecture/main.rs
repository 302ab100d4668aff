//! The modules of each crate and the directions between them: a test reads the imports of every file and fails with the arrow that breaks
//! a rule. `rules.rs` holds the rules.

mod imports;
mod rules;
mod source;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use imports::Imports;

/// Returns a sentence for every rule that `files` of the crate in the folder `of` break. A file is a name relative to that, and a text.
fn broken_in<'a>(of: &str, files: impl IntoIterator<Item = (&'a str, &'a str)>) -> Vec<String> {
    rules::broken(of, &Imports::new(files).arrows())
}

/// The same for a crate without rules of its own.
fn broken<'a>(files: impl IntoIterator<Item = (&'a str, &'a str)>) -> Vec<String> {
    broken_in("lib/src", files)
}

/// Returns the folders with the sources of the crates.
fn folders() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let crates = fs::read_dir(root.join("crates")).unwrap();
    let folders = crates.map(|entry| entry.unwrap().path().join("src"));
    let folders = folders.map(|path| path.strip_prefix(root).unwrap().to_path_buf());
    folders.chain([PathBuf::from("src")]).collect()
}

/// Returns the Rust files in a folder of sources: names and texts.
fn real_files(of: &Path) -> BTreeMap<String, String> {
    let mut files = BTreeMap::new();
    collect(&Path::new(env!("CARGO_MANIFEST_DIR")).join(of), "", &mut files);
    files
}

fn collect(folder: &Path, prefix: &str, files: &mut BTreeMap<String, String>) {
    for entry in fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let name = format!("{prefix}{}", entry.file_name().to_str().unwrap());
        if entry.path().is_dir() {
            collect(&entry.path(), &format!("{name}/"), files);
        } else if name.ends_with(".rs") {
            files.insert(name, fs::read_to_string(entry.path()).unwrap());
        }
    }
}

fn borrowed(files: &BTreeMap<String, String>) -> impl Iterator<Item = (&str, &str)> {
    files.iter().map(|(name, text)| (name.as_str(), text.as_str()))
}

#[test]
fn the_sources_keep_the_rules() {
    let folders = folders();
    let has = |name: &str| folders.iter().any(|of| of == Path::new(name));
    assert!(["src", "crates/job/src", "crates/delaunay/src"].into_iter().all(has), "{folders:?}");
    for of in folders {
        let broken = broken_in(of.to_str().unwrap(), borrowed(&real_files(&of)));
        assert!(broken.is_empty(), "{} broken rules:\n{}", broken.len(), broken.join("\n"));
    }
}

#[test]
fn one_wrong_use_in_the_source_is_found() {
    let mut files = real_files(Path::new("crates/job/src"));
    let before = broken_in("crates/job/src", borrowed(&files));
    let text = files.get_mut("plan/extent.rs").unwrap();
    let line = text.lines().position(|line| line.starts_with("use ")).unwrap() + 1;
    *text = text.replacen("use ", "use crate::levels::make_level::make_level; use ", 1);
    let after = broken_in("crates/job/src", borrowed(&files));
    let wrong = format!(
        "crates/job/src/plan/extent.rs:{line} imports crate::levels::make_level::make_level from crates/job/src/levels/make_level.rs"
    );
    assert!(!before.iter().any(|sentence| sentence.contains(&wrong)));
    assert!(after.iter().any(|sentence| sentence.starts_with(&wrong)), "{}", after.join("\n"));
}

/// A crate that uses everything that is allowed.
const SOUND: [(&str, &str); 9] = [
    ("lib.rs", "pub mod input; pub mod job; mod error; pub use error::Error;"),
    ("error.rs", "pub enum Error {}"),
    ("input/mod.rs", "mod point; pub mod las; pub use point::Point; pub use crate::input::las::header::Header;"),
    ("input/point.rs", "use crate::Error; #[cfg(test)] mod tests { use crate::job::plan; }"),
    ("input/las/mod.rs", "pub mod header;"),
    ("input/las/header.rs", "// crate::job::run\nuse crate::input::Point; const TEXT: &str = \"crate::job::run\";"),
    ("input/las/tests.rs", "use crate::job::plan::plan;"),
    ("job/mod.rs", "pub mod plan; pub fn run() { plan::plan(); }"),
    ("job/plan.rs", "use crate::input::{self, Header}; pub fn plan() { input::las::header::read() }"),
];

#[test]
fn a_sound_crate_passes() {
    assert_eq!(broken(SOUND), [""; 0]);
}

#[test]
fn a_circle_is_reported_with_all_its_arrows() {
    let files =
        [("a.rs", "\nuse crate::b::B;"), ("b.rs", "fn f() { crate::c::g() }"), ("c.rs", "use crate::{a::A as Z};")];
    let circle = "a circle in lib/src/: a.rs -> b.rs -> c.rs -> a.rs\n    lib/src/a.rs:2 imports crate::b::B from lib/src/b.rs\n    \
                  lib/src/b.rs:1 imports crate::c::g from lib/src/c.rs\n    lib/src/c.rs:1 imports crate::a::A from lib/src/a.rs";
    assert_eq!(broken(files), [circle]);
}

#[test]
fn circles_between_modules_are_found_even_if_no_file_is_in_one() {
    let files = [("a/x.rs", "use crate::b::x::X;"), ("b/y.rs", "use crate::a::y::Y;"), ("a/y.rs", ""), ("b/x.rs", "")];
    assert!(broken(files)[0].starts_with("a circle in lib/src/: a -> b -> a"));
    let sub = files.map(|(file, text)| (format!("r/{file}"), text.replace("crate", "crate::r")));
    assert!(
        broken(sub.iter().map(|(f, t)| (f.as_str(), t.as_str())))[0].starts_with("a circle in lib/src/r/: a -> b -> a")
    );
}

#[test]
fn names_lead_to_the_file_that_defines_them() {
    let ways = [
        "use crate::r::P;",
        "use super::P;",
        "use super::Q;",
        "fn f() { crate::r::p::P::new() }",
        "use crate::r; fn f() { r::P }",
    ];
    for way in ways {
        let module = "mod p; mod q; pub use p::P; pub use self::p::P as Q;";
        let found = broken([("r/mod.rs", module), ("r/p.rs", "use crate::r::q::X;"), ("r/q.rs", way)]);
        assert!(found.len() == 1 && found[0].starts_with("a circle in lib/src/r/: p.rs -> q.rs"), "{way}: {found:?}");
    }
}

#[test]
fn a_file_that_imports_from_its_own_mod_file_is_in_a_circle_with_it() {
    let found = broken([("r/mod.rs", "mod p; pub struct R; fn f() { p::g() }"), ("r/p.rs", "use crate::r::R;")]);
    assert!(found[0].starts_with("a circle in lib/src/r/: mod.rs -> p.rs"), "{found:?}");
}

#[test]
fn every_rule_of_direction_holds() {
    let wrong = [
        ("src", "view/a.rs", "config/mod.rs"),
        ("src", "init/a.rs", "submit/mod.rs"),
        ("src", "config/mod.rs", "init/mod.rs"),
        ("crates/job/src", "plan/a.rs", "partition/a.rs"),
        ("crates/job/src", "mesh/a.rs", "publish/a.rs"),
        ("crates/job/src", "levels/a.rs", "run/a.rs"),
        ("crates/job/src", "publish/a.rs", "report/mod.rs"),
        ("crates/job/src", "durable/a.rs", "records.rs"),
        ("crates/job/src", "durable/a.rs", "mesh/a.rs"),
        ("crates/job/src", "progress/a.rs", "preflight/a.rs"),
        ("crates/job/src", "progress/a.rs", "plan/a.rs"),
        ("crates/job/src", "records.rs", "run/a.rs"),
        ("crates/job/src", "preflight/a.rs", "run/a.rs"),
    ];
    let right = [
        ("src", "cli.rs", "config/mod.rs"),
        ("src", "init/a.rs", "config/mod.rs"),
        ("crates/job/src", "publish/a.rs", "plan/a.rs"),
        ("crates/job/src", "mesh/a.rs", "records.rs"),
        ("crates/job/src", "tiles/a.rs", "durable/a.rs"),
        ("crates/job/src", "report/a.rs", "levels/a.rs"),
        ("crates/job/src", "run/a.rs", "publish/a.rs"),
    ];
    let count = |(of, from, to): (&str, &str, &str)| {
        let path = to.trim_end_matches(".rs").trim_end_matches("/mod").replace('/', "::");
        broken_in(of, [(from, format!("use crate::{path}::Item;").as_str()), (to, "")]).len()
    };
    assert_eq!(wrong.map(count), wrong.map(|_| 1));
    assert_eq!(right.map(count), right.map(|_| 0));
}

/// The calls that change files. `crates/sys/src/disk.rs` makes them for a job, so that tests can make up what a power failure leaves.
const CHANGES: [&str; 12] = [
    "fs::rename(",
    "fs::remove_",
    "fs::create_dir",
    "fs::write(",
    "fs::copy(",
    "fs::hard_link(",
    "File::create",
    ".create(true)",
    ".append(true)",
    ".sync_all(",
    ".sync_data(",
    ".set_len(",
];

#[test]
fn a_job_changes_files_only_through_the_layer_that_tests_can_watch() {
    for of in ["crates/job/src", "crates/tiles/src"] {
        for (name, text) in real_files(Path::new(of)) {
            let code = text.split("#[cfg(test)]").next().unwrap();
            let code = code.replace("PointFile::create", "");
            let lines = code.lines().filter(|line| !line.trim_start().starts_with("//"));
            let around: Vec<&str> = lines.filter(|line| CHANGES.iter().any(|call| line.contains(call))).collect();
            assert!(around.is_empty(), "{of}/{name} goes around crates/sys/src/disk.rs: {around:?}");
        }
    }
    let disk = &real_files(Path::new("crates/sys/src"))["disk.rs"];
    let known = CHANGES.iter().filter(|call| disk.contains(**call)).count();
    assert!(known >= 7, "the calls have other names now");
}
