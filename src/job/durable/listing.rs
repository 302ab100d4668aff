//! The files that a job may have left in an output directory.

use crate::job::durable::atomic_file::partial_path;
use crate::output::file_names::OutputFiles;
use crate::{Error, Result, disk};
use std::path::{Path, PathBuf};

/// Returns the paths of all files that a job may have left in `folder`, under their names or their partial names: the fixed names,
/// and the numbered files that exist.
pub(crate) fn files_of(folder: &OutputFiles) -> Result<Vec<PathBuf>> {
    let mut files = vec![
        folder.report(),
        folder.checksums(),
        folder.terrain(),
        folder.tileset(),
        folder.georeference(),
        folder.preview(),
    ];
    let partials: Vec<PathBuf> = files.iter().map(|path| partial_path(path)).collect();
    files.extend(partials);
    for folder in folder.glb_folders() {
        files.extend(numbered_files(&folder)?);
    }
    Ok(files)
}

/// The digits of the number in the name of a result, at least. Shorter names are those of other programs.
const NUMBER_LENGTH: usize = 6;

/// Returns the files in `folder` that have the name of a numbered result, whole or partial.
fn numbered_files(folder: &Path) -> Result<Vec<PathBuf>> {
    let is_number = |stem: &str| stem.len() >= NUMBER_LENGTH && stem.bytes().all(|b| b.is_ascii_digit());
    let is_numbered = |path: &PathBuf| {
        let number = path.file_stem().is_some_and(|stem| is_number(&stem.to_string_lossy()));
        number && (path.extension().is_some_and(|e| e == "glb") || is_partial(path))
    };
    let mut paths = entries(folder)?;
    paths.retain(is_numbered);
    Ok(paths)
}

/// Returns the paths of everything in `folder`; nothing if there is no such folder.
pub(crate) fn entries(folder: &Path) -> Result<Vec<PathBuf>> {
    disk::list(folder).map_err(Error::io("read", folder))
}

/// Tells whether something is at `path`.
pub(crate) fn exists(path: &Path) -> Result<bool> {
    disk::exists(path).map_err(Error::io("read", path))
}

/// Tells whether `path` is the partial name of a file.
pub(crate) fn is_partial(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending == "partial")
}
