//! The stores of parts that are meshed, opened when they are needed.

use crate::durable::directory::JobDirectory;
use crate::durable::journal::records_of;
use crate::index::PartIndex;
use crate::partition::result::Partition;
use crate::records::{JobStep, Store};
use crate::run::job::Job;
use crate::run::part_entries::{PartHeader, entries_of, open_store};
use crate::run::phases::meshed_part::{SomeTiles, tiles_so_far};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};
use sys::{Error, Result};

/// A part whose records can be read.
pub(crate) struct OpenPart {
    pub(crate) store: Arc<Store>,
    pub(crate) partition: Partition,
    /// What is written of its tiles.
    pub(crate) tiles: SomeTiles,
}

/// How many parts stay open for the next who asks. Each has a few open files.
const KEPT_OPEN: usize = 24;

/// The stores of all parts.
pub(crate) struct PartStores {
    directory: JobDirectory,
    job: u64,
    open: Mutex<VecDeque<(PartIndex, Arc<OpenPart>)>>,
}

impl PartStores {
    pub(crate) fn new(job: &Job) -> PartStores {
        PartStores { directory: job.directory.clone(), job: job.id, open: Mutex::default() }
    }

    /// Opens the store of `part`, which must be meshed.
    ///
    /// # Errors
    /// [`sys::Error::Io`] or [`sys::Error::Broken`] on its folder.
    pub(crate) fn open(&self, part: PartIndex) -> Result<Arc<OpenPart>> {
        let mut open = self.open.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, found)) = open.iter().find(|(number, _)| *number == part) {
            return Ok(found.clone());
        }
        let directory = self.directory.part(part);
        let entries = entries_of(&directory, PartHeader { job: self.job, part })?;
        if !entries.iter().any(|entry| entry.step == JobStep::Mesh) {
            return Err(Error::Broken(format!("part {part} is not meshed")));
        }
        let store = Arc::new(open_store(&directory, records_of(&entries).into_values())?);
        let opened = Arc::new(OpenPart { partition: Partition::load(&store)?, tiles: tiles_so_far(&entries)?, store });
        open.push_back((part, opened.clone()));
        if open.len() > KEPT_OPEN {
            open.pop_front();
        }
        Ok(opened)
    }

    /// Closes the store of `part`, which is about to change.
    pub(crate) fn close(&self, part: PartIndex) {
        self.open.lock().unwrap_or_else(PoisonError::into_inner).retain(|(number, _)| *number != part);
    }
}
