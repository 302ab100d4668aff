//! The list of a job's results, as its journals name them.

use crate::durable::directory::JobDirectory;
use crate::durable::journal::PublishedFile;
use std::path::Path;
use tiles::checksums::Checksum;

/// Returns the names and checksums of the results among `files`, in the order of their names.
pub(crate) fn listed(directory: &JobDirectory, mut files: Vec<PublishedFile>) -> Vec<(String, Checksum)> {
    files.retain(|file| directory.is_result(&file.name));
    files.sort_by(|a, b| a.name.cmp(&b.name));
    files.into_iter().map(|file| (slashed(&file.name), file.checksum)).collect()
}

/// Returns a path with slashes on every system.
fn slashed(path: &Path) -> String {
    let parts: Vec<_> = path.iter().map(|part| part.to_string_lossy()).collect();
    parts.join("/")
}
