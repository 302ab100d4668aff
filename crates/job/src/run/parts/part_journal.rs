//! The journal and the store of a part, or of the nodes above the parts.

use crate::durable::directory::JobDirectory;
use crate::durable::lock::Lock;
use crate::machine;
use crate::plan::fingerprint::JobIdentity;
use crate::progress::clock::JobClock;
use crate::progress::stats::StageStats;
use crate::records::{JobStep, Journal, JournalEntry, RecordRef, StepOutput, Store};
use crate::run::part_entries::{PartHeader, open_store, records_of};
use crate::run::parts::done::Done;
use crate::run::parts::parts_job::PartsJob;
use crate::run::run_context::RunContext;
use crate::run::temporary_bytes::TemporaryBytes;
use serde::Serialize;
use std::sync::Mutex;
use sys::Result;

/// A folder of steps that this process writes to.
pub(crate) struct PartSession<'a> {
    pub(crate) directory: &'a JobDirectory,
    pub(crate) store: Store,
    pub(crate) journal: Journal<'a>,
    clock: JobClock,
    _lock: Lock,
}

impl<'a> PartSession<'a> {
    /// Goes on from `entries`, whose records are whole, in the locked `directory`.
    ///
    /// # Errors
    /// [`sys::Error::Io`] on the folder.
    pub(crate) fn begin(
        directory: &'a JobDirectory,
        lock: Lock,
        header: PartHeader,
        entries: Vec<JournalEntry>,
    ) -> crate::Result<PartSession<'a>> {
        let clock = JobClock::start();
        let records = records_of(&entries);
        let journal = Journal::begin(directory, &header, entries)?;
        Ok(PartSession { directory, store: open_store(directory, &records)?, journal, clock, _lock: lock })
    }

    /// Returns the context of steps in this folder.
    pub(crate) fn context<'s>(&'s self, job: &PartsJob<'s>) -> RunContext<'s>
    where
        'a: 's,
    {
        RunContext {
            triangulator: job.triangulator,
            directory: self.directory,
            store: &self.store,
            journal: &self.journal,
            progress: job.progress,
            threads: job.threads,
            clock: job.clock,
            begun: None,
            identity: JobIdentity::default(),
            job_id: job.job_id,
            resumed: job.resumed,
            is_by_tasks: false,
            temporary: TemporaryBytes::default(),
            stages: Mutex::default(),
        }
    }

    /// Ends the session with `step`, which says that a phase is complete: with its figures, what its stages took, and records that others
    /// read. Everything is on the disk before, so nobody has to check it.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(crate) fn finish<T: Serialize>(
        self,
        step: JobStep,
        figures: T,
        stages: Vec<StageStats>,
        records: Vec<RecordRef>,
    ) -> Result<T> {
        self.journal.commit()?;
        self.store.sync()?;
        let (seconds, peak_memory) = (self.clock.wall_s(), machine::peak_memory());
        let done = Done { figures, seconds, peak_memory, stages };
        let done = self.journal.record(step, StepOutput::new(done, records))?;
        self.end()?;
        Ok(done.figures)
    }

    /// Ends the session once the journal has all of it.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(crate) fn end(self) -> Result<()> {
        self.journal.commit()?;
        self.journal.close();
        Ok(())
    }
}
