//! Which files in an output directory are results of jobs: those that the list of a finished job names, or that of a job whose results are
//! taking their places.

use crate::durable::listing::{exists, read_if_there};
use serde_json::{Map, Value};
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use sys::{Error, Result};
use tiles::checksums::{Checksum, parse_list};
use tiles::file_names::OutputFiles;

/// The results of jobs, by their paths from the output directory.
#[derive(Default)]
pub(crate) struct KnownResults {
    names: HashSet<PathBuf>,
    /// Whether a list names them.
    pub(crate) has_list: bool,
}

/// Tells whether the file at `path` is the list of what an update has changed: others may have a file of this name.
fn is_list_of_changes(path: &Path) -> bool {
    let object = std::fs::read(path).ok().and_then(|text| serde_json::from_slice::<Map<String, Value>>(&text).ok());
    object.is_some_and(|object| ["added", "areas", "changed", "removed"].iter().all(|key| object.contains_key(*key)))
}

impl KnownResults {
    /// Returns what the lists in these folders name, and the lists and the reports themselves.
    ///
    /// # Errors
    /// [`Error::Io`] if a list cannot be read.
    pub(crate) fn of(folders: &[&OutputFiles]) -> Result<KnownResults> {
        let mut known = KnownResults::default();
        for folder in folders {
            let changes = Some(folder.changes()).filter(|path| is_list_of_changes(path));
            let own = [folder.report(), folder.checksums()].into_iter().chain(changes);
            let own: Vec<PathBuf> = own.collect();
            let names = own.iter().filter_map(|path| path.strip_prefix(folder.directory()).ok());
            known.names.extend(names.map(Path::to_path_buf));
            if let Some(files) = read_if_there(&folder.checksums())?.and_then(|text| parse_list(&text)) {
                known.names.extend(files.into_iter().map(|(name, _)| PathBuf::from(name)));
                known.has_list = true;
            }
        }
        Ok(known)
    }

    /// Tells whether a job wrote the file with this name.
    pub(crate) fn contains(&self, name: &Path) -> bool {
        self.names.contains(name)
    }

    /// Checks that the result with this name, which `waits`, takes the place of nothing but a result among `results`. A run that was cut off
    /// may have put the same file there.
    ///
    /// # Errors
    /// [`Error::Config`] if a foreign file is there, [`Error::Io`] if it cannot be read.
    pub(crate) fn check_place(&self, name: &Path, waits: &Path, results: &OutputFiles) -> Result<()> {
        let place = &results.directory().join(name);
        if self.contains(name) || !exists(place)? {
            return Ok(());
        }
        let content = |path: &Path| Checksum::of_file(path).map_err(Error::io("read", path));
        if content(waits)? == content(place)? {
            return Ok(());
        }
        let what = match self.has_list || !exists(&results.report())? {
            true => "appeared during the job, and is not one of its results: move it away".to_string(),
            false => format!(
                "is in the place of a result, and {} is missing or damaged, which would tell whether a job wrote it: move everything in {} \
                 but the folder job away",
                results.checksums().display(),
                results.directory().display()
            ),
        };
        Err(Error::Config(format!("{} {what}, and run the same command again", place.display())))
    }
}
