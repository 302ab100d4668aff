//! What is in a folder that stands for its point clouds.

use crate::plan::named_files::current_if_empty;
use points::{TextOptions, is_ept};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use sys::{Error, Result};

/// The endings of the names of LAS and LAZ files.
pub const LASER: [&str; 2] = ["las", "laz"];

/// The endings of texts that may be point clouds, in a folder that has no LAS and no LAZ.
pub const TEXT: [&str; 6] = ["csv", "txt", "xyz", "asc", "pts", "tsv"];

/// The point clouds in a folder.
#[derive(Debug)]
pub struct FolderClouds {
    /// The files, by their names.
    pub clouds: Vec<PathBuf>,
    /// What the user should know about files that were left out.
    pub notes: Vec<String>,
}

/// The files in a folder, by their names.
#[derive(Debug)]
pub struct FolderFiles {
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
    pub fn of(folder: &Path) -> Result<FolderFiles> {
        let entries = std::fs::read_dir(current_if_empty(folder)).map_err(Error::io("read", folder))?;
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

    /// Returns the clouds that the folder stands for: LAS and LAZ, or, if it has none, the index of an EPT, or the texts that are point clouds
    /// as `text` lays them out. Folders in it are not searched.
    ///
    /// # Errors
    /// [`Error::Config`] if there is none, [`Error::Io`] if a text cannot be read: it may be a point cloud.
    pub fn clouds(&self, text: &TextOptions) -> Result<FolderClouds> {
        let (laser, texts) = (self.with_endings(&LASER), self.with_endings(&TEXT));
        let mut notes = Vec::new();
        if let Some(index) = self.files.iter().find(|path| is_ept(path)).filter(|_| laser.is_empty()) {
            return Ok(FolderClouds { clouds: vec![index.clone()], notes });
        }
        if let Some(first) = texts.first().filter(|_| !laser.is_empty()) {
            let (texts, them) = some(texts.len(), first);
            notes.push(format!(
                "{texts} not read, because the folder has LAS or LAZ; fix: name {them} to read {them} too"
            ));
        }
        let (clouds, others) = if laser.is_empty() { point_clouds(texts, text)? } else { (laser, Vec::new()) };
        if clouds.is_empty() {
            return Err(self.nothing_here(others.first()));
        }
        notes.extend(others.iter().map(|why| format!("not read, because it is not a point cloud: {why}")));
        notes.extend(self.broken_clouds().map(|link| format!("not read: {}", leads_nowhere(link))));
        Ok(FolderClouds { clouds, notes })
    }

    /// Returns the files with one of these endings.
    fn with_endings(&self, endings: &[&str]) -> Vec<PathBuf> {
        self.files.iter().filter(|path| has_ending(path, endings)).cloned().collect()
    }

    /// Returns all files with exactly this ending: all that a pattern such as `*.laz` matches.
    pub fn of_kind(&self, ending: &str) -> Vec<PathBuf> {
        self.files.iter().chain(&self.broken).filter(|path| kind_of(path).1 == ending).cloned().collect()
    }

    /// Returns the links to point clouds that are not there.
    fn broken_clouds(&self) -> impl Iterator<Item = &PathBuf> {
        self.broken.iter().filter(|path| has_ending(path, &LASER) || has_ending(path, &TEXT))
    }

    /// Returns the error for a folder without point clouds: it says why the first file that looks like one is none, and names a folder in
    /// it that has some.
    fn nothing_here(&self, why: Option<&Error>) -> Error {
        let others =
            self.first_folder_with_clouds().map(|other| format!(", such as {}, which has some", other.display()));
        let why = match (why, self.broken_clouds().next()) {
            (Some(why), _) => format!("; {why}"),
            (None, Some(link)) => format!("; {}", leads_nowhere(link)),
            (None, None) => String::new(),
        };
        Error::Config(format!(
            "{} has no point clouds (.las, .laz, or texts such as .csv and .xyz): name files or folders{}{why}",
            current_if_empty(&self.folder).display(),
            others.unwrap_or_default()
        ))
    }

    fn first_folder_with_clouds(&self) -> Option<PathBuf> {
        let entries = std::fs::read_dir(current_if_empty(&self.folder)).into_iter().flatten().flatten();
        let has_clouds = |path: &PathBuf| {
            path.is_dir() && FolderFiles::of(path).is_ok_and(|files| !files.with_endings(&LASER).is_empty())
        };
        entries.map(|entry| self.folder.join(entry.file_name())).filter(has_clouds).min()
    }
}

/// Says what is wrong with a link whose target is missing.
pub fn leads_nowhere(link: &Path) -> String {
    format!("{} is a link to a missing file: repair or remove it", link.display())
}

/// Returns the folder and the ending of a file.
pub fn kind_of(path: &Path) -> (PathBuf, String) {
    let ending = path.extension().unwrap_or_default().to_string_lossy().into_owned();
    (path.parent().unwrap_or(Path::new("")).to_path_buf(), ending)
}

fn has_ending(path: &Path, endings: &[&str]) -> bool {
    endings.contains(&kind_of(path).1.to_ascii_lowercase().as_str())
}

/// Returns those of `texts` that are point clouds, and why the others are none.
fn point_clouds(texts: Vec<PathBuf>, options: &TextOptions) -> Result<(Vec<PathBuf>, Vec<Error>)> {
    let (mut clouds, mut others) = (Vec::new(), Vec::new());
    for text in texts {
        match points::open(&text, options) {
            Ok(_) => clouds.push(text),
            Err(why @ Error::Input { .. }) => others.push(why),
            Err(error) => return Err(error),
        }
    }
    Ok((clouds, others))
}

/// Says that some texts are, and what to call them.
fn some(count: usize, first: &Path) -> (String, &'static str) {
    match count {
        1 => (format!("{} is", first.display()), "it"),
        _ => (format!("{count} texts, such as {}, are", first.display()), "them"),
    }
}
