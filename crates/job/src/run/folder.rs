//! The folder in which a part, or the nodes above the parts, keeps its journal and its store, while this process writes to it.

use crate::durable::directory::JobDirectory;
use crate::durable::lock::Lock;
use crate::index::PartIndex;
use crate::machine;
use crate::progress::clock::JobClock;
use crate::progress::stats::StageStats;
use crate::records::{JobStep, Journal, JournalEntry, Store};
use crate::run::job::Job;
use crate::run::part_entries::Done;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::sync::{Mutex, PoisonError};
use sys::Result;

/// A folder that this process writes to.
pub(crate) struct Folder {
    pub(crate) directory: JobDirectory,
    pub(crate) store: Store,
    pub(crate) journal: Journal,
    clock: JobClock,
    syncs: bool,
    /// The key of the phase that is under way, with `--update`. Else 0.
    key: u64,
    /// Held while changes of the store go to the journal: a line may have what another thread has just stored, whose line must come later.
    recording: Mutex<()>,
    _lock: Lock,
}

/// Returns the figures of `step` of `part`, or of the nodes above the parts. Unless they are there, and made with what `key` tells from
/// others, `work` does it and records it.
///
/// # Errors
/// Those of `work`; [`sys::Error::Io`] on the folder, [`crate::Error::InUse`] if another process has it.
pub(crate) fn once<T: DeserializeOwned>(
    job: &Job,
    part: PartIndex,
    step: JobStep,
    key: u64,
    work: impl FnOnce(&Folder) -> crate::Result<T>,
) -> crate::Result<T> {
    // What is done needs no lock: another process may have it for a later phase.
    if let Some(done) = done_with(job, part, step, key)? {
        return Ok(done.figures);
    }
    let folder = Folder::open(job, part, key)?;
    // Another process may have done it since.
    match folder.done(step)? {
        Some(done) => Ok(done),
        None => work(&folder),
    }
}

/// Returns what is known of `step` of `part`, or of the nodes above the parts, if it is complete. If it was done with another key, takes it
/// and what follows from it out of the journal.
///
/// # Errors
/// [`sys::Error::Io`] on the folder, [`crate::Error::InUse`] if another process has it.
pub(crate) fn done_with<T: DeserializeOwned>(
    job: &Job,
    part: PartIndex,
    step: JobStep,
    key: u64,
) -> crate::Result<Option<Done<T>>> {
    match job.entries(part)?.done(step)? {
        Some(Done { key: other, .. }) if other != key => job.forget_from(part, step).map(|()| None),
        done => Ok(done),
    }
}

impl Folder {
    /// Opens the folder of `part`, or of the nodes above the parts, to go on where its journal ends, with a phase that has this key.
    ///
    /// # Errors
    /// [`sys::Error::Io`] on the folder, [`crate::Error::InUse`] if another process has it.
    pub(crate) fn open(job: &Job, part: PartIndex, key: u64) -> crate::Result<Folder> {
        let (clock, directory) = (JobClock::start(), job.folder(part));
        let lock = Lock::take_within(directory.job())?;
        let journal = Journal::go_on(&directory, &job.header(part))?;
        let store = Store::open(directory.store(), journal.records())?;
        let (syncs, recording) = (job.syncs(), Mutex::default());
        Ok(Folder { directory, store, journal, clock, syncs, key, recording, _lock: lock })
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
        self.record_all(vec![JournalEntry::new(step, &done, changes)?])?;
        self.store.give_back(&dropped)?;
        Ok(done.figures)
    }

    /// Records phases that are complete.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(crate) fn record_all(&self, entries: Vec<JournalEntry>) -> Result<()> {
        if self.syncs {
            self.store.sync()?;
        }
        self.journal.record(entries)
    }
}
