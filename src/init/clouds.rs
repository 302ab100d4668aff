//! Which point clouds the arguments of `init` mean, and what the configuration calls them.

use crate::init::config_folder::{ConfigFolder, named};
use crate::input::{self, TextOptions, is_url};
use crate::{Error, Result};
use std::collections::{BTreeMap, HashSet};
use std::path::{Path, PathBuf};

/// The endings of the names of LAS and LAZ files.
const LASER: [&str; 2] = ["las", "laz"];

/// The endings of texts that may be point clouds, in a folder that has no LAS and no LAZ.
const TEXT: [&str; 6] = ["csv", "txt", "xyz", "asc", "pts", "tsv"];

/// So many files that are all of their kind in a folder are named by a pattern.
const MANY: usize = 6;

/// The point clouds of a job.
#[derive(Debug, Default)]
pub(crate) struct NamedClouds {
    /// The values of `[input] files`.
    pub(crate) patterns: Vec<String>,
    /// What the user should know about files that were left out.
    pub(crate) notes: Vec<String>,
}

impl NamedClouds {
    /// Returns the clouds that `arguments` name: files, folders, or patterns. Without any, those of the current folder.
    ///
    /// # Errors
    /// [`Error::Config`] if there is none, or one whose name no configuration can hold; [`Error::Io`] if a folder cannot be read.
    pub(crate) fn of(arguments: &[PathBuf], config: &ConfigFolder) -> Result<NamedClouds> {
        let mut clouds = NamedClouds::default();
        if arguments.is_empty() {
            clouds.add_folder(Path::new(""), config)?;
        }
        let mut files = Vec::new();
        for argument in arguments {
            if let Some(url) = argument.to_str().filter(|name| is_url(name)) {
                // Its query may be a secret.
                let place = url.split('?').next().unwrap_or_default();
                return Err(Error::Config(format!(
                    "{place}: init looks at files of this machine only; write URLs into [input] files yourself"
                )));
            }
            if argument.is_dir() {
                clouds.add_folder(argument, config)?;
            } else if argument.symlink_metadata().is_ok() {
                files.push(argument.clone());
            } else {
                clouds.add_pattern(argument, config)?;
            }
        }
        clouds.add_files(files, config)?;
        Ok(clouds)
    }

    /// Adds files by their names, or by a pattern if they are many and all of their kind in their folder.
    fn add_files(&mut self, files: Vec<PathBuf>, config: &ConfigFolder) -> Result<()> {
        let mut groups: BTreeMap<(PathBuf, String), Vec<PathBuf>> = BTreeMap::new();
        for file in &files {
            groups.entry(kind_of(file)).or_default().push(file.clone());
        }
        let mut by_pattern = HashSet::new();
        for ((folder, ending), mut group) in groups {
            group.sort();
            group.dedup();
            let is_kind = |path: &PathBuf| kind_of(path).1 == ending;
            let is_whole = group.len() >= MANY && !ending.is_empty() && {
                let all: Vec<PathBuf> = files_in(&folder)?.into_iter().filter(is_kind).collect();
                all == group
            };
            if is_whole {
                self.patterns.push(config.pattern(&folder, &format!("*.{ending}"))?);
                by_pattern.extend(group);
            }
        }
        for file in files.iter().filter(|file| !by_pattern.contains(*file)) {
            self.patterns.push(config.name(file)?);
        }
        Ok(())
    }

