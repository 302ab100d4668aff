//! What all phases of a job know.

use crate::durable::atomic_file::remove_file;
use crate::durable::directory::JobDirectory;
use crate::durable::lock::Lock;
use crate::index::PartIndex;
use crate::partition::part_points::ReadInputs;
use crate::partition::parts::Parts;
use crate::partition::result::Partition;
use crate::plan::job_plan::Plan;
use crate::progress::clock::JobClock;
use crate::progress::stage::JobProgress;
use crate::records::{JobStep, Journal, JournalEntry, Store};
use crate::run::meshed_part::SomeTiles;
use crate::run::part_entries::{PartEntries, PartHeader, folder_of};
use delaunay_gpu::triangulator::Triangulator;
use std::collections::{HashSet, VecDeque};
use std::ops::Deref;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use sys::{Result, fault};

/// A job that has run for so many seconds should not depend on what the system has yet to bring to the disk.
const WORTH_SYNCING: f64 = 60.0;

/// How many parts stay open for the next who asks. Each has a few open files.
const KEPT_OPEN: usize = 24;

/// What a process works with that does all of a job or a task.
#[derive(Clone, Copy)]
pub(crate) struct Process<'a> {
    pub(crate) directory: &'a JobDirectory,
    pub(crate) triangulator: &'a Triangulator,
    pub(crate) progress: &'a JobProgress,
    pub(crate) threads: usize,
    pub(crate) clock: JobClock,
    /// Tells the folders of this job's parts from those of others.
    pub(crate) id: u64,
    /// Whether points that were read before may be damaged, because a power failure may have come since.
    pub(crate) checks_points: bool,
    /// Whether this process does a task, and other machines the others.
    pub(crate) is_task: bool,
}

/// A job, of which this process does all or a task.
pub(crate) struct Job<'a> {
    process: Process<'a>,
    pub(crate) plan: &'a Plan,
    pub(crate) parts: &'a Parts,
    open: Mutex<VecDeque<(PartIndex, Arc<OpenPart>)>>,
}

/// A part that is meshed, whose records can be read.
pub(crate) struct OpenPart {
    pub(crate) store: Arc<Store>,
    pub(crate) partition: Partition,
    /// What is written of its tiles.
    pub(crate) tiles: SomeTiles,
}

impl<'a> Deref for Job<'a> {
    type Target = Process<'a>;

    fn deref(&self) -> &Process<'a> {
        &self.process
    }
}

