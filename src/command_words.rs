//! What the words of a command line mean that has no command: the configuration of a job, or point clouds.

use crate::config::nearest::nearest;
use crate::init::is_configuration;
use crate::shell_word::quoted;
use job::plan::folder_files::{LASER, TEXT};
use points::is_url;
use std::io::Read;
use std::path::{Path, PathBuf, is_separator};
use sys::path_text::is_pattern;
use sys::{Error, Result};

/// The ending of the names of configurations.
const TOML: &str = "toml";

/// What the words name.
#[derive(Debug, PartialEq)]
pub enum Named<'a> {
    /// The configuration of a job.
    Configuration(&'a Path),
    /// Point clouds.
    Clouds(&'a [PathBuf]),
}

/// Returns what the words of a command line name. `commands` are the names of all commands.
///
/// # Errors
/// [`Error::Config`] if they name something of both kinds, more than one configuration, or a command at the wrong place.
pub fn named<'a>(words: &'a [PathBuf], commands: &[String]) -> Result<Named<'a>> {
    check_first_word(words, commands)?;
    let later = words.iter().skip(1).filter(|word| !word.exists()).filter_map(|word| word.to_str());
    if let Some(command) = later.into_iter().find(|word| commands.iter().any(|command| command == word)) {
        return Err(Error::Config(format!(
            "name the command first, as in `gdt-batch {command} {}`",
            words[0].display()
        )));
    }
    let configuration = match words {
        [one] => Some(one).filter(|word| may_be_configuration(word)),
        many => many.iter().find(|word| is_called(word, &[TOML]) || is_text_of_configuration(word)),
    };
    match (configuration, words) {
        (None, _) => Ok(Named::Clouds(words)),
        (Some(one), [_]) => Ok(Named::Configuration(one)),
        (Some(one), _) => Err(Error::Config(format!(
            "{} is a configuration: name one configuration alone, or point clouds alone",
            one.display()
        ))),
    }
}

/// Fails if the first word is none of a file, and rather a mistyped command.
fn check_first_word(words: &[PathBuf], commands: &[String]) -> Result<()> {
    let [first, others @ ..] = words else { return Ok(()) };
    let is_word = |word: &&str| word.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'-');
    let Some(word) = first.to_str().filter(is_word).filter(|_| first.symlink_metadata().is_err()) else {
        return Ok(());
    };
    let others: String = others.iter().map(|word| format!(" {}", quoted(&word.display().to_string()))).collect();
    Err(Error::Config(match nearest(word, commands.iter().map(String::as_str)) {
        Some(command) => format!("there is no file {word}; did you mean the command `gdt-batch {command}{others}`?"),
        None => format!("there is no file {word}, and no command of this name: `gdt-batch --help` lists the commands"),
    }))
}

/// The endings of lists of point clouds, and of the description of an EPT.
const LISTS: [&str; 3] = ["vpc", "json", "lst"];

/// The endings of texts that are point clouds or meshes of other programs: a message about their format helps more than one about TOML.
const OTHERS: [&str; 4] = ["ply", "pcd", "ptx", "obj"];

/// Tells whether a word that stands alone is the configuration of a job: a file `.toml`, or any other text that is not called like a point
/// cloud.
fn may_be_configuration(word: &Path) -> bool {
    match word.metadata() {
        _ if is_called(word, &[TOML]) => true,
        _ if [&LASER[..], &LISTS, &OTHERS].iter().any(|endings| is_called(word, endings))
            || word.to_str().is_some_and(is_url) =>
        {
            false
        }
        Ok(data) if data.is_dir() => false,
        // What is in a pipe can be read once.
        Ok(data) if !data.is_file() => true,
        Ok(_) if is_called(word, &TEXT) => is_text_of_configuration(word),
        Ok(_) => is_text(word),
        Err(_) => {
            !is_called(word, &TEXT)
                && !word.to_str().is_some_and(|name| is_pattern(name) || name.ends_with(is_separator))
        }
    }
}

