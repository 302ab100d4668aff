//! How a configuration names files: paths and patterns that count from its folder.

use job::plan::named_files::paths_like;
use std::path::{Component, Path, PathBuf};
use sys::{Error, Result};

/// The folder of a configuration that is to be written.
pub(crate) struct ConfigFolder {
    /// As the user names it; empty for the current folder.
    pub(crate) path: PathBuf,
    /// The same without links.
    real: PathBuf,
    is_current: bool,
    /// Whether the configuration may be moved anywhere, because it has no file yet.
    is_open: bool,
}

impl ConfigFolder {
    /// Returns the folder of the configuration at `file`; without one, the current folder.
    ///
    /// # Errors
    /// [`Error::Config`] if there is no such folder.
    pub(crate) fn of(file: Option<&Path>) -> Result<ConfigFolder> {
        let is_open = file.is_none();
        let file = file.unwrap_or(Path::new(""));
        let path = file.parent().unwrap_or(Path::new("")).to_path_buf();
        if !named(&path).is_dir() {
            let (file, path) = (file.display(), path.display());
            return Err(Error::Config(format!("{file}: there is no folder {path}: create it first")));
        }
        let (real, current) = (real(&path)?, real(Path::new(""))?);
        let is_current = real == current;
        Ok(ConfigFolder { path, real, is_current, is_open })
    }

    /// Returns what the configuration calls the file at `path`: a pattern that no other file matches.
    ///
    /// # Errors
    /// [`Error::Config`] if the path is not UTF-8, and every pattern matches another file too.
    pub(crate) fn name(&self, path: &Path) -> Result<String> {
        let folder = self.way_to(path.parent().unwrap_or(Path::new("")))?;
        self.pattern_of(&folder.join(path.file_name().unwrap_or_default()))
    }

    /// Returns a pattern that matches this path alone, relative to this folder.
    fn pattern_of(&self, path: &Path) -> Result<String> {
        match path.to_str() {
            // Every system takes slashes, and they need no quotes.
            Some(text) if cfg!(windows) => Ok(escaped(&text.replace('\\', "/"))),
            Some(text) => Ok(escaped(text)),
            None => {
                check_is_alone(&real(&self.path.join(path))?)?;
                Ok(with_question_marks(path))
            }
        }
    }

    /// Returns what the configuration calls the files in `folder` that match `pattern`.
    ///
    /// # Errors
    /// [`Error::Config`] if the path is not UTF-8, and every pattern matches another folder too.
    pub(crate) fn pattern(&self, folder: &Path, pattern: &str) -> Result<String> {
        let folder = self.pattern_of(&self.way_to(folder)?)?;
        Ok(match folder.as_str() {
            "" => pattern.to_string(),
            folder => format!("{}/{pattern}", folder.trim_end_matches('/')),
        })
    }

    /// Returns what the configuration calls the folder at `path`, which need not be there yet.
    ///
    /// # Errors
    /// [`Error::Config`] if the path is not UTF-8.
    pub(crate) fn directory(&self, path: &Path) -> Result<String> {
        let there = path.ancestors().find(|folder| named(folder).is_dir()).unwrap_or(Path::new(""));
        let way = self.way_to(there)?;
        // To join nothing would add a separator.
        let way = if there == path { way } else { way.join(path.strip_prefix(there).unwrap_or(path)) };
        match named(&way).to_str() {
            Some(text) if cfg!(windows) => Ok(text.replace('\\', "/")),
            Some(text) => Ok(text.to_string()),
            None => {
                Err(Error::Config(format!("{}: the name is not UTF-8: name another output directory", path.display())))
            }
        }
    }

    /// Returns what the configuration calls the file at `path` where it takes no pattern.
    ///
    /// # Errors
    /// [`Error::Config`] if there is no such file, or its path is not UTF-8.
    pub(crate) fn file(&self, path: &Path) -> Result<String> {
        if !path.exists() {
            return Err(Error::Config(format!("there is no file {}", path.display())));
        }
        let folder = self.way_to(path.parent().unwrap_or(Path::new("")))?;
        match folder.join(path.file_name().unwrap_or_default()).to_str() {
            Some(text) if cfg!(windows) => Ok(text.replace('\\', "/")),
            Some(text) => Ok(text.to_string()),
            None => Err(Error::Config(format!("{}: the name is not UTF-8: rename the file", path.display()))),
        }
    }

    /// Returns the path of a folder as it counts from here. It stays as the user wrote it where that leads to the same place.
    fn way_to(&self, folder: &Path) -> Result<PathBuf> {
        if self.is_current && folder.is_relative() {
            return Ok(folder.strip_prefix(".").unwrap_or(folder).to_path_buf());
        }
        if self.is_open && folder.is_absolute() {
            return Ok(folder.to_path_buf());
        }
        let target = real(folder)?;
        if let Ok(below) = target.strip_prefix(&self.real) {
            return Ok(below.to_path_buf());
        }
        let shared = self.real.components().zip(target.components()).take_while(|(own, other)| own == other);
        let shared = shared.filter(|(own, _)| matches!(own, Component::Normal(_))).count();
        if folder.is_absolute() || shared == 0 {
            return Ok(if folder.is_absolute() { folder.to_path_buf() } else { target });
        }
        let names = |path: &Path| path.components().filter(|part| matches!(part, Component::Normal(_))).count();
        let up = std::iter::repeat_n("..", names(&self.real) - shared);
        let down = target.components().filter(|part| matches!(part, Component::Normal(_))).skip(shared);
        Ok(up.map(Path::new).chain(down.map(|part| Path::new(part.as_os_str()))).collect())
    }
}