    /// Adds the clouds of a folder: LAS and LAZ, or, if it has none, the texts that are point clouds.
    fn add_folder(&mut self, folder: &Path, config: &ConfigFolder) -> Result<()> {
        let files = files_in(folder)?;
        let of = |endings: &[&str]| -> Vec<PathBuf> {
            let is_one = |path: &&PathBuf| endings.contains(&kind_of(path).1.to_ascii_lowercase().as_str());
            files.iter().filter(is_one).filter(|path| path.to_str().is_some()).cloned().collect()
        };
        let (laser, texts) = (of(&LASER), of(&TEXT));
        if let Some(first) = texts.first().filter(|_| !laser.is_empty()) {
            let (texts, them) = some(texts.len(), first);
            self.notes.push(format!("{texts} left out beside LAS and LAZ: name {them} to read {them} too"));
        }
        let clouds = if laser.is_empty() { self.point_clouds(texts) } else { laser };
        if clouds.is_empty() {
            return Err(nothing_in(folder));
        }
        let mut by_ending: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
        clouds.iter().for_each(|path| by_ending.entry(kind_of(path).1).or_default().push(path.clone()));
        for (ending, group) in by_ending {
            let all = files.iter().filter(|path| kind_of(path).1 == ending).count();
            if group.len() > 1 && group.len() == all {
                self.patterns.push(config.pattern(folder, &format!("*.{ending}"))?);
            } else {
                self.patterns.extend(group.iter().map(|file| config.name(file)).collect::<Result<Vec<_>>>()?);
            }
        }
        Ok(())
    }

    /// Returns those of `texts` that are point clouds, and notes that the others are not.
    fn point_clouds(&mut self, texts: Vec<PathBuf>) -> Vec<PathBuf> {
        let mut clouds = Vec::new();
        for text in texts {
            match input::open(&text, &TextOptions::default()) {
                Ok(_) => clouds.push(text),
                Err(why) => self.notes.push(format!("left out, because it is no point cloud: {why}")),
            }
        }
        clouds
    }

    /// Adds a pattern such as `clouds/*.laz`.
    fn add_pattern(&mut self, pattern: &Path, config: &ConfigFolder) -> Result<()> {
        let missing = || Error::Config(format!("there is no file {}: correct its name", pattern.display()));
        let text = pattern.to_str().filter(|text| text.contains(['*', '?', '['])).ok_or_else(missing)?;
        // The path before the first sign with a meaning is a folder.
        let signs = text.find(['*', '?', '[']).unwrap_or(0);
        let (folder, rest) = match text[..signs].rfind(std::path::is_separator) {
            None => ("", text),
            Some(0) => ("/", &text[1..]),
            Some(at) => (&text[..at], &text[at + 1..]),
        };
        if !named(Path::new(folder)).is_dir() {
            return Err(missing());
        }
        self.patterns.push(config.pattern(Path::new(folder), rest)?);
        Ok(())
    }
}

/// Returns the folder and the ending of a file.
fn kind_of(path: &Path) -> (PathBuf, String) {
    let ending = path.extension().unwrap_or_default().to_string_lossy().into_owned();
    (path.parent().unwrap_or(Path::new("")).to_path_buf(), ending)
}

