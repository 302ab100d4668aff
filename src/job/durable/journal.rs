//! The journal of a job: a line for every finished step, with the places, sizes and hashes of what it left and the figures of
//! the report. A run that was interrupted is gone on with from here.
//!
//! A line is the XXH3 of the text after it, a blank, and that text, which is JSON. The first line says what the job is. What
//! follows the first line that is not whole was never written.

use crate::job::durable::committer::{Batch, Committer};
use crate::job::durable::directory::{self, Directory, Written};
use crate::job::durable::store::Stored;
use crate::job::plan::fingerprint::Head;
use crate::{Error, Result, interrupt};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;
use std::collections::HashMap;
use std::path::PathBuf;
use xxhash_rust::xxh3::xxh3_64;

/// A step of a job, by tile or node where it is called by one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Step {
    /// Step 2.
    Partition,
    /// Step 3 of a tile.
    Leaf(usize),
    /// Step 4 of an inner node.
    Node(usize),
    /// Step 5 of a tile.
    Stitch(usize),
    /// Step 6 of a tile.
    Export(usize),
    /// Step 7 of an inner node that viewers see.
    Level(usize),
    /// Step 8, but for the report.
    Finish,
    /// The report: the job is complete.
    Report,
}

/// What a step comes to.
#[derive(Debug)]
pub struct Done<T> {
    /// For the report.
    pub figures: T,
    /// What it has left for later steps.
    pub stored: Vec<Stored>,
    /// The results of the job that it has written.
    pub results: Vec<Written>,
}

impl<T> Done<T> {
    /// A step that writes no result of the job.
    pub fn new(figures: T, stored: Vec<Stored>) -> Done<T> {
        Done { figures, stored, results: Vec::new() }
    }
}

/// A line of the journal: a finished step.
#[derive(Debug, Serialize, Deserialize)]
pub struct Entry {
    /// Which step.
    pub step: Step,
    /// Its records in the store.
    pub stored: Vec<Stored>,
    /// Its results.
    pub results: Vec<Recorded>,
    figures: Box<RawValue>,
}

/// A result of the job as the journal knows it.
#[derive(Debug, Serialize, Deserialize)]
pub struct Recorded {
    /// Relative to the output directory.
    pub name: PathBuf,
    bytes: u64,
    hash: u64,
}

impl Recorded {
    /// Whether the file is there and holds what was written to it.
    pub fn is_whole(&self, directory: &Directory) -> bool {
        directory::digest(&directory.file(&self.name)).is_ok_and(|found| found == (self.bytes, self.hash))
    }
}

impl Entry {
    fn new<T: Serialize>(directory: &Directory, step: Step, done: &Done<T>) -> Result<Entry> {
        let record = |file: &Written| Recorded { name: directory.name(&file.path), bytes: file.bytes, hash: file.hash };
        let figures = serde_json::value::to_raw_value(&done.figures).map_err(unwritable)?;
        let (stored, results) = (done.stored.clone(), done.results.iter().map(record).collect());
        Ok(Entry { step, stored, results, figures })
    }

    /// The figures of its step.
    ///
    /// # Errors
    /// [`Error::Broken`] if they are those of another step.
    pub fn figures<T: DeserializeOwned>(&self) -> Result<T> {
        serde_json::from_str(self.figures.get())
            .map_err(|e| Error::Broken(format!("the journal: {:?}: {e}", self.step)))
    }
}

fn unwritable(error: serde_json::Error) -> Error {
    Error::Broken(format!("a finished step cannot be written down: {error}"))
}

/// A line with its checksum.
fn line(value: &impl Serialize) -> Result<String> {
    let text = serde_json::to_string(value).map_err(unwritable)?;
    Ok(format!("{:016x} {text}\n", xxh3_64(text.as_bytes())))
}

/// What a line says; `None` if it is not whole.
fn parse<T: DeserializeOwned>(line: &str) -> Option<T> {
    let (hash, text) = line.strip_suffix('\n')?.split_once(' ')?;
    let is_whole = u64::from_str_radix(hash, 16) == Ok(xxh3_64(text.as_bytes()));
    is_whole.then(|| serde_json::from_str(text).ok())?
}

