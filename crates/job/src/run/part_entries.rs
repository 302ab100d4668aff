//! What the journals of parts say, and opening the stores that they describe.

use crate::durable::directory::{JobDirectory, STORE_FILES};
use crate::durable::journal;
use crate::durable::journal::PublishedFile;
use crate::index::PartIndex;
use crate::records::{JobStep, Journal, JournalEntry, RecordRef, StepRecord, Store};
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
    entries_if(directory, |found| found == header)
}

/// Returns those entries of the journal in `directory` that are of `wanted` steps, if it is the journal of `header`.
///
/// # Errors
/// [`sys::Error::Io`] if it cannot be read.
pub(crate) fn entries_of_steps(
    directory: &JobDirectory,
    header: PartHeader,
    wanted: impl Fn(JobStep) -> bool,
) -> Result<Vec<JournalEntry>> {
    // Another machine may have written it.
    directory.probe()?;
    let read = journal::read_steps::<PartHeader, JobStep, StepRecord>(directory, wanted)?;
    let own = read.filter(|(found, _)| *found == Some(header));
    Ok(own.map(|(_, entries)| entries).unwrap_or_default())
}

fn entries_if(directory: &JobDirectory, is_wanted: impl Fn(PartHeader) -> bool) -> Result<Vec<JournalEntry>> {
    directory.probe()?;
    let read = journal::read::<PartHeader, JobStep, StepRecord>(directory)?;
    let own = read.filter(|(found, _)| found.is_some_and(is_wanted));
    Ok(own.map(|(_, entries)| entries).unwrap_or_default())
}

/// What the journals of all parts of a job name.
#[derive(Default)]
pub(crate) struct StepsOfParts {
    /// The number of finished steps.
    pub(crate) count: u64,
    /// The results.
    pub(crate) files: Vec<PublishedFile>,
}

impl StepsOfParts {
    /// Reads the journals of all parts of `job`.
    ///
    /// # Errors
    /// [`sys::Error::Io`] if one cannot be read.
    pub(crate) fn of(directory: &JobDirectory, job: u64) -> Result<StepsOfParts> {
        let mut steps = StepsOfParts::default();
        for folder in directory.folders_of_parts()? {
            let entries = entries_if(&folder, |found| found.job == job)?;
            steps.count += entries.len() as u64;
            let files = entries.into_iter().flat_map(|entry| entry.files);
            steps.files.extend(files.filter(|file| directory.is_result(&file.name)));
        }
        Ok(steps)
    }
}

/// Removes the steps that make coarser tiles from the journals of all parts: with another memory limit others are left out.
///
/// # Errors
/// [`sys::Error::Io`] if a journal cannot be read or written.
pub(crate) fn forget_levels(directory: &JobDirectory) -> Result<()> {
    for folder in directory.folders_of_parts()? {
        let read = journal::read::<PartHeader, JobStep, StepRecord>(&folder)?;
        if let Some((Some(header), mut entries)) = read {
            entries.retain(|entry| !matches!(entry.step, JobStep::Level(_) | JobStep::Levels));
            Journal::begin(&folder, &header, entries)?.close();
        }
    }
    Ok(())
}

/// Tells whether the records and the files of a step hold what was written.
pub(crate) fn is_whole(directory: &JobDirectory, store: &Store, entry: &JournalEntry) -> bool {
    entry.records.iter().all(|record| store.is_whole(record)) && entry.files.iter().all(|file| file.is_whole(directory))
}

/// Returns the records that `entries` name.
pub(crate) fn records_of(entries: &[JournalEntry]) -> Vec<RecordRef> {
    entries.iter().flat_map(|entry| &entry.records).copied().collect()
}

/// Opens the store in `directory` with these records.
///
/// # Errors
/// [`sys::Error::Io`].
pub(crate) fn open_store(directory: &JobDirectory, records: &[RecordRef]) -> Result<Store> {
    let paths: [PathBuf; STORE_FILES] = directory.store();
    if records.is_empty() { Store::create(paths) } else { Store::open(paths, records.iter()) }
}