/// Returns the files in a folder, by their names.
fn files_in(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = std::fs::read_dir(named(folder)).map_err(Error::io("read", folder))?;
    let mut files = Vec::new();
    for entry in entries {
        let path = folder.join(entry.map_err(Error::io("read", folder))?.file_name());
        if path.is_file() {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

/// Says that some texts are, and what to call them.
fn some(count: usize, first: &Path) -> (String, &'static str) {
    match count {
        1 => (format!("{} is", first.display()), "it"),
        _ => (format!("{count} texts, such as {}, are", first.display()), "them"),
    }
}

/// Returns the error for a folder without point clouds. It names folders in it that have some.
fn nothing_in(folder: &Path) -> Error {
    let entries = std::fs::read_dir(named(folder)).into_iter().flatten().flatten();
    let has_clouds = |path: &PathBuf| {
        let is_laser = |file: &PathBuf| LASER.contains(&kind_of(file).1.to_ascii_lowercase().as_str());
        path.is_dir() && files_in(path).is_ok_and(|files| files.iter().any(is_laser))
    };
    let mut others: Vec<PathBuf> = entries.map(|entry| folder.join(entry.file_name())).filter(has_clouds).collect();
    others.sort();
    let others = match others.first() {
        Some(other) => format!(", such as {}, which has some", other.display()),
        None => String::new(),
    };
    Error::Config(format!(
        "{} has no point clouds (.las, .laz, or texts such as .csv and .xyz): name files or folders{others}",
        named(folder).display()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// Returns what a configuration in `root` calls the clouds that are meant, or the error, and the notes.
    fn clouds(root: &Path, arguments: &[&str]) -> (Vec<String>, Vec<String>) {
        let config = ConfigFolder::of(&root.join("job.toml")).unwrap();
        let arguments: Vec<PathBuf> = arguments.iter().map(|name| root.join(name)).collect();
        match NamedClouds::of(&arguments, &config) {
            Ok(clouds) => (clouds.patterns, clouds.notes),
            Err(error) => (vec![error.to_string()], vec![]),
        }
    }

    fn write(root: &Path, names: &[&str]) {
        for name in names {
            fs::create_dir_all(root.join(name).parent().unwrap()).unwrap();
            fs::write(root.join(name), "1 2 3\n4 5 6\n7 8 9\n").unwrap();
        }
    }

    #[test]
    fn a_folder_means_its_clouds_and_texts_only_without_others() {
        let root = tempfile::tempdir().unwrap();
        let root = root.path().canonicalize().unwrap();
        write(
            &root,
            &["a/1.laz", "a/2.laz", "a/3.LAZ", "a/4.las", "a/5.csv", "a/6.md", "b/1.xyz", "b/2.xyz", "c/d/1.laz"],
        );
        fs::write(root.join("b/readme.txt"), "What these files are.\n").unwrap();
        let (found, notes) = clouds(&root, &["a"]);
        assert_eq!(found, ["a/3.LAZ", "a/4.las", "a/*.laz"]);
        assert!(notes.len() == 1 && notes[0].contains("5.csv is left out beside LAS and LAZ"), "{notes:?}");
        let (found, notes) = clouds(&root, &["b"]);
        assert_eq!(found, ["b/*.xyz"]);
        assert!(notes.len() == 1 && notes[0].contains("readme.txt"), "{notes:?}");
        let (found, _) = clouds(&root, &["c"]);
        assert!(found[0].contains("has no point clouds") && found[0].contains("c/d, which has some"), "{found:?}");
    }

    #[cfg(unix)]
    #[test]
    fn a_file_whose_name_is_no_text_is_left_out_of_a_folder() {
        use std::os::unix::ffi::OsStrExt;
        let root = tempfile::tempdir().unwrap();
        let root = root.path().canonicalize().unwrap();
        write(&root, &["a/1.laz"]);
        fs::write(root.join("a").join(std::ffi::OsStr::from_bytes(b"\xff.laz")), "").unwrap();
        assert_eq!(clouds(&root, &["a"]).0, ["a/1.laz"]);
    }

    #[test]
    fn files_are_named_unless_they_are_many_and_all_of_their_kind() {
        let root = tempfile::tempdir().unwrap();
        let root = root.path().canonicalize().unwrap();
        let names: Vec<String> = (1..=MANY).map(|i| format!("a/{i}.laz")).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        write(&root, &names);
        write(&root, &["b/1.csv", "b/[2].csv"]);
        assert_eq!(clouds(&root, &names[1..]).0, names[1..]);
        assert_eq!(clouds(&root, &names).0, ["a/*.laz"]);
        assert_eq!(clouds(&root, &["b/[2].csv", "b/1.csv"]).0, ["b/[[]2[]].csv", "b/1.csv"]);
        assert_eq!(clouds(&root, &["b/*.csv", "a/[12].la?"]).0, ["b/*.csv", "a/[12].la?"]);
        for name in ["b/2.csv", "no/*.csv"] {
            assert!(clouds(&root, &[name]).0[0].contains("there is no file"), "{name}");
        }
    }
}
