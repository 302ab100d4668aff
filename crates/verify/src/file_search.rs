//! Finding files in the folders of numbered files, those of a job and strange ones.

use std::io::Error;
use std::path::{Path, PathBuf};

use sys::disk;
use tiles::file_names::MOST_FOLDERS_DEEP;

/// Returns the files with this ending in `folder` and in the folders in it, as deep as a job makes folders. Nothing if there is no
/// such folder.
///
/// # Errors
/// The folder that cannot be read, and what the system says.
pub(super) fn files_below(folder: &Path, ending: &str) -> Result<Vec<PathBuf>, (PathBuf, Error)> {
    let (mut found, mut folders) = (Vec::new(), vec![(folder.to_path_buf(), 0)]);
    while let Some((folder, depth)) = folders.pop() {
        let entries = disk::list(&folder).map_err(|error| (folder.clone(), error))?;
        for path in entries {
            match path.extension() {
                Some(found_ending) if found_ending == ending => found.push(path),
                // Files with other endings are nobody's business, so a name with an ending is not asked for.
                None if depth < MOST_FOLDERS_DEEP => {
                    let is_folder = disk::is_folder(&path).map_err(|error| (path.clone(), error))?;
                    folders.extend(is_folder.then_some((path, depth + 1)));
                }
                _ => {}
            }
        }
    }
    Ok(found)
}
