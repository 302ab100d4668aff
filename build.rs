//! Says which commit and which features the program is built from, for `gdt-batch --version`.
//!
//! The commit is that of the checkout that this file is in, or the one that cargo notes in a package. Without either there is none. Its
//! date is that of the commit, so the same commit gives the same program.
//!
//! Builds for tests, with the feature `fault-injection`, have no commit: otherwise every commit would compile everything anew.

use std::path::{Path, PathBuf};
use std::process::Command;

/// As many digits of a commit as people write.
const DIGITS: usize = 7;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let root = PathBuf::from(variable("CARGO_MANIFEST_DIR"));
    let is_for_tests = std::env::var_os("CARGO_FEATURE_FAULT_INJECTION").is_some();
    let (files, commit) = if is_for_tests { (Vec::new(), None) } else { (files_of_commit(&root), commit(&root)) };
    for file in files {
        println!("cargo::rerun-if-changed={}", file.display());
    }
    let features = std::env::vars().filter_map(|(name, _)| Some(name.strip_prefix("CARGO_FEATURE_")?.to_string()));
    // The set of those that are on by default says nothing that they do not say themselves.
    let features = features.filter(|name| name != "DEFAULT");
    let version = long_version(&variable("CARGO_PKG_VERSION"), commit, features.collect());
    println!("cargo::rustc-env=GDT_LONG_VERSION={version}");
}

fn variable(name: &str) -> String {
    std::env::var(name).unwrap_or_default()
}

/// Returns the version with what the program is built from, as in `0.2.0 (c6555ec 2026-11-23; features: viewer)`.
pub(crate) fn long_version(version: &str, commit: Option<String>, mut features: Vec<String>) -> String {
    features.sort();
    let features = if features.is_empty() { "none".into() } else { features.join(", ") };
    let features = features.to_lowercase().replace('_', "-");
    let commit = commit.map_or(String::new(), |commit| format!("{commit}; "));
    format!("{version} ({commit}features: {features})")
}

/// Returns the commit of the folder `root` and its date.
pub(crate) fn commit(root: &Path) -> Option<String> {
    let of_checkout = || {
        let text = git(root, &["show", "--no-patch", "--format=%H %cs", "HEAD"])?;
        // Signatures may stand before it.
        let (hash, date) = text.lines().last()?.split_once(' ')?;
        Some(format!("{} {date}", hash.get(..DIGITS)?))
    };
    of_checkout().or_else(|| packaged_commit(&std::fs::read_to_string(root.join(".cargo_vcs_info.json")).ok()?))
}

/// Returns the commit that `cargo package` has noted, unless files had changed since.
pub(crate) fn packaged_commit(note: &str) -> Option<String> {
    let (_, rest) = note.split_once("\"sha1\"")?;
    let hash = rest.split('"').nth(1)?;
    let is_hash = hash.len() >= DIGITS && hash.bytes().all(|byte| byte.is_ascii_hexdigit());
    (is_hash && !note.contains("\"dirty\"")).then(|| hash[..DIGITS].to_string())
}

/// Returns the files that change with the commit. Cargo runs this script again only if one of them does, not for every change of a source.
pub(crate) fn files_of_commit(root: &Path) -> Vec<PathBuf> {
    let path = |name: &str| git(root, &["rev-parse", "--git-path", name]).map(|path| root.join(path));
    // Every step of HEAD has a line in its log. A clone may keep none; then HEAD, and what it leads to, tell.
    let branch = git(root, &["symbolic-ref", "--quiet", "HEAD"]);
    let candidates = match path("logs/HEAD").filter(|log| log.is_file()) {
        Some(log) => vec![Some(log)],
        None => vec![path("HEAD"), branch.and_then(|name| path(&name)), path("packed-refs")],
    };
    let mut files: Vec<PathBuf> = candidates.into_iter().flatten().filter(|path| path.is_file()).collect();
    files.extend(Some(root.join(".cargo_vcs_info.json")).filter(|note| note.is_file()));
    files
}

/// Returns what git says about the checkout at `root`; nothing if there is none, or no git. A checkout of something else around it does
/// not count.
fn git(root: &Path, arguments: &[&str]) -> Option<String> {
    let folder = root.join(".git");
    if !folder.exists() {
        return None;
    }
    let mut command = Command::new("git");
    command.arg("-C").arg(root).arg("--git-dir").arg(folder).args(arguments);
    let output = command.output().ok().filter(|output| output.status.success())?;
    let text = String::from_utf8(output.stdout).ok()?;
    Some(text.trim().to_string()).filter(|text| !text.is_empty())
}
