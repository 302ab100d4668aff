//! The journal of a job, or of a part of it: what every phase that is complete has changed in the store, the sizes and checksums of its
//! results, and its figures. An interrupted job goes on from its journals.
//!
//! A line is the XXH3 of its text, a blank, and the text, which is JSON. The first line is a header that says what the job is. Each of the
//! others has the phases that became complete at one time.
//! Everything from the first damaged line on counts as never written. The job says what its header, its phases (`S`) and its
//! records (`K`) are.

use crate::durable::atomic_file::{PendingFile, PendingWriter, publish};
use crate::durable::directory::JobDirectory;
use crate::durable::store::{RecordChanges, RecordKey, RecordRef};
use serde::de::{DeserializeOwned, IgnoredAny};
use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;
use std::collections::{HashMap, HashSet};
use std::fmt::Debug;
use std::fs::File;
use std::hash::Hash;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use sys::disk::WriteFrom;
use sys::{Error, Result, disk, fault, interrupt};
use tiles::checksums::Checksum;
use xxhash_rust::xxh3::xxh3_64;

/// What the job calls its phases.
pub trait StepKey: Copy + Debug + Eq + Hash + Send + Sync + Serialize + DeserializeOwned {}

/// A phase that is complete.
#[derive(Debug, Serialize, Deserialize)]
#[serde(bound(serialize = "S: Serialize, K: Serialize", deserialize = "S: DeserializeOwned, K: DeserializeOwned"))]
pub struct JournalEntry<S, K> {
    /// Which phase.
    pub step: S,
    /// What it has changed in the store.
    pub changes: RecordChanges<K>,
    /// Its results.
    pub files: Vec<PublishedFile>,
    figures: Box<RawValue>,
}

/// A published file as the journal knows it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PublishedFile {
    /// Its path from the output directory.
    pub name: PathBuf,
    bytes: u64,
    /// The checksum of its content.
    pub checksum: Checksum,
}

impl PublishedFile {
    /// Returns what the journal keeps of a pending file.
    pub fn of(directory: &JobDirectory, file: &PendingFile) -> PublishedFile {
        PublishedFile { name: directory.name(&file.path), bytes: file.bytes, checksum: file.checksum }
    }

    /// Tells whether the file exists and holds what was written.
    pub fn is_whole(&self, directory: &JobDirectory) -> bool {
        self.try_is_whole(directory).unwrap_or(false)
    }

    /// As [`PublishedFile::is_whole`], where a read that fails must not pass for a file that is gone.
    ///
    /// # Errors
    /// [`Error::Io`] if the file is there and cannot be read.
    pub fn try_is_whole(&self, directory: &JobDirectory) -> Result<bool> {
        self.is_at(&directory.file(&self.name))
    }

    /// Tells whether the file is whole among the results of a finished job.
    pub fn is_in_place(&self, directory: &JobDirectory) -> bool {
        self.is_at(&directory.results().directory().join(&self.name)).unwrap_or(false)
    }

    /// Tells whether `content` is what was written.
    pub(crate) fn holds(&self, content: &[u8]) -> bool {
        (content.len() as u64, Checksum::of(content)) == (self.bytes, self.checksum)
    }

    fn is_at(&self, path: &Path) -> Result<bool> {
        match Checksum::of_file(path) {
            Ok(found) => Ok(found == (self.bytes, self.checksum)),
            Err(e) if e.kind() == ErrorKind::NotFound => Ok(false),
            Err(e) => Err(Error::io("read", path)(e)),
        }
    }
}

impl<S: StepKey, K: RecordKey> JournalEntry<S, K> {
    /// Returns the entry of `step` with its figures and what it has changed in the store.
    ///
    /// # Errors
    /// [`Error::Broken`] if the figures cannot be written down.
    pub fn new(step: S, figures: &impl Serialize, changes: RecordChanges<K>) -> Result<JournalEntry<S, K>> {
        let figures = serde_json::value::to_raw_value(figures).map_err(unwritable)?;
        Ok(JournalEntry { step, changes, files: Vec::new(), figures })
    }

    /// Returns the entry with other figures.
    ///
    /// # Errors
    /// [`Error::Broken`] if the figures cannot be written down.
    pub fn with_figures(self, figures: &impl Serialize) -> Result<JournalEntry<S, K>> {
        Ok(JournalEntry { figures: serde_json::value::to_raw_value(figures).map_err(unwritable)?, ..self })
    }

    /// Returns the figures of the phase.
    ///
    /// # Errors
    /// [`Error::Broken`] if they are those of another kind of phase.
    pub fn figures<T: DeserializeOwned>(&self) -> Result<T> {
        serde_json::from_str(self.figures.get())
            .map_err(|e| Error::Broken(format!("the journal: {:?}: {e}", self.step)))
    }
}

/// Returns the records that are there after these phases.
pub fn records_of<'a, S: 'a, K: RecordKey + 'a>(
    entries: impl IntoIterator<Item = &'a JournalEntry<S, K>>,
) -> HashMap<K, RecordRef<K>> {
    let mut records = HashMap::new();
    for JournalEntry { changes, .. } in entries {
        changes.dropped.iter().for_each(|record| _ = records.remove(&record.key()));
        records.extend(changes.written.iter().map(|record| (record.key(), *record)));
    }
    records
}

