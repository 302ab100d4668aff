//! What the journals of parts tell: which phases are complete, and what they left.

use crate::durable::directory::JobDirectory;
use crate::durable::journal;
use crate::durable::journal::{PublishedFile, records_of};
use crate::index::PartIndex;
use crate::partition::parts::Parts;
use crate::phase::Phase;
use crate::progress::stats::StageStats;
use crate::records::{JobStep, JournalEntry, RecordRef, Store};
use crate::run::meshed_part::{MeshedPart, SomeTiles};
use rayon::prelude::*;
use serde::de::{DeserializeOwned, IgnoredAny};
use serde::{Deserialize, Serialize};
use sys::{Error, Result, interrupt};

/// The first line of the journal of a part. The nodes above the parts have the number after the last part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct PartHeader {
    /// The run that began the job.
    pub(crate) job: u64,
    pub(crate) part: PartIndex,
}

/// Returns the folder of `part`, or of the nodes above the `parts`.
pub(crate) fn folder_of(directory: &JobDirectory, parts: &Parts, part: PartIndex) -> JobDirectory {
    if part == parts.tree.part { directory.join() } else { directory.part(part) }
}

/// A phase of a part that is complete.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Done<T> {
    /// What later phases and the report need to know of it.
    pub(crate) figures: T,
    /// How long it took, as far as the last process did it.
    pub(crate) seconds: f64,
    /// The largest resident set of that process, in bytes, up to the end of the phase.
    pub(crate) peak_memory: Option<u64>,
    pub(crate) stages: Vec<StageStats>,
    /// With `--update`, the key: a hash of everything that the phase was done with. It is done again if that has another key now. Else 0.
    #[serde(default)]
    pub(crate) key: u64,
}

/// The phases of a part, or of the nodes above the parts, that are complete.
pub(crate) struct PartEntries {
    pub(crate) directory: JobDirectory,
    pub(crate) header: PartHeader,
    pub(crate) entries: Vec<JournalEntry>,
}

impl PartEntries {
    /// Reads those of one of the `parts` of a job, or of the nodes above them. If its journal is not that of `header`, nothing is complete.
    ///
    /// # Errors
    /// [`Error::Io`] if the journal cannot be read.
    pub(crate) fn of(directory: &JobDirectory, parts: &Parts, header: PartHeader) -> Result<PartEntries> {
        let directory = folder_of(directory, parts, header.part);
        let found = PartEntries::find(&directory, |found| found == header)?;
        Ok(found.unwrap_or(PartEntries { directory, header, entries: Vec::new() }))
    }

    /// Reads those of all parts of the job with the number `job`, and of the nodes above them.
    ///
    /// # Errors
    /// [`Error::Io`] if a journal cannot be read.
    pub(crate) fn of_all(directory: &JobDirectory, job: u64) -> Result<Vec<PartEntries>> {
        let found = directory.folders_of_parts()?.into_iter();
        found.filter_map(|folder| PartEntries::find(&folder, |found| found.job == job).transpose()).collect()
    }

    fn find(directory: &JobDirectory, is_own: impl Fn(PartHeader) -> bool) -> Result<Option<PartEntries>> {
        // Another machine may have written it.
        directory.probe()?;
        let read = journal::read::<PartHeader, JournalEntry>(directory)?;
        let Some((Some(header), entries, _)) = read.filter(|(found, ..)| found.is_some_and(&is_own)) else {
            return Ok(None);
        };
        Ok(Some(PartEntries { directory: directory.clone(), header, entries }))
    }

    /// Tells whether `step` is complete.
    pub(crate) fn has(&self, step: JobStep) -> bool {
        self.entries.iter().any(|entry| entry.step == step)
    }

    /// Returns what is known of `step`, if it is complete.
    ///
    /// # Errors
    /// [`Error::Broken`] if it is not understood.
    pub(crate) fn done<T: DeserializeOwned>(&self, step: JobStep) -> Result<Option<Done<T>>> {
        self.entries.iter().find(|entry| entry.step == step).map(JournalEntry::figures).transpose()
    }

    /// Returns the figures of `step`, if it is complete.
    ///
    /// # Errors
    /// [`Error::Broken`] if they are not understood.
    pub(crate) fn known<T: DeserializeOwned>(&self, step: JobStep) -> Result<Option<T>> {
        Ok(self.done(step)?.map(|done| done.figures))
    }

