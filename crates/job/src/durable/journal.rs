//! The journal of a job: a line for every finished step, with the places, sizes and hashes of what it wrote and its figures for the
//! report. An interrupted job goes on from its journal.
//!
//! A line is the XXH3 of its text, a blank, and the text, which is JSON. The first line is a header that says what the job is.
//! Everything from the first damaged line on counts as never written. The job says what its header, its steps (`S`) and its
//! records (`K`) are.

use crate::durable::atomic_file::{PendingFile, publish, write_pending_lines};
use crate::durable::committer::{CommitBatch, Committer};
use crate::durable::directory::JobDirectory;
use crate::durable::store::{RecordKey, RecordRef};
use serde::de::{DeserializeOwned, IgnoredAny};
use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;
use std::collections::{HashMap, HashSet};
use std::fmt::Debug;
use std::fs::File;
use std::hash::Hash;
use std::io::{BufRead, BufReader, ErrorKind};
use std::marker::PhantomData;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use sys::{Error, Result, fault, interrupt};
use tiles::checksums::Checksum;
use xxhash_rust::xxh3::xxh3_64;

/// What the job calls its steps.
pub trait StepKey: Copy + Debug + Eq + Hash + Send + Sync + Serialize + DeserializeOwned {}

/// What a finished step gives back.
#[derive(Debug)]
pub struct StepOutput<T, K> {
    /// Its figures for the report.
    pub stats: T,
    /// The records that it wrote for later steps.
    pub records: Vec<RecordRef<K>>,
    /// The results of the job that it wrote.
    pub files: Vec<PendingFile>,
}

impl<T, K> StepOutput<T, K> {
    /// The output of a step that writes no result of the job.
    pub fn new(stats: T, records: Vec<RecordRef<K>>) -> StepOutput<T, K> {
        StepOutput { stats, records, files: Vec::new() }
    }
}

/// A line of the journal: a finished step.
#[derive(Debug, Serialize, Deserialize)]
pub struct JournalEntry<S, K> {
    /// Which step.
    pub step: S,
    /// Its records in the store.
    pub records: Vec<RecordRef<K>>,
    /// Its results.
    pub files: Vec<PublishedFile>,
    stats: Box<RawValue>,
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

    fn is_at(&self, path: &Path) -> Result<bool> {
        match Checksum::of_file(path) {
            Ok(found) => Ok(found == (self.bytes, self.checksum)),
            Err(e) if e.kind() == ErrorKind::NotFound => Ok(false),
            Err(e) => Err(Error::io("read", path)(e)),
        }
    }
}

impl<S: StepKey, K: RecordKey> JournalEntry<S, K> {
    fn new<T: Serialize>(directory: &JobDirectory, step: S, output: &StepOutput<T, K>) -> Result<JournalEntry<S, K>> {
        let stats = serde_json::value::to_raw_value(&output.stats).map_err(unwritable)?;
        let files = output.files.iter().map(|file| PublishedFile::of(directory, file)).collect();
        Ok(JournalEntry { step, records: output.records.clone(), files, stats })
    }

    /// Returns the figures of the step.
    ///
    /// # Errors
    /// [`Error::Broken`] if they are those of another kind of step.
    pub fn stats<T: DeserializeOwned>(&self) -> Result<T> {
        figures(self.step, &self.stats)
    }
}

fn figures<T: DeserializeOwned>(step: impl Debug, stats: &RawValue) -> Result<T> {
    serde_json::from_str(stats.get()).map_err(|e| Error::Broken(format!("the journal: {step:?}: {e}")))
}

fn unwritable(error: serde_json::Error) -> Error {
    Error::Broken(format!("the journal cannot hold a finished step: {error}"))
}

/// Returns `value` as a line with its checksum.
fn to_line(value: &impl Serialize) -> Result<String> {
    let text = serde_json::to_string(value).map_err(unwritable)?;
    Ok(format!("{:016x} {text}\n", xxh3_64(text.as_bytes())))
}

/// Returns the value of a line, or `None` if the line is damaged.
fn parse_line<T: DeserializeOwned>(line: &str) -> Option<T> {
    let (hash, text) = line.strip_suffix('\n')?.split_once(' ')?;
    let is_whole = u64::from_str_radix(hash, 16) == Ok(xxh3_64(text.as_bytes()));
    is_whole.then(|| serde_json::from_str(text).ok())?
}

/// The lines of a journal up to the first damaged one, read one at a time: the journal of a large job has hundreds of megabytes.
struct JournalLines {
    path: PathBuf,
    reader: BufReader<File>,
    line: Vec<u8>,
}

