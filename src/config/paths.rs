//! Paths in a configuration: what `~` and `$NAME` mean there.
//!
//! `~/` is the home directory, as everywhere. Variables are refused: the same configuration would read and write somewhere else in
//! another shell, or, where a variable is not set, in a folder called `$NAME`.

use glob::Pattern;
use std::path::{Path, PathBuf, is_separator};
use sys::path_text::is_pattern;

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

/// Returns a path of the `option` as a pattern. A folder or a file that is really called like a pattern is meant alone; then a warning names
/// another that the pattern matches too.
pub(crate) fn as_pattern(option: &str, path: &str, base: &Path) -> (String, Option<String>) {
    let (mut place, mut is_real, mut pattern, mut warning) = (base.to_path_buf(), true, String::new(), None);
    for piece in path.split_inclusive(is_separator) {
        let name = piece.trim_end_matches(is_separator);
        is_real = is_real && (!is_pattern(name) || place.join(name).symlink_metadata().is_ok());
        if is_real && is_pattern(name) {
            warning = warning.or_else(|| other_match(&place, name).map(|other| meant_alone(option, name, &other)));
            pattern += &Pattern::escape(name);
            pattern += &piece[name.len()..];
        } else {
            pattern += piece;
        }
        place = place.join(piece);
    }
    (pattern, warning)
}

fn meant_alone(option: &str, name: &str, other: &str) -> String {
    format!(
        "{option}: {name} is the name of a file, so it is no pattern, and {other} is not read; fix: name {other} as well, or rename \
         {name}"
    )
}

/// Returns another name in `folder` that `name` matches as a pattern.
fn other_match(folder: &Path, name: &str) -> Option<String> {
    let pattern = Pattern::new(name).ok()?;
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let names = folder.read_dir().ok()?.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned());
    names.filter(|other| other != name && pattern.matches(other)).min()
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
    fn a_file_that_is_called_like_a_pattern_is_meant_alone() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["a[1].laz", "a1.laz", "b[.laz", "c*.laz"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        let pattern = |path: &str| as_pattern("[input] files", path, folder.path());
        for path in ["a1.laz", "a?.laz", "*.laz", "c[*].laz", "d[.laz"] {
            assert_eq!(pattern(path), (path.to_string(), None));
        }
        assert_eq!(pattern("b[.laz"), ("b[[].laz".to_string(), None));
        assert_eq!(pattern("c*.laz"), ("c[*].laz".to_string(), None));
        let (escaped, warning) = pattern("a[1].laz");
        assert_eq!(escaped, "a[[]1[]].laz");
        assert!(
            warning.unwrap().contains("a[1].laz is the name of a file, so it is no pattern, and a1.laz is not read")
        );
        // Folders too.
        std::fs::create_dir(folder.path().join("d [2]")).unwrap();
        assert_eq!(pattern("d [2]/*.laz"), ("d [[]2[]]/*.laz".to_string(), None));
        assert_eq!(pattern("**/d [2]/*.laz"), ("**/d [2]/*.laz".to_string(), None));
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