fn unwritable(error: serde_json::Error) -> Error {
    Error::Broken(format!("the journal cannot hold a phase: {error}"))
}

/// Returns `value` as a line with its checksum.
fn to_line(value: &impl Serialize) -> Result<String> {
    let text = serde_json::to_string(value).map_err(unwritable)?;
    Ok(format!("{:016x} {text}\n", xxh3_64(text.as_bytes())))
}

/// Returns the value of a line, or `None` if the line is damaged.
fn parse_line<T: DeserializeOwned>(line: &[u8]) -> Option<T> {
    let (hash, text) = std::str::from_utf8(line).ok()?.strip_suffix('\n')?.split_once(' ')?;
    let is_whole = u64::from_str_radix(hash, 16) == Ok(xxh3_64(text.as_bytes()));
    is_whole.then(|| serde_json::from_str(text).ok())?
}

/// The journal that an earlier run left: its header, unless that is damaged or of another version, its entries up to the first damaged line,
/// and the number of bytes before that line.
pub type ReadJournal<H, E> = (Option<H>, Vec<E>, u64);

/// Reads the journal that an earlier run left, with entries of type `E`.
///
/// # Errors
/// [`Error::Io`] if there is one that cannot be read.
pub fn read<H: DeserializeOwned, E: DeserializeOwned>(directory: &JobDirectory) -> Result<Option<ReadJournal<H, E>>> {
    let path = directory.journal();
    let text = match fault::read("read-journal").and_then(|()| std::fs::read(&path)) {
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(None),
        text => text.map_err(Error::io("read", &path))?,
    };
    let mut lines = text.split_inclusive(|byte| *byte == b'\n');
    let first = lines.next().unwrap_or_default();
    let (header, mut entries, mut end) = (parse_line(first), Vec::new(), first.len() as u64);
    for line in lines.take_while(|_| header.is_some()) {
        let Some(mut complete) = parse_line::<Vec<E>>(line) else { break };
        entries.append(&mut complete);
        end += line.len() as u64;
    }
    Ok(Some((header, entries, end)))
}

/// The files of an entry.
#[derive(Deserialize)]
struct FilesOfStep {
    files: Vec<PublishedFile>,
}

/// Returns the names of the files in all journals that an earlier run left, in each up to the first damaged line.
///
/// # Errors
/// [`Error::Io`] if a journal cannot be read.
pub(crate) fn names_of_files(directory: &JobDirectory) -> Result<HashSet<PathBuf>> {
    let mut names = HashSet::new();
    for folder in [vec![directory.clone()], directory.folders_of_parts()?].concat() {
        let entries = read::<IgnoredAny, FilesOfStep>(&folder)?.map(|(_, entries, _)| entries);
        names.extend(entries.into_iter().flatten().flat_map(|entry| entry.files).map(|file| file.name));
    }
    Ok(names)
}

/// Returns the names and checksums of the results among `files`, in the order of their names, with slashes on every system.
pub(crate) fn listed(directory: &JobDirectory, mut files: Vec<PublishedFile>) -> Vec<(String, Checksum)> {
    files.retain(|file| directory.is_result(&file.name));
    files.sort_by(|a, b| a.name.cmp(&b.name));
    let slashed = |name: &Path| name.iter().map(|part| part.to_string_lossy()).collect::<Vec<_>>().join("/");
    files.into_iter().map(|file| (slashed(&file.name), file.checksum)).collect()
}

/// The journal of a run. Any thread may call its methods.
pub struct Journal<S, K> {
    directory: JobDirectory,
    state: Mutex<JournalState<S, K>>,
}

struct JournalState<S, K> {
    /// The phases that are complete.
    entries: Vec<JournalEntry<S, K>>,
    /// The results of the phase that is under way. Those from `named` on are still to get their names.
    files: Vec<PublishedFile>,
    named: usize,
    file: File,
    end: u64,
}

impl<S: StepKey, K: RecordKey> Journal<S, K> {
    /// Begins a journal that has these `entries` already.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be written.
    pub fn begin(
        directory: &JobDirectory,
        header: &impl Serialize,
        entries: Vec<JournalEntry<S, K>>,
    ) -> Result<Journal<S, K>> {
        let path = directory.journal();
        let mut writer = PendingWriter::create(&path)?;
        writer.write(to_line(header)?.as_bytes())?;
        entries.iter().try_for_each(|entry| writer.write(to_line(&[entry])?.as_bytes()))?;
        let end = writer.finish()?.bytes;
        publish(std::slice::from_ref(&path))?;
        let file = disk::open(&path).map_err(Error::io("open", &path))?;
        Ok(Journal::open(directory, entries, file, end))
    }

