//! Which point clouds the arguments of a command mean, and what the configuration calls them.

use crate::init::config_folder::{ConfigFolder, named};
use job::plan::folder_files::{FolderClouds, FolderFiles, kind_of, leads_nowhere};
use points::{TextOptions, is_url};
use std::collections::{BTreeMap, HashSet};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use sys::path_text::{PATTERN_SIGNS, is_pattern};
use sys::{Error, Result};

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
    /// Returns the clouds that `arguments` name: files, folders, patterns, or URLs. Without any, those of the current folder.
    ///
    /// # Errors
    /// [`Error::Config`] if there is none, or one whose name no configuration can hold; [`Error::Io`] if something cannot be read.
    pub(crate) fn of(arguments: &[PathBuf], config: &ConfigFolder) -> Result<NamedClouds> {
        let mut clouds = NamedClouds::default();
        if arguments.is_empty() {
            clouds.add_folder(Path::new(""), config)?;
        }
        let mut files = Vec::new();
        for argument in arguments {
            if let Some(url) = argument.to_str().filter(|name| is_url(name)) {
                clouds.patterns.push(url.to_string());
                continue;
            }
            match argument.metadata() {
                Ok(data) if data.is_dir() => clouds.add_folder(argument, config)?,
                Ok(_) => files.push(argument.clone()),
                Err(error) if error.kind() == ErrorKind::NotFound && argument.is_symlink() => {
                    return Err(Error::Config(leads_nowhere(argument)));
                }
                Err(error) => clouds.add_pattern(argument, config, error)?,
            }
        }
        clouds.add_files(files, config)?;
        let mut known = HashSet::new();
        clouds.patterns.retain(|pattern| known.insert(pattern.clone()));
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
            let is_whole =
                group.len() >= MANY && !ending.is_empty() && FolderFiles::of(&folder)?.of_kind(&ending) == group;
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

    /// Adds the clouds of a folder by their names, or by a pattern for all of one kind.
    fn add_folder(&mut self, folder: &Path, config: &ConfigFolder) -> Result<()> {
        let files = FolderFiles::of(folder)?;
        let FolderClouds { clouds, notes } = files.clouds(&TextOptions::default())?;
        self.notes.extend(notes);
        let mut by_ending: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
        clouds.iter().for_each(|path| by_ending.entry(kind_of(path).1).or_default().push(path.clone()));
        for (ending, group) in by_ending {
            if group.len() > 1 && group.len() == files.of_kind(&ending).len() {
                self.patterns.push(config.pattern(folder, &format!("*.{ending}"))?);
            } else {
                self.patterns.extend(group.iter().map(|file| config.name(file)).collect::<Result<Vec<_>>>()?);
            }
        }
        Ok(())
    }

    /// Adds a pattern such as `clouds/*.laz`. `error` is why no file has this name.
    fn add_pattern(&mut self, pattern: &Path, config: &ConfigFolder, error: io::Error) -> Result<()> {
        let Some(text) = pattern.to_str().filter(|text| is_pattern(text)) else {
            return Err(missing(pattern, pattern, error));
        };
        // The path before the first sign with a meaning is a folder.
        let signs = text.find(PATTERN_SIGNS).unwrap_or(0);
        let (folder, rest) = match text[..signs].rfind(std::path::is_separator) {
            None => ("", text),
            Some(0) => ("/", &text[1..]),
            Some(at) => (&text[..at], &text[at + 1..]),
        };
        let folder = Path::new(folder);
        match named(folder).metadata() {
            Ok(data) if data.is_dir() => {}
            Ok(_) => return Err(missing(pattern, folder, ErrorKind::NotADirectory.into())),
            Err(error) => return Err(missing(pattern, folder, error)),
        }
        self.patterns.push(config.pattern(folder, rest)?);
        Ok(())
    }
}

