//! What identifies an input: whether a file is the one that an earlier run read, whatever it is called by now.

use points::samples::FileSamples;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, HashSet};
use std::path::{Path, PathBuf};
use std::time::SystemTime;
use sys::Result;

/// The inputs of a job in their order.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct InputIdentities(Vec<InputIdentity>);

/// How an input differs from what it was.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum InputChange {
    /// In nothing.
    Nothing,
    /// It was modified since, though samples of its content are the same.
    Time,
    /// In its content.
    Content,
}

/// What identifies an input file.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct InputIdentity {
    /// As messages and the report name it. It depends on the working directory.
    #[serde(with = "sys::path_text")]
    path: PathBuf,
    /// Its place, whatever the working directory, and however many links lead there. It changes with a folder that is moved.
    place: String,
    content: ContentIdentity,
}

/// What identifies the content of a file. With the same content the mesh is the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
struct ContentIdentity {
    #[serde(flatten)]
    samples: FileSamples,
    /// When it was written, in milliseconds since 1970; 0 for a file of another machine.
    modified: u64,
}

/// Returns the place of the file at `path`: the same for all paths that lead to it.
pub(crate) fn place(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_path_buf())
}

impl InputIdentities {
    /// Returns the identities of the files at `paths`.
    ///
    /// # Errors
    /// [`Error::Io`] if one cannot be read.
    pub(crate) fn of(paths: &[PathBuf]) -> Result<InputIdentities> {
        paths.par_iter().map(|path| InputIdentity::of(path)).collect::<Result<_>>().map(InputIdentities)
    }

    /// Returns what the files hold, as far as samples tell.
    pub(crate) fn samples(&self) -> Vec<FileSamples> {
        self.0.iter().map(|file| file.content.samples).collect()
    }

    /// Returns what the files hold, in their order, as far as sizes, samples and times tell: whoever edits a few bytes in place changes at
    /// least the time.
    pub(crate) fn text(&self) -> String {
        let text = |InputIdentity { content, .. }: &InputIdentity| {
            let ContentIdentity { samples: FileSamples { bytes, samples }, modified } = content;
            format!("{bytes} {samples:016x} {modified}\n")
        };
        self.0.iter().map(text).collect()
    }

    /// Returns the same without the times of the files.
    pub(crate) fn without_times(&self) -> InputIdentities {
        let without = |file: &InputIdentity| InputIdentity {
            content: ContentIdentity { modified: 0, ..file.content },
            ..file.clone()
        };
        InputIdentities(self.0.iter().map(without).collect())
    }

    /// Returns what tells the content of the file at `path` from others: its size, samples and time. `None` if it is none of these.
    pub(crate) fn content_of(&self, path: &Path) -> Option<[u64; 3]> {
        let file = self.0.iter().find(|file| file.path == path)?;
        let ContentIdentity { samples: FileSamples { bytes, samples }, modified } = file.content;
        Some([bytes, samples, modified])
    }

    /// Returns the names of the files that have changed since `earlier`; none if the files have the same contents in the same
    /// order.
    pub(crate) fn since(&self, earlier: &InputIdentities) -> Vec<String> {
        let contents = |files: &[InputIdentity]| files.iter().map(|file| file.content).collect::<Vec<_>>();
        let (known, present) = (contents(&earlier.0), contents(&self.0));
        if known == present {
            return Vec::new();
        }
        let [known, present] = [known, present].map(|contents| contents.into_iter().collect::<HashSet<_>>());
        let places = |files: &[InputIdentity]| files.iter().map(|file| file.place.clone()).collect::<HashSet<_>>();
        let (known_places, places) = (places(&earlier.0), places(&self.0));
        let change = |file: &InputIdentity| match (known.contains(&file.content), known_places.contains(&file.place)) {
            (true, _) => None,
            (false, true) => Some(file.path.display().to_string()),
            (false, false) => Some(format!("{} (new)", file.path.display())),
        };
        let is_gone = |file: &&InputIdentity| !present.contains(&file.content) && !places.contains(&file.place);
        let gone = earlier.0.iter().filter(is_gone).map(|file| format!("{} (gone)", file.path.display()));
        let changed: Vec<String> = self.0.iter().filter_map(change).chain(gone).collect();
        if changed.is_empty() { vec!["the order of the inputs".into()] } else { changed }
    }

