//! The files that a job may have left in an output directory.

use crate::durable::atomic_file::partial_path;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use sys::{Error, Result, disk};
use tiles::checksums::read_file;
use tiles::file_names::{MOST_FOLDERS_DEEP, OutputFiles, belongs_into, is_number};
use tiles::page::is_page;

/// What a job may have left.
#[derive(Default)]
pub(crate) struct Leftovers {
    /// Files, under their names or their partial names: the fixed names, whether there are such files or not, and the numbered
    /// files that exist.
    pub(crate) files: Vec<PathBuf>,
    /// The folders of numbered files that exist, each after the folders in it.
    pub(crate) folders: Vec<PathBuf>,
    /// What has the name of such a folder but is none.
    pub(crate) no_folders: Vec<PathBuf>,
}

/// The digits of the number in the name of a result, at least. Shorter names are those of other programs.
const NUMBER_LENGTH: usize = 6;

impl Leftovers {
    /// Finds what a job may have left in `output`.
    ///
    /// # Errors
    /// [`Error::Io`] if a folder cannot be read.
    pub(crate) fn of(output: &OutputFiles) -> Result<Leftovers> {
        let mut files = output.single_files();
        // People give their own pages this name too.
        if !is_page_of_others(output)? {
            files.push(output.page());
        }
        let partials: Vec<PathBuf> = files.iter().map(|path| partial_path(path)).collect();
        files.extend(partials);
        let mut left = Leftovers { files, ..Leftovers::default() };
        let has_ending =
            |path: &Path, ending: &str| path.extension().is_some_and(|found| found == ending) || is_partial(path);
        for (folder, ending) in output.numbered_folders() {
            let is_own = |below: &[String], stem: &str, path: &Path| {
                is_number(stem) && has_ending(path, ending) && may_be_in(below, stem)
            };
            left.add_folder(&folder, &mut Vec::new(), MOST_FOLDERS_DEEP, &is_own)?;
        }
        // Zooms, columns, rows.
        let is_tile = |below: &[String], stem: &str, path: &Path| {
            below.len() == 2 && is_number(stem) && has_ending(path, "terrain")
        };
        left.add_folder(&output.terrain_tiles(), &mut Vec::new(), 2, &is_tile)?;
        // Their names are those of inputs.
        let (folder, ending) = output.classified();
        left.add_folder(&folder, &mut Vec::new(), 0, &|_, _, path| has_ending(path, ending))?;
        Ok(left)
    }

    /// Adds those files in a folder, if it is there, and in the numbered folders so deep in it that `is_own` takes by the folders that lead to
    /// them, their stem and their path. The folders `below` lead to this one.
    fn add_folder(
        &mut self,
        folder: &Path,
        below: &mut Vec<String>,
        deep: usize,
        is_own: &dyn Fn(&[String], &str, &Path) -> bool,
    ) -> Result<()> {
        if !is_folder(folder)? {
            self.no_folders.extend(exists(folder)?.then(|| folder.to_path_buf()));
            return Ok(());
        }
        for path in entries(folder)? {
            let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            if below.len() < deep && path.extension().is_none() && is_number(&stem) {
                below.push(stem);
                self.add_folder(&path, below, deep, is_own)?;
                below.pop();
            } else if is_own(below, &stem, &path) {
                self.files.push(path);
            }
        }
        self.folders.push(folder.into());
        Ok(())
    }
}

/// Tells whether a job may have put the file with this number into the folder of its kind, or into those `below`. Earlier versions
/// had no folders below.
fn may_be_in(below: &[String], number: &str) -> bool {
    (below.is_empty() && number.len() >= NUMBER_LENGTH)
        || number.parse().is_ok_and(|number| belongs_into(below, number))
}

/// Tells whether somebody else's page is where that of a job is to be.
///
/// # Errors
/// [`Error::Io`] if it cannot be read.
pub(crate) fn is_page_of_others(results: &OutputFiles) -> Result<bool> {
    let page = results.page();
    Ok(exists(&page)? && !is_page(&page).map_err(Error::io("read", &page))?)
}

