//! The rooms of `src` and the directions between them: a test reads the imports of every file and fails with the arrow that breaks
//! a rule. `rules.rs` holds the rules.

mod house;
mod rules;
mod source;

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use house::House;

/// Returns a sentence for every rule that `files` break. A file is a name relative to `src`, and a text.
fn broken<'a>(files: impl IntoIterator<Item = (&'a str, &'a str)>) -> Vec<String> {
    rules::broken(&House::new(files).arrows())
}

/// Returns the Rust files of `src`: names and texts.
fn real_files() -> BTreeMap<String, String> {
    let mut files = BTreeMap::new();
    collect(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), "", &mut files);
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
fn the_source_keeps_the_rules() {
    let broken = broken(borrowed(&real_files()));
    assert!(broken.is_empty(), "{} broken rules:\n{}", broken.len(), broken.join("\n"));
}

#[test]
fn one_wrong_use_in_the_source_is_found() {
    let mut files = real_files();
    let before = broken(borrowed(&files));
    let text = files.get_mut("geometry/lattice.rs").unwrap();
    let line = text.lines().position(|line| line.starts_with("use ")).unwrap() + 1;
    *text = text.replacen("use ", "use crate::config::load; use ", 1);
    let after = broken(borrowed(&files));
    let wrong = format!("src/geometry/lattice.rs:{line} imports crate::config::load from src/config/mod.rs");
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
    let circle = "a circle in src/: a.rs -> b.rs -> c.rs -> a.rs\n    src/a.rs:2 imports crate::b::B from src/b.rs\n    \
                  src/b.rs:1 imports crate::c::g from src/c.rs\n    src/c.rs:1 imports crate::a::A from src/a.rs";
    assert_eq!(broken(files), [circle]);
}

#[test]
fn circles_between_rooms_are_found_even_if_no_file_is_in_one() {
    let files = [("a/x.rs", "use crate::b::x::X;"), ("b/y.rs", "use crate::a::y::Y;"), ("a/y.rs", ""), ("b/x.rs", "")];
    assert!(broken(files)[0].starts_with("a circle in src/: a -> b -> a"));
    let sub = files.map(|(file, text)| (format!("r/{file}"), text.replace("crate", "crate::r")));
    assert!(
        broken(sub.iter().map(|(f, t)| (f.as_str(), t.as_str())))[0].starts_with("a circle in src/r/: a -> b -> a")
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
        let room = "mod p; mod q; pub use p::P; pub use self::p::P as Q;";
        let found = broken([("r/mod.rs", room), ("r/p.rs", "use crate::r::q::X;"), ("r/q.rs", way)]);
        assert!(found.len() == 1 && found[0].starts_with("a circle in src/r/: p.rs -> q.rs"), "{way}: {found:?}");
    }
}

#[test]
fn a_file_that_imports_from_its_own_mod_file_is_in_a_circle_with_it() {
    let found = broken([("r/mod.rs", "mod p; pub struct R; fn f() { p::g() }"), ("r/p.rs", "use crate::r::R;")]);
    assert!(found[0].starts_with("a circle in src/r/: mod.rs -> p.rs"), "{found:?}");
}

#[test]
fn a_mod_file_may_re_export_only_from_its_own_folder() {
    let files = [("input/mod.rs", "pub use crate::job::plan::Plan;"), ("job/plan.rs", "")];
    assert_eq!(broken(files).len(), 1);
}

#[test]
fn every_rule_of_direction_holds() {
    let wrong = [
        ("geometry/a.rs", "config/a.rs"),
        ("mesh/a.rs", "job/options.rs"),
        ("voronoi/mod.rs", "verify/mod.rs"),
        ("gpu/twins/a.rs", "cli.rs"),
        ("triangulation/a.rs", "job/durable/a.rs"),
        ("input/las/a.rs", "job/mod.rs"),
        ("output/gltf/a.rs", "config/mod.rs"),
        ("verify/a.rs", "job/options.rs"),
        ("verify/a.rs", "config/mod.rs"),
        ("config/mod.rs", "job/records.rs"),
        ("config/mod.rs", "input/source.rs"),
        ("job/mod.rs", "config/mod.rs"),
        ("job/run/a.rs", "verify/mod.rs"),
        ("job/run/a.rs", "submit/mod.rs"),
        ("verify/a.rs", "submit/mod.rs"),
        ("job/preflight/a.rs", "init/mod.rs"),
        ("init/a.rs", "job/run/a.rs"),
        ("job/report/mod.rs", "cli.rs"),
        ("job/plan/a.rs", "job/partition/a.rs"),
        ("job/mesh/a.rs", "job/publish/a.rs"),
        ("job/levels/a.rs", "job/run/a.rs"),
        ("job/tiles/a.rs", "job/mod.rs"),
        ("job/publish/a.rs", "job/report/mod.rs"),
        ("job/durable/a.rs", "job/records.rs"),
        ("job/durable/a.rs", "job/mesh/a.rs"),
        ("job/progress/a.rs", "job/preflight/a.rs"),
        ("job/progress/a.rs", "job/plan/a.rs"),
        ("job/records.rs", "job/run/a.rs"),
        ("job/preflight/a.rs", "job/run/a.rs"),
        ("job/report/a.rs", "job/mod.rs"),
    ];
    let right = [
        ("config/mod.rs", "job/options.rs"),
        ("config/mod.rs", "output/options.rs"),
        ("config/mod.rs", "warnings.rs"),
        ("verify/a.rs", "output/gltf/read.rs"),
        ("job/publish/a.rs", "job/plan/a.rs"),
        ("job/mesh/a.rs", "job/records.rs"),
        ("job/tiles/a.rs", "job/durable/a.rs"),
        ("job/report/a.rs", "job/levels/a.rs"),
        ("job/run/a.rs", "job/publish/a.rs"),
        ("job/mod.rs", "job/run/mod.rs"),
        ("cli.rs", "job/options.rs"),
        ("init/a.rs", "config/mod.rs"),
        ("init/a.rs", "job/preflight/a.rs"),
    ];
    let count = |(from, to): (&str, &str)| {
        let path = to.trim_end_matches(".rs").trim_end_matches("/mod").replace('/', "::");
        broken([(from, format!("use crate::{path}::Item;").as_str()), (to, "")]).len()
    };
    assert_eq!(wrong.map(count), wrong.map(|_| 1));
    assert_eq!(right.map(count), right.map(|_| 0));
}

/// The calls that change files. `src/disk.rs` makes them for a job, so that tests can make up what a power failure leaves.
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
    let files = real_files();
    let of_job = files.iter().filter(|(name, _)| name.starts_with("job/") || name.starts_with("output/"));
    for (name, text) in of_job {
        let code = text.split("#[cfg(test)]").next().unwrap();
        let code = code.replace("PointFile::create", "");
        let lines = code.lines().filter(|line| !line.trim_start().starts_with("//"));
        let around: Vec<&str> = lines.filter(|line| CHANGES.iter().any(|call| line.contains(call))).collect();
        assert!(around.is_empty(), "src/{name} goes around src/disk.rs: {around:?}");
    }
    assert!(
        CHANGES.iter().filter(|call| files["disk.rs"].contains(**call)).count() >= 7,
        "the calls have other names now"
    );
}