impl JournalLines {
    /// Opens the journal that an earlier run left, if there is one.
    fn open(directory: &JobDirectory) -> Result<Option<JournalLines>> {
        const BUFFER: usize = 1 << 18;
        let path = directory.journal();
        match fault::read("read-journal").and_then(|()| File::open(&path)) {
            Err(e) if e.kind() == ErrorKind::NotFound => Ok(None),
            file => {
                let file = file.map_err(Error::io("read", &path))?;
                Ok(Some(JournalLines { path, reader: BufReader::with_capacity(BUFFER, file), line: Vec::new() }))
            }
        }
    }

    /// Returns the value of the next line, or `None` if there is none or it is damaged.
    fn next<T: DeserializeOwned>(&mut self) -> Result<Option<T>> {
        self.line.clear();
        self.reader.read_until(b'\n', &mut self.line).map_err(Error::io("read", &self.path))?;
        Ok(self.again())
    }

    /// Returns the value of the line that was read last.
    fn again<T: DeserializeOwned>(&self) -> Option<T> {
        std::str::from_utf8(&self.line).ok().and_then(parse_line)
    }
}

/// The journal that an earlier run left: its header, unless that is damaged or of another version, and its entries up to the first
/// damaged line.
pub type ReadJournal<H, S, K> = (Option<H>, Vec<JournalEntry<S, K>>);

/// Reads the journal that an earlier run left.
///
/// # Errors
/// [`Error::Io`] if there is one that cannot be read.
pub fn read<H, S, K>(directory: &JobDirectory) -> Result<Option<ReadJournal<H, S, K>>>
where
    H: DeserializeOwned,
    S: StepKey,
    K: RecordKey,
{
    read_with(directory, JournalLines::next)
}

/// The step of a line.
#[derive(Deserialize)]
struct StepOfLine<S> {
    step: S,
}

/// As [`read`], but returns only the entries of `wanted` steps. This is faster where there are many others.
///
/// # Errors
/// [`Error::Io`] if there is a journal that cannot be read.
pub fn read_steps<H, S, K>(directory: &JobDirectory, wanted: impl Fn(S) -> bool) -> Result<Option<ReadJournal<H, S, K>>>
where
    H: DeserializeOwned,
    S: StepKey,
    K: RecordKey,
{
    read_with(directory, |lines| {
        while let Some(StepOfLine { step }) = lines.next()? {
            if wanted(step) {
                return Ok(lines.again());
            }
        }
        Ok(None)
    })
}

/// Reads the header, and the entries that `next` returns, until it returns none.
fn read_with<H, S, K>(
    directory: &JobDirectory,
    mut next: impl FnMut(&mut JournalLines) -> Result<Option<JournalEntry<S, K>>>,
) -> Result<Option<ReadJournal<H, S, K>>>
where
    H: DeserializeOwned,
{
    let Some(mut lines) = JournalLines::open(directory)? else { return Ok(None) };
    let (header, mut entries) = (lines.next()?, Vec::new());
    while let Some(entry) = if header.is_some() { next(&mut lines)? } else { None } {
        entries.push(entry);
    }
    Ok(Some((header, entries)))
}

/// The step and the files of a line.
#[derive(Deserialize)]
struct FilesOfStep<S> {
    step: S,
    files: Vec<PublishedFile>,
}

/// Calls `visit` with the steps and the files of the journal that an earlier run left, up to the first damaged line.
///
/// # Errors
/// [`Error::Io`] if the journal cannot be read.
pub fn visit_files<H, S>(directory: &JobDirectory, mut visit: impl FnMut(S, Vec<PublishedFile>)) -> Result<()>
where
    H: DeserializeOwned,
    S: StepKey,
{
    let Some(mut lines) = JournalLines::open(directory)? else { return Ok(()) };
    if lines.next::<H>()?.is_some() {
        while let Some(FilesOfStep { step, files }) = lines.next()? {
            visit(step, files);
        }
    }
    Ok(())
}

/// The files of a line, whatever its step is.
#[derive(Deserialize)]
struct FilesOfLine {
    files: Vec<PublishedFile>,
}

/// Returns the names of all files in the journal that an earlier run left, up to the first damaged line.
///
/// # Errors
/// [`Error::Io`] if the journal cannot be read.
pub(crate) fn names_of_files(directory: &JobDirectory) -> Result<HashSet<PathBuf>> {
    let mut names = HashSet::new();
    let Some(mut lines) = JournalLines::open(directory)? else { return Ok(names) };
    if lines.next::<IgnoredAny>()?.is_some() {
        while let Some(FilesOfLine { files }) = lines.next()? {
            names.extend(files.into_iter().map(|file| file.name));
        }
    }
    Ok(names)
}

/// A position in the journal of a run: after a number of records. The default is the start.
#[derive(Clone, Copy, Debug, Default)]
pub struct JournalPosition(u64);

