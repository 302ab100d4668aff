//! The journal and the store of a part, or of the nodes above the parts.

use crate::Result;
use crate::job::durable::directory::JobDirectory;
use crate::job::durable::lock::Lock;
use crate::job::records::{Journal, JournalEntry, Store};
use crate::job::run::part_entries::{PartHeader, open_store, records_of};
use crate::job::run::run_context::RunContext;
use crate::job::run::temporary_bytes::TemporaryBytes;
use std::sync::Mutex;

/// A folder of steps that this process writes to.
pub(crate) struct PartSession<'a> {
    pub(crate) directory: &'a JobDirectory,
    pub(crate) store: Store,
    pub(crate) journal: Journal<'a>,
    _lock: Lock,
}

impl<'a> PartSession<'a> {
    /// Goes on from `entries`, whose records are whole.
    ///
    /// # Errors
    /// [`crate::Error::Io`] on the folder, [`crate::Error::InUse`] if another process has it.
    pub(crate) fn begin(
        directory: &'a JobDirectory,
        header: PartHeader,
        entries: Vec<JournalEntry>,
    ) -> Result<PartSession<'a>> {
        let lock = directory.lock()?;
        let records = records_of(&entries);
        let journal = Journal::begin(directory, &header, entries)?;
        Ok(PartSession { directory, store: open_store(directory, &records)?, journal, _lock: lock })
    }

    /// Returns the context of steps in this folder.
    pub(crate) fn context<'s>(&'s self, run: &RunContext<'s>) -> RunContext<'s>
    where
        'a: 's,
    {
        RunContext {
            triangulator: run.triangulator,
            directory: self.directory,
            store: &self.store,
            journal: &self.journal,
            progress: run.progress,
            threads: run.threads,
            clock: run.clock,
            inputs_fingerprint: String::new(),
            job_id: run.job_id,
            resumed: run.resumed,
            temporary: TemporaryBytes::default(),
            stages: Mutex::default(),
        }
    }

    /// Ends the session once the journal has all of it.
    ///
    /// # Errors
    /// [`crate::Error::Io`].
    pub(crate) fn end(self) -> Result<()> {
        self.journal.commit()?;
        self.journal.close();
        Ok(())
    }
}