/// The journal that an earlier run has left, as far as it is whole.
///
/// # Errors
/// [`Error::Io`] if there is one that cannot be read.
pub fn read(directory: &Directory) -> Result<Option<(Head, Vec<Entry>)>> {
    let path = directory.journal();
    let bytes = match std::fs::read(&path) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        outcome => outcome.map_err(Error::io("read", &path))?,
    };
    let text = String::from_utf8_lossy(&bytes);
    let mut lines = text.split_inclusive('\n');
    let head = lines.next().and_then(parse);
    Ok(head.map(|head| (head, lines.map_while(parse).collect())))
}

/// A place in the journal of a run: after so many records. The default is its start.
#[derive(Clone, Copy, Debug, Default)]
pub struct Mark(u64);

/// The journal of a run. Its methods may be called from any thread.
pub struct Journal<'a> {
    directory: &'a Directory,
    taken_over: HashMap<Step, Entry>,
    committer: Committer,
}

impl<'a> Journal<'a> {
    /// Begins the journal of a run that takes over the steps of `entries` from an earlier one.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be written.
    pub fn begin(directory: &'a Directory, head: &Head, entries: Vec<Entry>) -> Result<Journal<'a>> {
        let mut text = line(head)?;
        for entry in &entries {
            text += &line(entry)?;
        }
        let path = directory.journal();
        directory::write_result(&path, text.as_bytes())?;
        directory::publish(std::slice::from_ref(&path))?;
        let taken_over = entries.into_iter().map(|entry| (entry.step, entry)).collect();
        Ok(Journal { directory, taken_over, committer: Committer::start(&path)? })
    }

    /// Whether an earlier run has finished `step`.
    pub fn has(&self, step: Step) -> bool {
        self.taken_over.contains_key(&step)
    }

    /// How many steps earlier runs have finished.
    pub fn taken_over(&self) -> u64 {
        self.taken_over.len() as u64
    }

    /// The figures of `step`: those of an earlier run if it has finished the step, else `work` does it and is recorded.
    ///
    /// # Errors
    /// [`Error::Interrupted`], [`Error::Io`] on the journal, and what `work` returns.
    pub fn step<T>(&self, step: Step, work: impl FnOnce() -> Result<Done<T>>) -> Result<T>
    where
        T: Serialize + DeserializeOwned,
    {
        if let Some(entry) = self.taken_over.get(&step) {
            return entry.figures();
        }
        interrupt::check()?;
        self.record(step, work()?)
    }

    /// Records that `step` is finished; returns its figures. Its results get their names when the record is committed: after a
    /// while, or by [`Journal::commit`].
    ///
    /// # Errors
    /// [`Error::Io`] if an earlier record could not be committed.
    pub fn record<T: Serialize>(&self, step: Step, done: Done<T>) -> Result<T> {
        let entry = Entry::new(self.directory, step, &done)?;
        let results = done.results.into_iter().map(|file| file.path).collect();
        self.committer.add(Batch { lines: line(&entry)?, results })?;
        Ok(done.figures)
    }

    /// Waits until everything recorded is on the disk, results under their names.
    ///
    /// # Errors
    /// [`Error::Io`] if that fails.
    pub fn commit(&self) -> Result<()> {
        self.committer.commit(self.committer.added())
    }

    /// Where the journal is now.
    pub fn mark(&self) -> Mark {
        Mark(self.committer.added())
    }

    /// Waits until all before `mark` is on the disk.
    ///
    /// # Errors
    /// [`Error::Io`] if that fails.
    pub fn commit_to(&self, mark: Mark) -> Result<()> {
        self.committer.commit(mark.0)
    }

    /// Whether the job has run for so long that it should not depend on what the system has not brought to the disk yet.
    pub fn is_worth_syncing(&self) -> bool {
        self.committer.is_worth_syncing()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_that_is_not_whole_is_none() {
        let whole = line(&Step::Leaf(7)).unwrap();
        assert_eq!(parse::<Step>(&whole), Some(Step::Leaf(7)));
        for end in 0..whole.len() {
            assert_eq!(parse::<Step>(&whole[..end]), None, "{}", &whole[..end]);
        }
        assert_eq!(parse::<Step>(&whole.replace('7', "8")), None);
    }
}
