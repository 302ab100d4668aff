//! The files that a pattern in the configuration names.

use crate::input::not_a_file;
use crate::{Error, Result};
use std::path::{Path, PathBuf};

/// Returns the files that match a pattern of the `option`. A pattern without a match may be a file's name that only looks like a pattern.
///
/// # Errors
/// [`Error::Config`] if it is no pattern or matches what is no file, [`Error::Io`] if a folder cannot be read.
pub(crate) fn files_of(pattern: &str, option: &str) -> Result<Vec<PathBuf>> {
    let found = glob::glob(pattern).map_err(|e| Error::Config(format!("{option}: {pattern}: {e}")))?;
    let mut files = Vec::new();
    for path in found {
        files.push(path.map_err(|e| Error::io("read", e.path().to_path_buf())(e.into()))?);
    }
    files.retain(|path| !path.is_dir());
    if files.is_empty() && Path::new(pattern).is_file() {
        files.push(pattern.into());
    }
    match files.iter().find_map(|path| not_a_file(path)) {
        Some(what) => Err(Error::Config(format!("{option}: {what}"))),
        None => Ok(files),
    }
}