/// Checks that nobody else's page is where that of a job is to be.
///
/// # Errors
/// [`Error::Config`] if one is.
pub(crate) fn check_page_is_ours(results: &OutputFiles) -> Result<()> {
    if !is_page_of_others(results)? {
        return Ok(());
    }
    Err(Error::Config(format!(
        "{} exists, and is not a result of a job: move it away, or set [output] page = false",
        results.page().display()
    )))
}

/// Returns the paths of everything in `folder`; nothing if there is no such folder.
pub(crate) fn entries(folder: &Path) -> Result<Vec<PathBuf>> {
    disk::list(folder).map_err(Error::io("read", folder))
}

/// Returns what the file at `path` holds; `None` if there is none.
///
/// # Errors
/// [`Error::Io`] if it cannot be read.
pub(crate) fn read_if_there(path: &Path) -> Result<Option<Vec<u8>>> {
    match read_file(path) {
        Err(e) if e.kind() == ErrorKind::NotFound => Ok(None),
        text => text.map(Some).map_err(Error::io("read", path)),
    }
}

/// Tells whether something is at `path`.
pub(crate) fn exists(path: &Path) -> Result<bool> {
    disk::exists(path).map_err(Error::io("read", path))
}

/// Tells whether a folder is at `path`.
pub(crate) fn is_folder(path: &Path) -> Result<bool> {
    disk::is_folder(path).map_err(Error::io("read", path))
}

/// Tells whether `path` is the partial name of a file.
pub(crate) fn is_partial(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending == "partial")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;
    use std::fs;

    #[test]
    fn a_page_of_somebody_else_is_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let output = OutputFiles::new(folder.path());
        let is_listed = || Leftovers::of(&output).unwrap().files.contains(&output.page());
        assert!(is_listed());
        fs::write(output.page(), "<!doctype html>\n<title>My survey</title>").unwrap();
        assert!(!is_listed());
        fs::write(output.page(), "<!doctype html>\n<html lang=\"en\" data-terrain=\"tileset.json\">").unwrap();
        assert!(is_listed());
    }

    #[test]
    fn only_what_a_job_may_have_written_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let ours = [
            "tiles/000000.glb",
            // As an earlier version had it.
            "tiles/000300.glb",
            "tiles/001/000256.glb",
            "tiles/001/000257.partial",
            "tiles/256/256/065536.glb",
            "levels/4608/4822/1234567.glb",
            "tilesets/000000.json",
        ];
        let theirs = [
            "tiles/roof.glb",
            "tiles/001/000000.glb",
            "tiles/1/000256.glb",
            "tiles/2024/000007.glb",
            "tiles/old/000256.glb",
            "tiles/000001.json",
            "tilesets/000000.glb",
        ];
        for name in ours.iter().chain(&theirs) {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, "x").unwrap();
        }
        fs::write(folder.path().join("tiles/002"), "x").unwrap();
        let left = Leftovers::of(&OutputFiles::new(folder.path())).unwrap();
        let name = |path: &PathBuf| path.strip_prefix(folder.path()).unwrap().to_str().unwrap().to_owned();
        let found: BTreeSet<String> = left.files.iter().filter(|path| path.exists()).map(name).collect();
        assert_eq!(found, ours.map(String::from).into());
        assert_eq!(left.no_folders.iter().map(name).collect::<Vec<_>>(), ["tiles/002"]);
        let folders: Vec<String> = left.folders.iter().map(name).collect();
        let place = |name: &str| folders.iter().position(|folder| folder == name).unwrap();
        assert!(place("tiles/256/256") < place("tiles/256") && place("tiles/256") < place("tiles"));
        assert!(!folders.contains(&"tiles/old".into()) && !folders.contains(&"cut".into()));
    }
}
