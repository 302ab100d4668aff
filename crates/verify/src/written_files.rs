//! Compares every result with the checksum that the job has left of it.

use std::collections::{HashMap, HashSet};
use std::io::ErrorKind;
use std::path::{Component, Path};

use rayon::prelude::*;

use crate::file_search::files_below;
use crate::watcher::Watcher;
use tiles::checksums::{Checksum, parse_list, read_file};
use tiles::file_names::OutputFiles;

/// More names than this would hide what else is wrong.
const MAX_NAMES: usize = 20;

/// What comparing the files has shown.
#[derive(Debug, Default)]
pub(super) struct WrittenFiles {
    /// The files that are as the job wrote them.
    pub(super) unchanged: u64,
    pub(super) failures: Vec<String>,
    /// Whether the list of the files is there.
    pub(super) has_list: bool,
    /// The files of `cut/` that are gone, in the order of the list.
    pub(super) cut_gone: Vec<String>,
    /// What cannot be proved for lack of files.
    pub(super) unproved: Option<String>,
}

/// What became of a file of the list.
enum State {
    Unchanged,
    Gone,
    Changed(String),
}

impl WrittenFiles {
    /// Compares the files in the output `directory` of a job with its list. `expected` is the checksum of the list, if the report says it;
    /// `seen` has the checksums of files that are not read, by their names in the list.
    pub(super) fn check(
        directory: &Path,
        expected: Option<Checksum>,
        seen: &HashMap<String, Checksum>,
        watcher: &dyn Watcher,
    ) -> WrittenFiles {
        let output = OutputFiles::new(directory);
        let path = output.checksums();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let text = match read_file(&path) {
            Err(error) if error.kind() == ErrorKind::NotFound => {
                let unproved = expected.map(|_| format!("files may have been changed: their list {name} is gone"));
                return WrittenFiles { unproved, ..WrittenFiles::default() };
            }
            Err(error) => return WrittenFiles::failed(format!("{name}: it cannot be read: {error}")),
            Ok(text) => text,
        };
        let files = parse_list(&text).filter(|files| files.iter().all(|(name, _)| is_inside(name)));
        match files {
            Some(files) if expected.is_none_or(|expected| expected == Checksum::of(&text)) => {
                compare(&output, &files, seen, watcher)
            }
            _ => WrittenFiles::failed(format!(
                "{name}: it is not as the job wrote it, so that no file can be compared with it"
            )),
        }
    }

    fn failed(what: String) -> WrittenFiles {
        WrittenFiles { failures: vec![what], has_list: true, ..WrittenFiles::default() }
    }
}

/// Tells whether a path of the list stays in the directory.
fn is_inside(name: &str) -> bool {
    Path::new(name).components().all(|part| matches!(part, Component::Normal(_)))
}

fn compare(
    output: &OutputFiles,
    files: &[(String, Checksum)],
    seen: &HashMap<String, Checksum>,
    watcher: &dyn Watcher,
) -> WrittenFiles {
    watcher.begin("checksums", files.len() as u64, "files");
    let state = |(name, wanted): &(String, Checksum)| {
        let found = state(output, name, seen.get(name).copied(), *wanted);
        watcher.advance(1);
        found
    };
    let states: Vec<State> = files.par_iter().map(state).collect();
    let (mut changed, mut gone) = (Vec::new(), Vec::new());
    let mut checked = WrittenFiles { has_list: true, ..WrittenFiles::default() };
    for ((name, _), state) in files.iter().zip(states) {
        match state {
            State::Unchanged => checked.unchanged += 1,
            State::Changed(how) => changed.push(format!("{name} is not as the job wrote it: {how}")),
            State::Gone if is_in(output, name, &output.tiles()) => changed.push(format!("{name} is gone")),
            // The verdict says what can be proved without them.
            State::Gone if is_in(output, name, &output.cut()) => checked.cut_gone.push(name.clone()),
            State::Gone => gone.push(name.as_str()),
        }
    }
    changed.extend(unlisted(output, files));
    let more = changed.len().saturating_sub(MAX_NAMES);
    changed.truncate(MAX_NAMES);
    checked.failures = changed;
    if more > 0 {
        checked.failures.push(format!("{more} more files are not as the job wrote them"));
    }
    if let Some(first) = gone.first() {
        checked.unproved = Some(format!("{} files that the job wrote are gone, the first of them {first}", gone.len()));
    }
    checked
}

fn state(output: &OutputFiles, name: &str, seen: Option<Checksum>, wanted: Checksum) -> State {
    let read = || Checksum::of_file(&output.directory().join(name)).map(|(_, found)| found);
    match seen.map_or_else(read, Ok) {
        Ok(found) if found == wanted => State::Unchanged,
        Ok(found) => State::Changed(format!("its checksum is {found}, not {wanted}")),
        Err(error) if error.kind() == ErrorKind::NotFound => State::Gone,
        Err(error) => State::Changed(format!("it cannot be read: {error}")),
    }
}

fn is_in(output: &OutputFiles, name: &str, folder: &Path) -> bool {
    output.directory().join(name).starts_with(folder)
}

/// Returns a sentence for every tile, coarser tile, part left out and external tileset that is not in the list.
fn unlisted(output: &OutputFiles, files: &[(String, Checksum)]) -> Vec<String> {
    let listed: HashSet<_> = files.iter().map(|(name, _)| output.directory().join(name)).collect();
    let name = |path: &Path| path.strip_prefix(output.directory()).unwrap_or(path).display().to_string();
    let mut sentences = Vec::new();
    for (folder, ending) in output.numbered_folders() {
        match files_below(&folder, ending) {
            Err((folder, error)) => sentences.push(format!("{} cannot be read: {error}", name(&folder))),
            Ok(mut paths) => {
                paths.retain(|path| !listed.contains(path));
                paths.sort_unstable();
                sentences.extend(paths.iter().map(|path| format!("{} is not a file that the job wrote", name(path))));
            }
        }
    }
    sentences
}
