//! What is in a folder in which `init` looks for point clouds.

use crate::init::config_folder::named;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use sys::{Error, Result};

/// The endings of the names of LAS and LAZ files.
pub(crate) const LASER: [&str; 2] = ["las", "laz"];

/// The endings of texts that may be point clouds, in a folder that has no LAS and no LAZ.
pub(crate) const TEXT: [&str; 6] = ["csv", "txt", "xyz", "asc", "pts", "tsv"];

/// The files in a folder, by their names.
pub(crate) struct FolderFiles {
    folder: PathBuf,
    /// Regular files, and those of which the system does not say what they are: to read them shows why.
    files: Vec<PathBuf>,
    /// Links that lead to nothing.
    broken: Vec<PathBuf>,
}

impl FolderFiles {
    /// Reads a folder.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be read.
    pub(crate) fn of(folder: &Path) -> Result<FolderFiles> {
        let entries = std::fs::read_dir(named(folder)).map_err(Error::io("read", folder))?;
        let mut found = FolderFiles { folder: folder.to_path_buf(), files: Vec::new(), broken: Vec::new() };
        for entry in entries {
            let path = folder.join(entry.map_err(Error::io("read", folder))?.file_name());
            match path.metadata() {
                Ok(data) if data.is_file() => found.files.push(path),
                Ok(_) => {}
                Err(error) if error.kind() == ErrorKind::NotFound => found.broken.push(path),
                Err(_) => found.files.push(path),
            }
        }
        found.files.sort();
        found.broken.sort();
        Ok(found)
    }

    /// Returns the files with one of these endings.
    pub(crate) fn with_endings(&self, endings: &[&str]) -> Vec<PathBuf> {
        self.files.iter().filter(|path| has_ending(path, endings)).cloned().collect()
    }

    /// Returns all files with exactly this ending: all that a pattern such as `*.laz` matches.
    pub(crate) fn of_kind(&self, ending: &str) -> Vec<PathBuf> {
        self.files.iter().chain(&self.broken).filter(|path| kind_of(path).1 == ending).cloned().collect()
    }

    /// Returns the links to point clouds that are not there.
    pub(crate) fn broken_clouds(&self) -> impl Iterator<Item = &PathBuf> {
        self.broken.iter().filter(|path| has_ending(path, &LASER) || has_ending(path, &TEXT))
    }

    /// Returns the error for a folder without point clouds: it says why the first file that looks like one is none, and names a folder in
    /// it that has some.
    pub(crate) fn nothing_in(&self, why: Option<&Error>) -> Error {
        let others =
            self.first_folder_with_clouds().map(|other| format!(", such as {}, which has some", other.display()));
        let why = match (why, self.broken_clouds().next()) {
            (Some(why), _) => format!("; {why}"),
            (None, Some(link)) => format!("; {}", leads_nowhere(link)),
            (None, None) => String::new(),
        };
        Error::Config(format!(
            "{} has no point clouds (.las, .laz, or texts such as .csv and .xyz): name files or folders{}{why}",
            named(&self.folder).display(),
            others.unwrap_or_default()
        ))
    }

    fn first_folder_with_clouds(&self) -> Option<PathBuf> {
        let entries = std::fs::read_dir(named(&self.folder)).into_iter().flatten().flatten();
        let has_clouds = |path: &PathBuf| {
            path.is_dir() && FolderFiles::of(path).is_ok_and(|files| !files.with_endings(&LASER).is_empty())
        };
        entries.map(|entry| self.folder.join(entry.file_name())).filter(has_clouds).min()
    }
}

/// Says what is wrong with a link whose target is missing.
pub(crate) fn leads_nowhere(link: &Path) -> String {
    format!("{} is a link to a file that is not there: mend or remove it", link.display())
}

/// Returns the folder and the ending of a file.
pub(crate) fn kind_of(path: &Path) -> (PathBuf, String) {
    let ending = path.extension().unwrap_or_default().to_string_lossy().into_owned();
    (path.parent().unwrap_or(Path::new("")).to_path_buf(), ending)
}

fn has_ending(path: &Path, endings: &[&str]) -> bool {
    endings.contains(&kind_of(path).1.to_ascii_lowercase().as_str())
}