    /// Goes on with the journal in `directory`, or begins one if that is not the journal of `header`.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be read or written.
    pub fn go_on<H>(directory: &JobDirectory, header: &H) -> Result<Journal<S, K>>
    where
        H: Serialize + DeserializeOwned + PartialEq,
    {
        let read = read::<H, JournalEntry<S, K>>(directory)?.filter(|(found, ..)| found.as_ref() == Some(header));
        let Some((_, entries, end)) = read else { return Journal::begin(directory, header, Vec::new()) };
        let path = directory.journal();
        let file = disk::open(&path).map_err(Error::io("open", &path))?;
        // A kill may have cut the last line off.
        disk::set_length(&file, end).map_err(Error::io("write", &path))?;
        Ok(Journal::open(directory, entries, file, end))
    }

    fn open(directory: &JobDirectory, entries: Vec<JournalEntry<S, K>>, file: File, end: u64) -> Journal<S, K> {
        let state = JournalState { entries, files: Vec::new(), named: 0, file, end };
        Journal { directory: directory.clone(), state: Mutex::new(state) }
    }

    /// Returns the records that are there after all phases.
    pub fn records(&self) -> Vec<RecordRef<K>> {
        records_of(&self.state().entries).into_values().collect()
    }

    fn state(&self) -> MutexGuard<'_, JournalState<S, K>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the figures of `step`, if it is complete.
    ///
    /// # Errors
    /// As [`JournalEntry::figures`].
    pub fn figures_of<T: DeserializeOwned>(&self, step: S) -> Result<Option<T>> {
        self.state().entries.iter().find(|entry| entry.step == step).map(JournalEntry::figures).transpose()
    }

    /// Returns the number of phases that are complete.
    pub fn complete(&self) -> u64 {
        self.state().entries.len() as u64
    }

    /// Returns the figures of `step`: those that the journal has, or else those of `work`, which is then recorded with the files that it
    /// returns.
    ///
    /// # Errors
    /// [`Error::Interrupted`], [`Error::Io`] on the journal, [`Error::Broken`] if the figures are those of another kind of phase, and
    /// the errors of `work`.
    pub fn step<T, E>(
        &self,
        step: S,
        work: impl FnOnce() -> std::result::Result<(T, Vec<PendingFile>), E>,
    ) -> std::result::Result<T, E>
    where
        T: Serialize + DeserializeOwned,
        E: From<Error>,
    {
        if let Some(figures) = self.figures_of(step)? {
            return Ok(figures);
        }
        interrupt::check()?;
        let (figures, files) = work()?;
        self.add_files(&files);
        self.record(vec![JournalEntry::new(
            step,
            &figures,
            RecordChanges { written: Vec::new(), dropped: Vec::new() },
        )?])?;
        Ok(figures)
    }

    /// Adds results of the phase that is under way.
    pub fn add_files(&self, files: &[PendingFile]) {
        self.state().files.extend(files.iter().map(|file| PublishedFile::of(&self.directory, file)));
    }

    /// Gives the results so far their names, once they are on the disk.
    ///
    /// # Errors
    /// [`Error::Io`] if that fails.
    pub fn name_files(&self) -> Result<()> {
        let mut state = self.state();
        let paths: Vec<PathBuf> =
            state.files[state.named..].iter().map(|file| self.directory.file(&file.name)).collect();
        fault::point("commit");
        publish(&paths)?;
        fault::point("published");
        state.named = state.files.len();
        Ok(())
    }

    /// Records phases that are complete. The results since the last record are those of the last of them; they get their names. The line is
    /// on the disk when this returns.
    ///
    /// # Errors
    /// [`Error::Io`] if that fails.
    pub fn record(&self, mut entries: Vec<JournalEntry<S, K>>) -> Result<()> {
        self.name_files()?;
        let mut state = self.state();
        state.named = 0;
        if let Some(last) = entries.last_mut() {
            last.files = std::mem::take(&mut state.files);
        }
        let line = to_line(&entries)?;
        if fault::is_due("torn") {
            // What a power failure may leave of it.
            let _ = state.append(&line[..line.len() / 2]);
            fault::die();
        }
        state.append(&line).map_err(Error::io("write", &self.directory.journal()))?;
        state.entries.extend(entries);
        fault::point("committed");
        Ok(())
    }

    /// Returns the results of all phases that are complete.
    pub fn files(&self) -> Vec<PublishedFile> {
        self.state().entries.iter().flat_map(|entry| &entry.files).cloned().collect()
    }
}

impl<S, K> JournalState<S, K> {
    /// Appends text and waits until it is on the disk.
    fn append(&mut self, text: &str) -> std::io::Result<()> {
        let mut writer = WriteFrom { file: &self.file, at: self.end };
        writer.write_all(text.as_bytes())?;
        self.end = writer.at;
        disk::sync_data(&self.file)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_damaged_line_has_no_value() {
        let whole = to_line(&("step", 7)).unwrap();
        assert_eq!(parse_line::<(String, u32)>(whole.as_bytes()), Some(("step".into(), 7)));
        for end in 0..whole.len() {
            assert_eq!(parse_line::<(String, u32)>(&whole.as_bytes()[..end]), None, "{}", &whole[..end]);
        }
        assert_eq!(parse_line::<(String, u32)>(whole.replace(",7]", ",8]").as_bytes()), None);
    }
}
