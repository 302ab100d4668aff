//! Paths in a configuration: what `~` and `$NAME` mean there.
//!
//! `~/` is the home directory, as everywhere. Variables are refused: the same configuration would read and write somewhere else in
//! another shell, or, where a variable is not set, in a folder called `$NAME`.

use std::path::{Path, PathBuf, is_separator};

/// A path, and the directory that it counts from.
#[derive(Debug, PartialEq)]
pub(crate) struct Anchored<'a> {
    pub(crate) base: PathBuf,
    pub(crate) path: &'a str,
}

/// Returns what `path` counts from: the directory `base`, or the home directory if it begins with `~/`. `option` names the option
/// for messages.
///
/// # Errors
/// A sentence about a path that means something only to a shell.
pub(crate) fn anchor<'a>(option: &str, path: &'a str, base: &Path) -> Result<Anchored<'a>, String> {
    let as_written = Anchored { base: base.into(), path };
    if exists_as_written(path, base) {
        return Ok(as_written);
    }
    if let Some(name) = variable_in(path) {
        let instead = match std::env::var(name) {
            Ok(value) => format!("write the path itself: {name} is {value} now"),
            Err(_) => format!("write the path itself ({name} is not set)"),
        };
        return Err(format!("{option}: {path}: variables are not replaced in a configuration; {instead}"));
    }
    let Some(rest) = path.strip_prefix('~') else { return Ok(as_written) };
    if !rest.is_empty() && !rest.starts_with(is_separator) {
        let of_another = format!("{option}: {path}: ~ stands for your own home directory only; write the path itself");
        return if rest.contains(is_separator) { Err(of_another) } else { Ok(as_written) };
    }
    match std::env::home_dir().filter(|home| home.is_absolute()) {
        Some(base) => Ok(Anchored { base, path: rest.trim_start_matches(is_separator) }),
        None => {
            Err(format!("{option}: {path}: the home directory is not known (HOME is not set); write the path itself"))
        }
    }
}

/// Tells whether the folder or file whose name has such a sign is really called so.
fn exists_as_written(path: &str, base: &Path) -> bool {
    let Some(at) = path.find(['~', '$', '%']) else { return false };
    let end = at + path[at..].find(is_separator).unwrap_or(path.len() - at);
    base.join(&path[..end]).symlink_metadata().is_ok()
}

/// Returns the name of the first variable in `path`, as a shell of Unix or Windows writes one.
fn variable_in(path: &str) -> Option<&str> {
    let is_part = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let name_length = |text: &str| -> usize {
        let starts = text.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
        if starts { text.find(|c| !is_part(c)).unwrap_or(text.len()) } else { 0 }
    };
    for (at, sign) in path.match_indices(['$', '%']) {
        let rest = &path[at + 1..];
        let (rest, end) = match (sign, rest.strip_prefix('{')) {
            ("$", Some(braced)) => (braced, "}"),
            ("$", None) => (rest, ""),
            _ => (rest, "%"),
        };
        let length = name_length(rest);
        if length > 0 && rest[length..].starts_with(end) {
            return Some(&rest[..length]);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variables_are_found() {
        for (path, name) in [
            ("$HOME/a.laz", Some("HOME")),
            ("clouds/${YEAR}/*.laz", Some("YEAR")),
            ("%USERPROFILE%\\a.laz", Some("USERPROFILE")),
            ("a_$x.laz", Some("x")),
            ("5$/a.laz", None),
            ("100%/a 5%.laz", None),
            ("${", None),
            ("$", None),
            ("a.laz", None),
        ] {
            assert_eq!(variable_in(path), name, "{path}");
        }
    }

    #[test]
    fn only_a_tilde_before_a_separator_is_the_home_directory() {
        let folder = tempfile::tempdir().unwrap();
        let anchor = |path: &'static str| anchor("[input] files", path, folder.path());
        let home = std::env::home_dir().unwrap();
        for (path, rest) in [("~/a/*.laz", "a/*.laz"), ("~//a", "a"), ("~", "")] {
            assert_eq!(anchor(path).unwrap(), Anchored { base: home.clone(), path: rest });
        }
        for path in ["~a.laz", "a~/b.laz", "clouds/~/a.laz"] {
            assert_eq!(anchor(path).unwrap(), Anchored { base: folder.path().into(), path });
        }
        assert!(anchor("~someone/a.laz").unwrap_err().contains("your own home directory"));
        assert!(anchor("$GDT_NOT_SET/a.laz").unwrap_err().contains("GDT_NOT_SET is not set"));
        // What is really called so is meant.
        for path in ["$GDT_NOT_SET/a.laz", "~/a.laz", "~someone/a.laz"] {
            std::fs::create_dir(folder.path().join(path.split('/').next().unwrap())).unwrap();
            assert_eq!(anchor(path).unwrap(), Anchored { base: folder.path().into(), path });
        }
    }
}