/// Returns the error for an argument that names nothing, because of `error` at `path`.
fn missing(argument: &Path, path: &Path, error: io::Error) -> Error {
    match error.kind() {
        ErrorKind::NotFound | ErrorKind::NotADirectory => {
            Error::Config(format!("there is no file {}: correct its name", argument.display()))
        }
        _ => Error::io("read", path)(error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// Returns what a configuration in `root` calls the clouds that are meant, or the error, and the notes.
    fn clouds(root: &Path, arguments: &[&str]) -> (Vec<String>, Vec<String>) {
        let config = ConfigFolder::of(Some(&root.join("job.toml"))).unwrap();
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
        assert!(
            notes.len() == 1 && notes[0].contains("5.csv is not read, because the folder has LAS or LAZ"),
            "{notes:?}"
        );
        let (found, notes) = clouds(&root, &["b"]);
        assert_eq!(found, ["b/*.xyz"]);
        assert!(notes.len() == 1 && notes[0].contains("readme.txt"), "{notes:?}");
        let (found, _) = clouds(&root, &["c"]);
        assert!(found[0].contains("has no point clouds") && found[0].contains("c/d, which has some"), "{found:?}");
    }

    #[cfg(unix)]
    #[test]
    fn a_file_whose_name_is_not_utf8_is_one_of_its_folder() {
        use std::os::unix::ffi::OsStrExt;
        let root = tempfile::tempdir().unwrap();
        let root = root.path().canonicalize().unwrap();
        write(&root, &["a/1.laz"]);
        fs::write(root.join("a").join(std::ffi::OsStr::from_bytes(b"\xff.laz")), "").unwrap();
        assert_eq!(clouds(&root, &["a"]).0, ["a/*.laz"]);
        fs::remove_file(root.join("a/1.laz")).unwrap();
        assert_eq!(clouds(&root, &["a"]).0, ["a/?.laz"]);
    }

    #[test]
    fn a_folder_without_clouds_says_why_its_texts_are_none() {
        let root = tempfile::tempdir().unwrap();
        let root = root.path().canonicalize().unwrap();
        write(&root, &["a/1.laz"]);
        fs::create_dir(root.join("b")).unwrap();
        fs::write(root.join("b/abc.csv"), "a,b,c\n1,2,3\n").unwrap();
        let (found, _) = clouds(&root, &["b"]);
        assert!(found[0].contains("b has no point clouds") && found[0].contains("abc.csv: "), "{found:?}");
    }

    #[cfg(unix)]
    #[test]
    fn links_that_lead_nowhere_are_named() {
        let root = tempfile::tempdir().unwrap();
        let root = root.path().canonicalize().unwrap();
        write(&root, &["a/1.laz", "a/2.laz"]);
        fs::create_dir(root.join("b")).unwrap();
        for link in ["a/3.laz", "b/1.laz"] {
            std::os::unix::fs::symlink("gone.laz", root.join(link)).unwrap();
        }
        let (found, notes) = clouds(&root, &["a"]);
        // A pattern would match the link too.
        assert_eq!(found, ["a/1.laz", "a/2.laz"]);
        assert!(notes.len() == 1 && notes[0].contains("3.laz is a link to a missing file"), "{notes:?}");
        for argument in ["a/3.laz", "b"] {
            let (found, _) = clouds(&root, &[argument]);
            assert!(found[0].contains(".laz is a link to a missing file"), "{found:?}");
        }
        // What cannot be read may be a cloud.
        write(&root, &["c/1.csv"]);
        std::os::unix::fs::symlink("2.csv", root.join("c/2.csv")).unwrap();
        let (found, _) = clouds(&root, &["c"]);
        assert!(found[0].contains("cannot read") && found[0].contains("2.csv"), "{found:?}");
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
        assert_eq!(clouds(&root, &["b/[2].csv", "b/1.csv", "b/./1.csv"]).0, ["b/[[]2[]].csv", "b/1.csv"]);
        assert_eq!(clouds(&root, &["b/*.csv", "a/[12].la?"]).0, ["b/*.csv", "a/[12].la?"]);
        for name in ["b/2.csv", "no/*.csv"] {
            assert!(clouds(&root, &[name]).0[0].contains("there is no file"), "{name}");
        }
    }
}
