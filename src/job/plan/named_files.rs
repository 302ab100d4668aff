//! The files that a pattern in the configuration names.

use crate::input::not_a_file;
use crate::{Error, Result, interrupt};
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// What a pattern has for folders in folders, to any depth.
const ANY_DEPTH: &str = "**";

/// Returns the files that match a pattern of the `option`. A pattern without a match may be a file's name that only looks like a pattern.
///
/// # Errors
/// [`Error::Config`] if it is no pattern, matches what is no file or goes in circles, [`Error::Io`] if a folder cannot be read.
pub(crate) fn files_of(pattern: &str, option: &str) -> Result<Vec<PathBuf>> {
    refuse_circles(pattern, option)?;
    let found = glob::glob(pattern).map_err(|e| Error::Config(format!("{option}: {pattern}: {e}")))?;
    let mut files = Vec::new();
    for path in found {
        interrupt::check()?;
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

/// Fails if the search for a pattern would not end, because several links lead back to folders that they are in: a search follows each of
/// them from each other. One alone is followed until the system refuses, and every file counts once.
fn refuse_circles(pattern: &str, option: &str) -> Result<()> {
    let Some((start, _)) = pattern.split_once(ANY_DEPTH) else { return Ok(()) };
    let links = links_back(if start.is_empty() { "." } else { start })?;
    match &links[..] {
        [one, other, ..] => Err(Error::Config(format!(
            "{option}: {pattern}: the search would not end, because {} and {} are links to folders that they are in: remove them, or name \
             the folders",
            one.display(),
            other.display()
        ))),
        _ => Ok(()),
    }
}

/// Returns the links below the folders that match `start` to a folder that they are in. Each folder is looked at once; those that cannot be
/// read are left to the search.
fn links_back(start: &str) -> Result<Vec<PathBuf>> {
    let folders = glob::glob(start).into_iter().flatten().flatten();
    let mut waiting: Vec<PathBuf> = folders.filter_map(|folder| folder.canonicalize().ok()).collect();
    let (mut known, mut links) = (HashSet::new(), Vec::new());
    while let Some(folder) = waiting.pop() {
        interrupt::check()?;
        if !known.insert(folder.clone()) {
            continue;
        }
        for entry in std::fs::read_dir(&folder).into_iter().flatten().flatten() {
            let Ok(kind) = entry.file_type() else { continue };
            let path = entry.path();
            if kind.is_dir() {
                waiting.push(path);
            } else if let Some(target) = path.canonicalize().ok().filter(|target| kind.is_symlink() && target.is_dir())
            {
                if folder.starts_with(&target) { links.push(path) } else { waiting.push(target) }
            }
        }
    }
    links.sort();
    Ok(links)
}

#[cfg(test)]
mod tests {
    #[cfg(unix)]
    #[test]
    fn a_search_ends_though_links_lead_back() {
        use super::files_of;
        use std::fs;
        use std::os::unix::fs::symlink;
        let root = tempfile::tempdir().unwrap();
        let folder = root.path().join("a/b");
        fs::create_dir_all(&folder).unwrap();
        fs::write(folder.join("1.xyz"), "").unwrap();
        let pattern = format!("{}/**/*.xyz", root.path().display());
        symlink("../../a", folder.join("up")).unwrap();
        let found = files_of(&pattern, "files").unwrap();
        assert!(found.iter().all(|file| file.ends_with("1.xyz")) && !found.is_empty(), "{found:?}");
        symlink(".", folder.join("here")).unwrap();
        for pattern in [&pattern, &pattern.replace("xyz", "laz")] {
            let what = files_of(pattern, "files").unwrap_err().to_string();
            assert!(what.contains("would not end") && what.contains("b/here") && what.contains("b/up"), "{what}");
        }
        assert_eq!(files_of(&pattern.replace("**", "a/b"), "files").unwrap().len(), 1);
    }
}