    /// Returns what the inputs are called by now, if those at `paths` are as many, in the same order.
    pub(crate) fn present_names(&self, paths: &[PathBuf]) -> Option<RenamedInputs> {
        let pairs = self.0.iter().map(|file| &file.path).zip(paths);
        (self.0.len() == paths.len()).then(|| RenamedInputs::of_pairs(pairs))
    }

    /// Returns how the input that had the path `known` when the job was `begun` differs from what it was. It is at `path` now.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be read.
    pub(crate) fn change_of(&self, known: &Path, path: &Path, begun: SystemTime) -> Result<InputChange> {
        let samples = FileSamples::of(path)?;
        let mut known = self.0.iter().filter(|file| file.path == known);
        Ok(match known.find(|file| file.content.samples == samples) {
            None => InputChange::Content,
            Some(file) if file.content.is_modified(path, begun) => InputChange::Time,
            Some(_) => InputChange::Nothing,
        })
    }

    /// Returns the paths of those files that seem to have been modified since a job was `begun` with the files `planned`, which had the same
    /// contents in the same order.
    pub(crate) fn modified_since(&self, planned: &InputIdentities, begun: SystemTime) -> Vec<String> {
        let pairs = self.0.iter().zip(&planned.0);
        let modified = pairs.filter(|(now, planned)| planned.content.is_modified(&now.path, begun));
        modified.map(|(now, _)| now.path.display().to_string()).collect()
    }

    /// Returns the paths of those files that have another time, in whole seconds, than when they were `planned`, with the same contents in the
    /// same order.
    pub(crate) fn with_other_times(&self, planned: &InputIdentities) -> Vec<String> {
        let pairs = self.0.iter().zip(&planned.0);
        let others = pairs.filter(|(now, planned)| now.content.second() != planned.content.second());
        others.map(|(now, _)| now.path.display().to_string()).collect()
    }

    /// Returns what the inputs are called by now. They must have the same contents in the same order as `earlier`.
    pub(crate) fn renamed_since(&self, earlier: &InputIdentities) -> RenamedInputs {
        RenamedInputs::of_pairs(earlier.0.iter().zip(&self.0).map(|(old, new)| (&old.path, &new.path)))
    }
}

impl InputIdentity {
    fn of(path: &Path) -> Result<InputIdentity> {
        Ok(InputIdentity {
            path: path.to_path_buf(),
            place: place(path).to_string_lossy().into_owned(),
            content: ContentIdentity::of(path)?,
        })
    }
}

/// Inputs that have other paths than an earlier run knew: it had another working directory, or their folder has moved.
#[derive(Clone, Debug, Default)]
pub struct RenamedInputs(BTreeMap<PathBuf, PathBuf>);

impl RenamedInputs {
    /// Returns the inputs that have another path now, of pairs of an old one and the present one.
    pub(crate) fn of_pairs<'a>(pairs: impl Iterator<Item = (&'a PathBuf, &'a PathBuf)>) -> RenamedInputs {
        let changed = pairs.filter(|(old, new)| old != new);
        RenamedInputs(changed.map(|(old, new)| (old.clone(), new.clone())).collect())
    }

    /// Returns these and the others.
    pub(crate) fn and(mut self, others: RenamedInputs) -> RenamedInputs {
        self.0.extend(others.0);
        self
    }

    /// Changes the path of an input to the present one.
    pub(crate) fn rename(&self, path: &mut PathBuf) {
        if let Some(new) = self.0.get(path) {
            path.clone_from(new);
        }
    }

    /// Changes the path of an input in a sentence about it to the present one. A colon and a blank come after the path.
    pub(crate) fn rename_in(&self, text: &mut String) {
        let renamed = self.0.iter().find_map(|(old, new)| {
            let (old, new) = (format!("{}: ", old.display()), format!("{}: ", new.display()));
            let starts = text.strip_prefix(&old).map(|rest| format!("{new}{rest}"));
            starts.or_else(|| {
                text.contains(&format!(" {old}")).then(|| text.replace(&format!(" {old}"), &format!(" {new}")))
            })
        });
        if let Some(renamed) = renamed {
            *text = renamed;
        }
    }
}

