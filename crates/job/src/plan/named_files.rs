//! The files that a pattern in the configuration names.

use glob::Pattern;
use points::not_a_file;
use std::collections::HashSet;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf, is_separator};
use sys::path_text::{decoded, encoded, is_pattern};
use sys::{Error, Result, interrupt};

/// What a pattern has for folders in folders, to any depth.
const ANY_DEPTH: &str = "**";

/// One name of a pattern, between two slashes.
enum Step {
    Name(OsString),
    Like(Pattern),
    AnyDepth,
}

/// Returns the files that match a pattern of the `option`, in the order of their names.
///
/// # Errors
/// [`Error::Config`] if it is no pattern or matches what is no file, [`Error::Io`] if a folder cannot be read.
pub(crate) fn files_of(pattern: &str, option: &str) -> Result<Vec<PathBuf>> {
    files_or_folders_of(pattern, option).map(|(files, _)| files)
}

/// As [`files_of`]. Where no file matches, also returns the folders that do.
///
/// # Errors
/// As [`files_of`].
pub(crate) fn files_or_folders_of(pattern: &str, option: &str) -> Result<(Vec<PathBuf>, Vec<PathBuf>)> {
    let refused = |what| match what {
        Error::Config(what) => Error::Config(format!("{option}: {what}")),
        error => error,
    };
    let (mut folders, mut files): (Vec<PathBuf>, Vec<PathBuf>) =
        paths_like(pattern).map_err(refused)?.into_iter().partition(|path| current_if_empty(path).is_dir());
    // A separator at the end means a folder.
    files.retain(|_| !pattern.ends_with(is_separator));
    folders.retain(|_| files.is_empty());
    match files.iter().find_map(|path| not_a_file(path)) {
        Some(what) => Err(Error::Config(format!("{option}: {what}"))),
        None => Ok((files, folders)),
    }
}

/// Returns the files and folders that match a pattern, in the order of their names.
///
/// # Errors
/// [`Error::Config`] if it is no pattern, [`Error::Io`] if a folder cannot be read.
pub fn paths_like(pattern: &str) -> Result<Vec<PathBuf>> {
    let (start, steps) = steps_of(pattern).map_err(|what| Error::Config(format!("{pattern}: {what}")))?;
    let mut search = Search::default();
    search.follow(start, &steps)?;
    Ok(search.found)
}

/// Splits a pattern into the folder where the search begins, empty for the current one, and the names that lead on from there.
fn steps_of(pattern: &str) -> std::result::Result<(PathBuf, Vec<Step>), String> {
    let root: PathBuf = Path::new(pattern).components().take_while(|part| !is_name(part)).collect();
    let names = pattern.get(root.as_os_str().len()..).unwrap_or_default();
    let names = names.split(is_separator).filter(|name| !["", "."].contains(name));
    let mut steps: Vec<Step> = names.map(step_of).collect::<std::result::Result<_, String>>()?;
    // Two in a row mean what one means.
    steps.dedup_by(|one, other| matches!((one, other), (Step::AnyDepth, Step::AnyDepth)));
    Ok((root, steps))
}

fn is_name(part: &std::path::Component<'_>) -> bool {
    !matches!(part, std::path::Component::Prefix(_) | std::path::Component::RootDir)
}

fn step_of(name: &str) -> std::result::Result<Step, String> {
    match name {
        ANY_DEPTH => Ok(Step::AnyDepth),
        _ if is_pattern(name) => Pattern::new(name).map(Step::Like).map_err(|e| no_pattern(&e)),
        _ => Ok(Step::Name(decoded(name))),
    }
}

fn no_pattern(error: &glob::PatternError) -> String {
    let hint =
        "there is no file of this name, and it is no pattern; in a pattern, [[] stands for [, [?] for ? and [*] for *";
    format!("{} ({hint})", error.msg)
}

/// A search for files, by the steps of a pattern.
#[derive(Default)]
struct Search {
    found: Vec<PathBuf>,
    /// The folders that were searched to any depth, without links, each with the number of steps after it. Links that lead back to them
    /// are not followed again, so every search ends.
    known: HashSet<(usize, PathBuf)>,
}

