//! What the journals of parts say, and opening the stores that they describe.

use crate::durable::directory::{JobDirectory, STORE_FILES};
use crate::durable::journal;
use crate::durable::journal::PublishedFile;
use crate::index::PartIndex;
use crate::records::{JobStep, JournalEntry, RecordRef, StepRecord, Store};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use sys::Result;

/// The first line of the journal of a part. The nodes above the parts have the number after the last part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct PartHeader {
    /// The run that began the job.
    pub(crate) job: u64,
    pub(crate) part: PartIndex,
}

/// Returns the entries of the journal in `directory` if it is that of `header`.
///
/// # Errors
/// [`sys::Error::Io`] if it cannot be read.
pub(crate) fn entries_of(directory: &JobDirectory, header: PartHeader) -> Result<Vec<JournalEntry>> {
    // Another machine may have written it.
    directory.probe()?;
    let read = journal::read::<PartHeader, JobStep, StepRecord>(directory)?;
    let own = read.filter(|(found, _)| *found == Some(header));
    Ok(own.map(|(_, entries)| entries).unwrap_or_default())
}

/// Returns the entry of `step` in the journal in `directory` if it is that of `header`, and has one.
///
/// # Errors
/// As [`entries_of`].
pub(crate) fn entry_of(directory: &JobDirectory, header: PartHeader, step: JobStep) -> Result<Option<JournalEntry>> {
    Ok(entries_of(directory, header)?.into_iter().find(|entry| entry.step == step))
}

/// The journals of all parts of a job, and of the nodes above them.
#[derive(Default)]
pub(crate) struct PartJournals(pub(crate) Vec<(JobDirectory, PartHeader, Vec<JournalEntry>)>);

impl PartJournals {
    /// Reads those of the job with the number `job`.
    ///
    /// # Errors
    /// [`sys::Error::Io`] if one cannot be read.
    pub(crate) fn of(directory: &JobDirectory, job: u64) -> Result<PartJournals> {
        let mut journals = Vec::new();
        for folder in directory.folders_of_parts()? {
            folder.probe()?;
            let read = journal::read::<PartHeader, JobStep, StepRecord>(&folder)?;
            if let Some((Some(header), entries)) = read.filter(|(found, _)| found.is_some_and(|found| found.job == job))
            {
                journals.push((folder, header, entries));
            }
        }
        Ok(PartJournals(journals))
    }

    /// Returns the number of phases that are complete.
    pub(crate) fn len(&self) -> u64 {
        self.0.iter().map(|(_, _, entries)| entries.len() as u64).sum()
    }

    /// Returns the results that they name.
    pub(crate) fn files(&self) -> impl Iterator<Item = &PublishedFile> {
        self.0.iter().flat_map(|(_, _, entries)| entries).flat_map(|entry| &entry.files)
    }
}

/// Opens the store in `directory` with these records.
///
/// # Errors
/// [`sys::Error::Io`].
pub(crate) fn open_store(directory: &JobDirectory, records: impl IntoIterator<Item = RecordRef>) -> Result<Store> {
    let paths: [PathBuf; STORE_FILES] = directory.store();
    Store::open(paths, records)
}