    /// Returns the figures of `step`, which must be complete.
    ///
    /// # Errors
    /// [`Error::Broken`] if it is not.
    pub(crate) fn figures<T: DeserializeOwned>(&self, step: JobStep) -> Result<T> {
        let missing = || Error::Broken(format!("part {} is not complete: {step:?} is missing", self.header.part));
        self.known(step)?.ok_or_else(missing)
    }

    /// Returns the figures of all entries of `step`.
    ///
    /// # Errors
    /// [`Error::Broken`] if they are not understood.
    pub(crate) fn all_figures<T: DeserializeOwned>(&self, step: JobStep) -> Result<Vec<T>> {
        let entries = self.entries.iter().filter(|entry| entry.step == step);
        entries.map(|entry| entry.figures().map(|done: Done<T>| done.figures)).collect()
    }

    /// Returns what is written of the tiles of the part.
    ///
    /// # Errors
    /// [`Error::Broken`] if it is not understood.
    pub(crate) fn tiles(&self) -> Result<SomeTiles> {
        let mut all = SomeTiles::default();
        self.all_figures(JobStep::Tiles)?.into_iter().for_each(|some| all.add(some));
        Ok(all)
    }

    /// Returns how many of its tiles are not written yet; `None` if it is not meshed.
    ///
    /// # Errors
    /// [`Error::Broken`] if the entries are not understood.
    pub(crate) fn tiles_left(&self) -> Result<Option<usize>> {
        let mesh = self.known::<MeshedPart>(JobStep::Mesh)?;
        mesh.map(|mesh| Ok(mesh.tiles.saturating_sub(self.tiles()?.written.len()))).transpose()
    }

    /// Tells whether `phase` is complete, as far as it is about this part, or these nodes.
    ///
    /// # Errors
    /// [`Error::Broken`] if the entries are not understood.
    pub(crate) fn has_phase(&self, phase: Phase) -> Result<bool> {
        Ok(match phase {
            Phase::Read => self.has(JobStep::Read),
            Phase::Select => self.has(JobStep::Select),
            Phase::Mesh => self.has(JobStep::Mesh),
            Phase::Join => self.has(JobStep::Join),
            Phase::Tiles => self.tiles_left()? == Some(0),
            Phase::Levels => self.has(JobStep::Levels),
            Phase::Plan | Phase::Publish => false,
        })
    }

    /// Returns what each phase took.
    ///
    /// # Errors
    /// [`Error::Broken`] if that is not understood.
    pub(crate) fn costs(&self) -> Result<Vec<(JobStep, Done<IgnoredAny>)>> {
        self.entries.iter().map(|entry| Ok((entry.step, entry.figures()?))).collect()
    }

    /// Returns how long the phases took together that are about this part alone.
    ///
    /// # Errors
    /// [`Error::Broken`] if that is not understood.
    pub(crate) fn seconds(&self) -> Result<f64> {
        Ok(self.costs()?.iter().filter(|(step, _)| *step != JobStep::Select).map(|(_, done)| done.seconds).sum())
    }

    /// Returns the bytes that the store keeps.
    pub(crate) fn stored(&self) -> u64 {
        records_of(&self.entries).values().map(RecordRef::bytes).sum()
    }

    /// Returns the results of all phases, or of `step` alone.
    pub(crate) fn files(&self, step: Option<JobStep>) -> impl Iterator<Item = &PublishedFile> {
        let entries = self.entries.iter().filter(move |entry| step.is_none_or(|step| entry.step == step));
        entries.flat_map(|entry| &entry.files)
    }

    /// Drops these steps. Returns whether one of them was complete.
    pub(crate) fn drop_steps(&mut self, steps: &[JobStep]) -> bool {
        let before = self.entries.len();
        self.entries.retain(|entry| !steps.contains(&entry.step));
        self.entries.len() < before
    }

    /// Tells whether all records and files hold what was written.
    ///
    /// # Errors
    /// [`Error::Io`] if the disk does not tell.
    pub(crate) fn is_whole(&self) -> Result<bool> {
        let (store, records) = (self.store()?, records_of(&self.entries).into_values().collect::<Vec<_>>());
        let is_whole = |record| {
            interrupt::check()?;
            store.is_whole(record)
        };
        let records = records.par_iter().map(is_whole).try_reduce(|| true, |a, b| Ok(a && b))?;
        let files =
            self.entries.par_iter().flat_map(|entry| &entry.files).map(|file| file.try_is_whole(&self.directory));
        Ok(files.try_reduce(|| true, |a, b| Ok(a && b))? && records)
    }

    /// Opens the store that they describe.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn store(&self) -> Result<Store> {
        Store::open(self.directory.store(), records_of(&self.entries).into_values())
    }
}