impl Search {
    /// Follows `steps` from what is at `path`.
    fn follow(&mut self, path: PathBuf, steps: &[Step]) -> Result<()> {
        interrupt::check()?;
        match steps {
            [] => self.found.push(path),
            [Step::Name(name), rest @ ..] => {
                let next = path.join(name);
                if next.symlink_metadata().is_ok() {
                    self.follow(next, rest)?;
                }
            }
            [Step::Like(pattern), rest @ ..] => {
                for (name, _) in entries_of(&path)?.iter().filter(|(name, _)| is_like(name, pattern)) {
                    self.follow(path.join(name), rest)?;
                }
            }
            [Step::AnyDepth, rest @ ..] => self.follow_to_any_depth(&path, rest)?,
        }
        Ok(())
    }

    /// Follows `steps` from the folder at `path` and from all folders in it.
    fn follow_to_any_depth(&mut self, path: &Path, steps: &[Step]) -> Result<()> {
        interrupt::check()?;
        let Ok(real) = current_if_empty(path).canonicalize() else { return Ok(()) };
        if !self.known.insert((steps.len(), real)) {
            return Ok(());
        }
        for (name, is_folder) in entries_of(path)? {
            let next = path.join(&name);
            match steps {
                [Step::Name(wanted), rest @ ..] if *wanted == name => self.follow(next.clone(), rest)?,
                [Step::Like(pattern), rest @ ..] if is_like(&name, pattern) => self.follow(next.clone(), rest)?,
                _ => {}
            }
            if is_folder && !leads_into_the_system(path, &next) {
                self.follow_to_any_depth(&next, steps)?;
            }
        }
        Ok(())
    }
}

/// Returns the names in the folder at `path`, in their order, and whether each is a folder or leads to one; none if it is no folder.
fn entries_of(path: &Path) -> Result<Vec<(OsString, bool)>> {
    let folder = current_if_empty(path);
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let mut entries = Vec::new();
    for entry in folder.read_dir().map_err(Error::io("read", folder))? {
        let entry = entry.map_err(Error::io("read", folder))?;
        let is_folder = match entry.file_type() {
            Ok(kind) if !kind.is_symlink() => kind.is_dir(),
            _ => entry.path().is_dir(),
        };
        entries.push((entry.file_name(), is_folder));
    }
    entries.sort_unstable();
    Ok(entries)
}

/// Returns a path that the system knows: an empty one is the current folder.
pub(crate) fn current_if_empty(path: &Path) -> &Path {
    if path.as_os_str().is_empty() { Path::new(".") } else { path }
}

/// Tells whether a name matches. In one that is not UTF-8, each sequence of bytes that is none stands for one sign.
fn is_like(name: &OsStr, pattern: &Pattern) -> bool {
    match name.to_str() {
        Some(name) => pattern.matches(name),
        None => pattern.matches(&name.to_string_lossy()) || pattern.matches(&encoded(name)),
    }
}

/// Tells whether the folder `next` in `folder` shows the state of the system, such as `/proc`, and holds no files that anybody stored.
#[cfg(target_os = "linux")]
fn leads_into_the_system(folder: &Path, next: &Path) -> bool {
    /// proc, sysfs, cgroup, cgroup2, debugfs, tracefs, securityfs, bpf, pstore, efivarfs, configfs, selinuxfs, devpts.
    const KINDS: [u32; 13] = [
        0x9fa0,
        0x6265_6572,
        0x0027_e0eb,
        0x6367_7270,
        0x6462_6720,
        0x7472_6163,
        0x7363_6673,
        0xcafe_4a11,
        0x6165_676c,
        0xde5e_81e4,
        0x6265_6570,
        0xf97c_ff8c,
        0x1cd1,
    ];
    let shows_state = |path: &Path| {
        rustix::fs::statfs(current_if_empty(path)).is_ok_and(|system| KINDS.contains(&(system.f_type as u32)))
    };
    shows_state(next) && !shows_state(folder)
}