/// Returns a path that the system knows: an empty one is the current folder.
pub(crate) fn named(folder: &Path) -> &Path {
    if folder.as_os_str().is_empty() { Path::new(".") } else { folder }
}

fn real(folder: &Path) -> Result<PathBuf> {
    named(folder).canonicalize().map_err(Error::io("read", folder))
}

/// Returns a pattern for a path that is not UTF-8: a configuration is, so a `?` stands for what is not.
fn with_question_marks(path: &Path) -> String {
    escaped(&path.to_string_lossy()).replace(char::REPLACEMENT_CHARACTER, "?")
}

/// Fails if the pattern for a path that is not UTF-8 matches another path too.
fn check_is_alone(path: &Path) -> Result<()> {
    match paths_like(&with_question_marks(path))?.len() {
        0 | 1 => Ok(()),
        _ => Err(Error::Config(format!(
            "{}: its name is not UTF-8, and every pattern for it matches another name too: rename it",
            path.display()
        ))),
    }
}

/// Returns a pattern that matches this path alone. A sign that has a meaning in patterns, for the home directory or for variables stands
/// in brackets, which take it as it is.
fn escaped(path: &str) -> String {
    let has_meaning = |(at, sign): (usize, char)| "*?[]$%".contains(sign) || at == 0 && sign == '~';
    let piece = |(at, sign)| if has_meaning((at, sign)) { format!("[{sign}]") } else { sign.to_string() };
    path.char_indices().map(piece).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config;
    use job::plan::inputs::input_paths;
    use std::fs;
    use sys::ErrorKind;

    /// A folder that is not the current one.
    fn folder_in(root: &Path, name: &str) -> ConfigFolder {
        fs::create_dir_all(root.join(name)).unwrap();
        ConfigFolder::of(Some(&root.join(name).join("job.toml"))).unwrap()
    }

    #[test]
    fn any_name_leads_back_to_its_file_alone() {
        let root = tempfile::tempdir().unwrap();
        let here = folder_in(root.path(), "x $HOME [1]");
        for name in [
            "a.laz",
            "a[1].laz",
            "a1.laz",
            "b*.laz",
            "bb.laz",
            "$HOME.laz",
            "~.laz",
            "~/c.laz",
            "%A%.laz",
            "d'\"\\ \t.laz",
        ] {
            let file = here.path.join(name);
            fs::create_dir_all(file.parent().unwrap()).unwrap();
            fs::write(&file, "").unwrap();
            let files = toml::Value::Array(vec![toml::Value::String(here.name(&file).unwrap())]);
            let text = format!("[input]\nfiles = {files}\n[output]\ndirectory = \"out\"\n");
            let options = config::of_text(&text, &here.path).unwrap_or_else(|e| panic!("{e}: {text}"));
            assert_eq!(input_paths(&options.input).unwrap(), [file], "{text}");
        }
    }

    #[test]
    fn paths_count_from_the_folder_of_the_configuration() {
        let root = tempfile::tempdir().unwrap();
        let real = root.path().canonicalize().unwrap();
        let here = folder_in(&real, "jobs/east");
        for folder in ["jobs/east/clouds", "jobs/clouds", "other"] {
            fs::create_dir_all(real.join(folder)).unwrap();
        }
        let name = |path: &str| here.name(&real.join(path)).unwrap();
        assert_eq!(name("jobs/east/a.laz"), "a.laz");
        assert_eq!(name("jobs/east/clouds/a.laz"), "clouds/a.laz");
        // A path that the user writes whole stays whole elsewhere.
        assert_eq!(name("other/a.laz"), real.join("other/a.laz").to_str().unwrap());
        assert_eq!(here.pattern(&real.join("jobs/east/clouds"), "*.laz").unwrap(), "clouds/*.laz");
        assert_eq!(here.pattern(&real.join("jobs/east"), "*.laz").unwrap(), "*.laz");
        // So does every one in a configuration that is printed, and may be written anywhere.
        let printed = ConfigFolder::of(None).unwrap();
        let absolute = std::env::current_dir().unwrap();
        assert_eq!(
            printed.pattern(&absolute, "*.laz").unwrap(),
            format!("{}/*.laz", absolute.to_str().unwrap().replace('\\', "/"))
        );
        assert_eq!(printed.name(Path::new("./a.laz")).unwrap(), "a.laz");
    }

    #[test]
    fn a_folder_that_is_not_there_is_refused() {
        let root = tempfile::tempdir().unwrap();
        let what = ConfigFolder::of(Some(&root.path().join("no/job.toml"))).err().unwrap();
        assert!(what.kind() == ErrorKind::Usage && what.to_string().contains("create it first"), "{what}");
    }

    #[cfg(unix)]
    #[test]
    fn a_pattern_stands_for_a_name_that_is_not_utf8_if_it_matches_no_other() {
        use std::os::unix::ffi::OsStrExt;
        let root = tempfile::tempdir().unwrap();
        let here = folder_in(root.path(), "x");
        let [file, other] =
            [&b"a\xff[1].laz"[..], b"a\xfe[1].laz"].map(|name| here.path.join(std::ffi::OsStr::from_bytes(name)));
        fs::write(&file, "").unwrap();
        assert_eq!(here.name(&file).unwrap(), "a?[[]1[]].laz");
        fs::write(&other, "").unwrap();
        let what = here.name(&file).unwrap_err();
        assert!(what.kind() == ErrorKind::Usage && what.to_string().contains("rename it"), "{what}");
    }
}