/// Returns the error about a configuration with what to do if it was to be a point cloud.
pub fn with_endings_of_clouds(error: Error, word: &Path) -> Error {
    match error {
        Error::Config(what) if word.is_file() && !is_called(word, &[TOML]) => Error::Config(format!(
            "{what}\n{} is read as a configuration; a text file of points ends in .{}",
            word.display(),
            TEXT.join(", .")
        )),
        error => error,
    }
}

/// Tells whether the name of a file has one of these endings.
fn is_called(word: &Path, endings: &[&str]) -> bool {
    let ending = word.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    endings.contains(&ending.as_str())
}

fn is_text_of_configuration(word: &Path) -> bool {
    word.is_file() && !is_called(word, &LASER) && is_configuration(word).unwrap_or(false)
}

/// Tells whether a file begins as a text does: point clouds of other names, and all other binary files, have a byte 0 at once.
fn is_text(file: &Path) -> bool {
    let mut start = Vec::new();
    let read = std::fs::File::open(file).and_then(|opened| opened.take(1024).read_to_end(&mut start));
    read.is_err() || !start.contains(&0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    const JOB: &str = "[input]\nfiles = [\"a.laz\"]\n[output]\ndirectory = \"out\"\n";

    fn kind(root: &Path, names: &[&str]) -> String {
        let words: Vec<PathBuf> =
            names.iter().map(|name| if name.contains("://") { name.into() } else { root.join(name) }).collect();
        match named(&words, &["check".into()]) {
            Ok(Named::Configuration(_)) => "configuration".into(),
            Ok(Named::Clouds(_)) => "clouds".into(),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn names_and_content_tell_a_configuration_from_point_clouds() {
        let root = tempfile::tempdir().unwrap();
        let there = |name: &str, content: &[u8]| fs::write(root.path().join(name), content).unwrap();
        for (name, content) in [
            ("job.toml", JOB.as_bytes()),
            ("job.txt", JOB.as_bytes()),
            ("job", JOB.as_bytes()),
            ("points.txt", b"1 2 3\n"),
            ("cloud.las", b"LASF\0"),
            ("cloud.old", b"LASF\0\x01"),
            ("points.dat", b"1 2 3\n"),
            ("a[1].laz", b"LASF\0"),
        ] {
            there(name, content);
        }
        fs::create_dir(root.path().join("folder.d")).unwrap();
        for (name, is_configuration) in [
            ("job.toml", true),
            ("no.toml", true),
            ("JOB.TOML", true),
            ("job.txt", true),
            ("job", true),
            ("points.dat", true),
            ("points.txt", false),
            ("no.txt", false),
            ("no.laz", false),
            ("cloud.las", false),
            ("cloud.old", false),
            ("a[1].laz", false),
            ("*", false),
            ("folder.d", false),
            ("https://host/a.toml.laz", false),
            ("s3://bucket/a", false),
        ] {
            assert_eq!(kind(root.path(), &[name]) == "configuration", is_configuration, "{name}");
        }
        assert_eq!(kind(root.path(), &["cloud.las", "points.dat", "no"]), "clouds");
    }

    #[test]
    fn a_word_that_is_no_file_may_be_a_mistyped_command() {
        let told = |words: &[&str]| {
            let words: Vec<PathBuf> = words.iter().map(PathBuf::from).collect();
            named(&words, &["check".into(), "verify".into()]).unwrap_err().to_string()
        };
        assert!(told(&["chek", "my job.toml"]).ends_with("did you mean the command `gdt-batch check 'my job.toml'`?"));
        assert!(told(&["verfy"]).contains("`gdt-batch verify`"));
        assert!(told(&["nothing-like-it"]).contains("no command of this name"));
    }

    #[test]
    fn a_configuration_stands_alone_and_a_command_first() {
        let root = tempfile::tempdir().unwrap();
        fs::write(root.path().join("job.txt"), JOB).unwrap();
        for names in [&["a.laz", "b.toml"][..], &["b.toml", "c.toml"], &["a.laz", "job.txt"]] {
            assert!(kind(root.path(), names).contains("is a configuration: name one configuration alone"), "{names:?}");
        }
        let words = ["job.toml", "check"].map(PathBuf::from);
        let error = named(&words, &["check".into()]).unwrap_err().to_string();
        assert!(error.contains("gdt-batch check job.toml"), "{error}");
    }
}