#[cfg(not(target_os = "linux"))]
fn leads_into_the_system(_: &Path, _: &Path) -> bool {
    false
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use super::*;
    use std::fs;
    use std::os::unix::ffi::OsStrExt;
    use std::os::unix::fs::symlink;
    use sys::ErrorKind;

    /// Returns what a pattern below `root` names there.
    fn found(root: &Path, pattern: &str) -> Vec<String> {
        let files = files_of(&format!("{}/{pattern}", root.display()), "files").unwrap();
        files.iter().map(|file| encoded(file.strip_prefix(root).unwrap().as_os_str())).collect()
    }

    fn write(root: &Path, name: &[u8]) {
        let path = root.join(OsStr::from_bytes(name));
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, "").unwrap();
    }

    #[test]
    fn a_pattern_means_what_it_means_to_the_crate_glob() {
        let root = tempfile::tempdir().unwrap();
        for name in
            ["a/1.xyz", "a/2.laz", "a/b/1.xyz", "a/b/c/1.xyz", "a/b.xyz/3.xyz", "b/1.xyz", ".h/1.xyz", "1.xyz", "[.xyz"]
        {
            write(root.path(), name.as_bytes());
        }
        for pattern in [
            "*.xyz",
            "**/*.xyz",
            "**/1.xyz",
            "a/**/*",
            "*/1.xyz",
            "**/b/**/1.xyz",
            "**/**/c/*",
            "a/../b/*",
            "./a/*.xyz",
            "a//1.xyz",
            "[!b]/?.xyz",
            "[[].xyz",
            "**",
            "a/",
            "*/*",
            "a/**/b/1.xyz",
            "none/*.xyz",
            "1.xyz/*",
            "**/[ab]/1.*",
        ] {
            let pattern = format!("{}/{pattern}", root.path().display());
            let expected: Vec<PathBuf> =
                glob::glob(&pattern).unwrap().map(|path| path.unwrap()).filter(|path| !path.is_dir()).collect();
            assert_eq!(files_of(&pattern, "files").unwrap(), expected, "{pattern}");
        }
        let what = files_of("a[.laz", "files").unwrap_err();
        assert!(what.kind() == ErrorKind::Usage && what.to_string().contains("[[] stands for ["), "{what}");
    }

    #[test]
    fn names_that_are_not_utf8_are_found() {
        let root = tempfile::tempdir().unwrap();
        for name in [&b"Gel\xe4nde.xyz"[..], b"a.xyz", b"stra\xdfe/b.xyz", b"stra\xdfe/\xff.xyz"] {
            write(root.path(), name);
        }
        assert_eq!(found(root.path(), "*.xyz"), ["Gel\0e4nde.xyz", "a.xyz"]);
        assert_eq!(found(root.path(), "Gel?nde.xyz"), ["Gel\0e4nde.xyz"]);
        assert_eq!(found(root.path(), "*/*.xyz"), ["stra\0dfe/b.xyz", "stra\0dfe/\0ff.xyz"]);
        assert_eq!(found(root.path(), "**/b.xyz"), ["stra\0dfe/b.xyz"]);
        assert_eq!(found(root.path(), "stra\0dfe/b.xyz"), ["stra\0dfe/b.xyz"]);
        assert_eq!(found(root.path(), "stra[\0]df[e]/b.xyz"), ["stra\0dfe/b.xyz"]);
    }

    #[test]
    fn a_search_ends_though_links_lead_back() {
        let root = tempfile::tempdir().unwrap();
        write(root.path(), b"a/b/1.xyz");
        let folder = root.path().join("a/b");
        symlink("../../a", folder.join("0up")).unwrap();
        symlink(".", folder.join("0here")).unwrap();
        symlink("a", root.path().join("other")).unwrap();
        assert_eq!(found(root.path(), "**/*.xyz"), ["a/b/1.xyz"]);
        assert_eq!(found(root.path(), "**/*.laz"), [""; 0]);
        assert_eq!(found(root.path(), "other/**/*.xyz"), ["other/b/1.xyz"]);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_search_does_not_go_into_what_the_system_shows() {
        assert!(leads_into_the_system(Path::new("/"), Path::new("/proc")));
        assert!(!leads_into_the_system(Path::new("/proc"), Path::new("/proc/self")));
        assert!(!leads_into_the_system(Path::new("/"), Path::new("/tmp")));
    }
}