impl<'a> Job<'a> {
    pub(crate) fn new(process: Process<'a>, plan: &'a Plan, parts: &'a Parts) -> Job<'a> {
        Job { process, plan, parts, open: Mutex::default() }
    }

    /// Returns the number of the nodes above the parts.
    pub(crate) fn above(&self) -> PartIndex {
        self.parts.tree.part
    }

    /// Returns the folder of `part`, or of the nodes above the parts.
    pub(crate) fn folder(&self, part: PartIndex) -> JobDirectory {
        folder_of(self.directory, self.parts, part)
    }

    /// Returns the first line of its journal.
    pub(crate) fn header(&self, part: PartIndex) -> PartHeader {
        PartHeader { job: self.id, part }
    }

    /// Returns its phases that are complete.
    ///
    /// # Errors
    /// [`sys::Error::Io`] if its journal cannot be read.
    pub(crate) fn entries(&self, part: PartIndex) -> Result<PartEntries> {
        PartEntries::of(self.directory, self.parts, self.header(part))
    }

    /// Writes the journal of `part`, or of the nodes above the parts, again with what `keep` returns of each entry. Removes the results that it
    /// names no more where they wait. A result in its place is another link to the same file, which stays.
    ///
    /// # Errors
    /// Those of `keep`, [`sys::Error::Io`] on the folder, [`crate::Error::InUse`] if another process has it.
    pub(crate) fn rewrite(
        &self,
        part: PartIndex,
        keep: impl Fn(JournalEntry) -> Result<Option<JournalEntry>>,
    ) -> crate::Result<()> {
        self.close(part);
        let _lock = Lock::take_within(self.folder(part).job())?;
        let PartEntries { directory, header, entries } = self.entries(part)?;
        let names = |entries: &[JournalEntry]| -> HashSet<PathBuf> {
            entries.iter().flat_map(|entry| &entry.files).map(|file| file.name.clone()).collect()
        };
        let before = names(&entries);
        let kept: Vec<JournalEntry> =
            entries.into_iter().filter_map(|entry| keep(entry).transpose()).collect::<Result<_>>()?;
        let after = names(&kept);
        drop(Journal::begin(&directory, &header, kept)?);
        Ok(before.difference(&after).try_for_each(|name| remove_file(&directory.file(name)))?)
    }

    /// Takes `step` out of the journal of `part`, or of the nodes above the parts, and the phases of the same folder that follow from it, with the
    /// files that they left.
    ///
    /// # Errors
    /// [`sys::Error::Io`] on the folder, [`crate::Error::InUse`] if another process has it.
    pub(crate) fn forget_from(&self, part: PartIndex, step: JobStep) -> crate::Result<()> {
        let entries = self.entries(part)?;
        self.rewrite(part, |entry| Ok((!follows(entry.step, step)).then_some(entry)))?;
        if step == JobStep::Read {
            let read = entries.figures::<ReadInputs>(step)?;
            let files = read.by_part.iter().map(|found| self.directory.part(found.part).point_file(part.0 as u16));
            files.into_iter().try_for_each(|file| remove_file(&file))?;
        }
        Ok(())
    }

    /// Returns the key of a phase: 0 without `--update`.
    ///
    /// # Errors
    /// Those of `key`.
    pub(crate) fn key<E>(&self, key: impl FnOnce() -> std::result::Result<u64, E>) -> std::result::Result<u64, E> {
        if self.plan.options.updates { key() } else { Ok(0) }
    }

    /// Opens the store of `part`, which must be meshed.
    ///
    /// # Errors
    /// [`sys::Error::Io`] or [`sys::Error::Broken`] on its folder.
    pub(crate) fn open(&self, part: PartIndex) -> Result<Arc<OpenPart>> {
        let mut open = self.open_parts();
        if let Some((_, found)) = open.iter().find(|(number, _)| *number == part) {
            return Ok(found.clone());
        }
        let entries = self.entries(part)?;
        if !entries.has(JobStep::Mesh) {
            return Err(sys::Error::Broken(format!("part {part} is not meshed")));
        }
        let store = Arc::new(entries.store()?);
        let tiles = entries.tiles()?;
        let opened = Arc::new(OpenPart { partition: Partition::load(&store)?, tiles, store });
        open.push_back((part, opened.clone()));
        if open.len() > KEPT_OPEN {
            open.pop_front();
        }
        Ok(opened)
    }

    /// Closes the store of `part`, which is about to change.
    pub(crate) fn close(&self, part: PartIndex) {
        self.open_parts().retain(|(number, _)| *number != part);
    }

    fn open_parts(&self) -> MutexGuard<'_, VecDeque<(PartIndex, Arc<OpenPart>)>> {
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Tells whether what later phases need must be on the disk before they count on it. A small job that has not run for long is done again
    /// soon, but tasks on other machines may go on with a larger one at any time.
    pub(crate) fn syncs(&self) -> bool {
        self.parts.all().len() > 1 || self.clock.wall_s() > WORTH_SYNCING || fault::syncs_always()
    }
}

/// Tells whether `step` is `changed`, or follows from it in the same folder.
fn follows(step: JobStep, changed: JobStep) -> bool {
    match changed {
        JobStep::Mesh => matches!(step, JobStep::Mesh | JobStep::Tiles | JobStep::LevelTiles | JobStep::Levels),
        JobStep::Join => matches!(step, JobStep::Merge(_) | JobStep::Join),
        _ => step == changed,
    }
}