impl ContentIdentity {
    fn of(path: &Path) -> Result<ContentIdentity> {
        let (samples, modified) = FileSamples::with_time(path)?;
        Ok(ContentIdentity { samples, modified })
    }

    /// Returns when it was written, in whole seconds since 1970: other machines may see other fractions.
    fn second(self) -> u64 {
        self.modified / 1_000
    }

    /// Tells whether the file, which is at `path` now, seems to have been modified since a job was `begun` with this content. Only a time after
    /// that counts: machines and file systems tell other times of the same file, but hardly a later one.
    fn is_modified(&self, path: &Path, begun: SystemTime) -> bool {
        let Some(now) = path.metadata().ok().and_then(|data| data.modified().ok()) else { return false };
        // With a clock that is ahead, a file has its time from the future at both times.
        let is_other = seconds(now) != self.second() || now.duration_since(begun).is_ok_and(|age| age.as_secs() == 0);
        now > begun && is_other
    }
}

/// Returns the whole seconds since 1970.
fn seconds(time: SystemTime) -> u64 {
    time.duration_since(SystemTime::UNIX_EPOCH).map_or(0, |age| age.as_secs())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    fn identities(files: &[(&str, u64)]) -> InputIdentities {
        let content = |samples| ContentIdentity { samples: FileSamples { bytes: 1, samples }, modified: 2 };
        let identity = |&(path, samples): &(&str, u64)| InputIdentity {
            path: path.into(),
            place: format!("/home/{path}"),
            content: content(samples),
        };
        InputIdentities(files.iter().map(identity).collect())
    }

    #[test]
    fn only_what_is_in_the_files_counts() {
        let now = identities(&[("a", 1), ("b", 2)]);
        assert!(now.since(&identities(&[("x/a", 1), ("y/b", 2)])).is_empty());
        assert_eq!(now.since(&identities(&[("b", 2), ("a", 1)])), ["the order of the inputs"]);
        assert_eq!(now.since(&identities(&[("a", 1), ("b", 3)])), ["b"]);
        assert_eq!(now.since(&identities(&[("a", 1), ("c", 3)])), ["b (new)", "c (gone)"]);
        assert_eq!(now.since(&identities(&[("x/a", 1)])), ["b (new)"]);
        assert_eq!(now.since(&identities(&[("a", 1), ("b", 2), ("b", 2)])), ["the order of the inputs"]);
    }

    #[test]
    fn sentences_name_files_by_their_present_paths() {
        let renamed = identities(&[("b", 1), ("a", 2)]).renamed_since(&identities(&[("a", 1), ("b", 2)]));
        let text = |text: &str| {
            let mut text = text.to_string();
            renamed.rename_in(&mut text);
            text
        };
        assert_eq!(text("a: line 3: a word"), "b: line 3: a word");
        assert_eq!(text("2 of 3 are malformed: b: line 1; b: line 2"), "2 of 3 are malformed: a: line 1; a: line 2");
        assert_eq!(text("x/a: line 3"), "x/a: line 3");
        let mut path = PathBuf::from("b");
        renamed.rename(&mut path);
        assert_eq!(path, Path::new("a"));
    }

    #[test]
    fn only_a_time_after_the_plan_tells_of_an_edit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cloud.csv");
        std::fs::write(&path, "1,2,3\n").unwrap();
        let begun = SystemTime::UNIX_EPOCH + Duration::from_secs(1_700_000_000);
        let at = |time: SystemTime| {
            let file = std::fs::File::options().write(true).open(&path).unwrap();
            file.set_modified(time).unwrap();
            ContentIdentity::of(&path).unwrap()
        };
        let (second, year) = (Duration::from_secs(1), Duration::from_secs(31_536_000));
        for (planned, now, is_modified) in [
            (begun - year, begun - year, false),
            // Another machine, or a copy from before.
            (begun - year, begun - second, false),
            (begun - year, begun + year, true),
            (begun - second / 2, begun + second / 2, true),
            // The plan and the edit are in one second.
            (begun, begun + second / 4, true),
            // A clock that was ahead wrote the file.
            (begun + year, begun + year, false),
            (begun + year, begun + year + second, true),
        ] {
            let planned = at(planned);
            at(now);
            assert_eq!(planned.is_modified(&path, begun), is_modified, "{planned:?} {now:?}");
        }
    }
}
