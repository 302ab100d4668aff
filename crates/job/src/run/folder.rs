//! The folder in which a part, or the nodes above the parts, keeps its journal and its store, while this process writes to it.

use crate::durable::directory::JobDirectory;
use crate::durable::lock::Lock;
use crate::index::PartIndex;
use crate::machine;
use crate::progress::clock::JobClock;
use crate::progress::stats::StageStats;
use crate::records::{JobStep, Journal, NewEntry, Store};
use crate::run::done::Done;
use crate::run::job::Job;
use crate::run::part_entries::{entry_of, open_store};
use crate::run::update::outdated::forget_from;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::sync::{Mutex, PoisonError};
use sys::Result;

/// A folder that this process writes to.
pub(crate) struct Folder<'a> {
    pub(crate) directory: &'a JobDirectory,
    pub(crate) store: Store,
    pub(crate) journal: Journal<'a>,
    clock: JobClock,
    syncs: bool,
    /// The key of the phase that is under way.
    key: u64,
    /// Held while changes of the store go to the journal: a line may have what another thread has just stored, whose line must come later.
    recording: Mutex<()>,
    _lock: Lock,
}

/// Returns the figures of `step` of `part`, or of the nodes above the parts, whose folder is `directory`. Unless they are there, and made with
/// what `key` tells from others, `work` does it and records it.
///
/// # Errors
/// Those of `work`; [`sys::Error::Io`] on the folder, [`crate::Error::InUse`] if another process has it.
pub(crate) fn once<T: DeserializeOwned>(
    job: &Job,
    directory: &JobDirectory,
    part: PartIndex,
    step: JobStep,
    key: u64,
    work: impl FnOnce(&Folder) -> crate::Result<T>,
) -> crate::Result<T> {
    // What is done needs no lock: another process may have it for a later phase.
    if let Some(done) = done_with(job, directory, part, step, key)? {
        return Ok(done);
    }
    let folder = Folder::open(job, directory, part)?.with_key(key);
    // Another process may have done it since.
    match folder.done(step)? {
        Some(done) => Ok(done),
        None => work(&folder),
    }
}

/// Returns the figures of `step` of `part`, or of the nodes above the parts, whose folder is `directory`, if it is complete. If it was done
/// with another key, takes it and what follows from it out of the journal.
///
/// # Errors
/// [`sys::Error::Io`] on the folder, [`crate::Error::InUse`] if another process has it.
pub(crate) fn done_with<T: DeserializeOwned>(
    job: &Job,
    directory: &JobDirectory,
    part: PartIndex,
    step: JobStep,
    key: u64,
) -> crate::Result<Option<T>> {
    let Some(entry) = entry_of(directory, job.header(part), step)? else { return Ok(None) };
    let done = entry.figures::<Done<T>>()?;
    if done.key == key {
        return Ok(Some(done.figures));
    }
    forget_from(job, directory, part, step)?;
    Ok(None)
}

impl<'a> Folder<'a> {
    /// Opens the folder `directory` of `part`, or of the nodes above the parts, to go on where its journal ends.
    ///
    /// # Errors
    /// [`sys::Error::Io`] on the folder, [`crate::Error::InUse`] if another process has it.
    pub(crate) fn open(job: &Job, directory: &'a JobDirectory, part: PartIndex) -> crate::Result<Folder<'a>> {
        let (clock, lock) = (JobClock::start(), directory.lock_within()?);
        let journal = Journal::go_on(directory, &job.header(part))?;
        let store = open_store(directory, journal.records())?;
        let (syncs, recording) = (job.syncs(), Mutex::default());
        Ok(Folder { directory, store, journal, clock, syncs, key: 0, recording, _lock: lock })
    }

    /// Returns the folder for a phase with this key.
    pub(crate) fn with_key(self, key: u64) -> Folder<'a> {
        Folder { key, ..self }
    }

    /// Returns the figures of `step`, if it is complete.
    ///
    /// # Errors
    /// [`sys::Error::Broken`] if they are not understood.
    pub(crate) fn done<T: DeserializeOwned>(&self, step: JobStep) -> Result<Option<T>> {
        Ok(self.journal.figures_of::<Done<T>>(step)?.map(|done| done.figures))
    }

    /// Returns what is to be recorded of a phase that is complete now: its figures, and what its stages took.
    pub(crate) fn done_now<T: Serialize>(&self, figures: T, stages: Vec<StageStats>) -> Done<T> {
        let (seconds, peak_memory) = (self.clock.wall_s(), machine::peak_memory());
        Done { figures, seconds, peak_memory, stages, key: self.key }
    }

    /// Records that `step` is complete: with its figures, what its stages took, and all changes of the store since the last record.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(crate) fn record<T: Serialize>(&self, step: JobStep, figures: T, stages: Vec<StageStats>) -> Result<T> {
        let _recording = self.recording.lock().unwrap_or_else(PoisonError::into_inner);
        let (done, changes) = (self.done_now(figures, stages), self.store.take_changes());
        let dropped = changes.dropped.clone();
        self.record_all(vec![NewEntry::new(step, &done, changes)?])?;
        self.store.give_back(&dropped)?;
        Ok(done.figures)
    }

    /// Records phases that are complete.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(crate) fn record_all(&self, entries: Vec<NewEntry>) -> Result<()> {
        if self.syncs {
            self.store.sync()?;
        }
        self.journal.record(entries)
    }
}