/// The journal of a run. Any thread may call its methods.
pub struct Journal<'a, S, K> {
    directory: &'a JobDirectory,
    /// The figures of the steps that an earlier run finished.
    taken_over: HashMap<S, Box<RawValue>>,
    /// The files of all steps that are finished, in the order in which they were recorded.
    files: Mutex<Vec<PublishedFile>>,
    committer: Committer,
    records: PhantomData<fn(K)>,
}

impl<'a, S: StepKey, K: RecordKey> Journal<'a, S, K> {
    /// Begins the journal of a run that takes over the steps of `entries` from an earlier one.
    ///
    /// # Errors
    /// [`Error::Io`] if the journal cannot be written.
    pub fn begin(
        directory: &'a JobDirectory,
        header: &impl Serialize,
        entries: Vec<JournalEntry<S, K>>,
    ) -> Result<Journal<'a, S, K>> {
        let path = directory.journal();
        write_pending_lines(&path, std::iter::once(to_line(header)).chain(entries.iter().map(to_line)))?;
        publish(std::slice::from_ref(&path))?;
        let (mut files, mut taken_over) = (Vec::new(), HashMap::with_capacity(entries.len()));
        for entry in entries {
            files.extend(entry.files);
            taken_over.insert(entry.step, entry.stats);
        }
        let (files, records) = (Mutex::new(files), PhantomData);
        Ok(Journal { directory, taken_over, files, committer: Committer::start(&path)?, records })
    }

    /// Tells whether an earlier run finished `step`.
    pub fn has(&self, step: S) -> bool {
        self.taken_over.contains_key(&step)
    }

    /// Returns the number of steps that earlier runs finished.
    pub fn taken_over(&self) -> u64 {
        self.taken_over.len() as u64
    }

    /// Returns the figures of `step`: those of an earlier run that finished it, or else those of `work`, which is then recorded.
    ///
    /// # Errors
    /// [`Error::Interrupted`], [`Error::Io`] on the journal, [`Error::Broken`] if the figures are those of another kind of step, and
    /// the errors of `work`.
    pub fn step<T, E>(
        &self,
        step: S,
        work: impl FnOnce() -> std::result::Result<StepOutput<T, K>, E>,
    ) -> std::result::Result<T, E>
    where
        T: Serialize + DeserializeOwned,
        E: From<Error>,
    {
        if let Some(stats) = self.taken_over.get(&step) {
            return Ok(figures(step, stats)?);
        }
        interrupt::check()?;
        Ok(self.record(step, work()?)?)
    }

    /// Records that `step` is finished and returns its figures. Its results get their names when the record is committed, which
    /// happens after a while or through [`Journal::commit`].
    ///
    /// # Errors
    /// [`Error::Io`] if an earlier record could not be committed.
    pub fn record<T: Serialize>(&self, step: S, output: StepOutput<T, K>) -> Result<T> {
        let entry = JournalEntry::new(self.directory, step, &output)?;
        self.files.lock().unwrap_or_else(PoisonError::into_inner).extend(entry.files.iter().cloned());
        let files = output.files.into_iter().map(|file| file.path).collect();
        self.committer.add(CommitBatch { lines: to_line(&entry)?, files })?;
        Ok(output.stats)
    }

    /// Returns the files of all steps that are finished, by name.
    pub fn files(&self) -> Vec<PublishedFile> {
        let mut files = self.files.lock().unwrap_or_else(PoisonError::into_inner).clone();
        files.sort_by(|a, b| a.name.cmp(&b.name));
        files
    }

    /// Waits until everything recorded is on the disk and all results have their names.
    ///
    /// # Errors
    /// [`Error::Io`] if that fails.
    pub fn commit(&self) -> Result<()> {
        self.committer.commit(self.committer.added())
    }

    /// Returns the position after the last record.
    pub fn position(&self) -> JournalPosition {
        JournalPosition(self.committer.added())
    }

    /// Waits until everything before `position` is on the disk.
    ///
    /// # Errors
    /// [`Error::Io`] if that fails.
    pub fn commit_to(&self, position: JournalPosition) -> Result<()> {
        self.committer.commit(position.0)
    }

    /// Tells whether the job has run for so long that it should not depend on what the system has yet to bring to the disk.
    pub fn is_worth_syncing(&self) -> bool {
        self.committer.is_worth_syncing()
    }

    /// Commits what can be committed, ends the journal and returns the number of finished steps in it.
    pub fn close(self) -> u64 {
        self.taken_over.len() as u64 + self.committer.close()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_damaged_line_has_no_value() {
        let whole = to_line(&("step", 7)).unwrap();
        assert_eq!(parse_line::<(String, u32)>(&whole), Some(("step".into(), 7)));
        for end in 0..whole.len() {
            assert_eq!(parse_line::<(String, u32)>(&whole[..end]), None, "{}", &whole[..end]);
        }
        assert_eq!(parse_line::<(String, u32)>(&whole.replace(",7]", ",8]")), None);
    }
}
