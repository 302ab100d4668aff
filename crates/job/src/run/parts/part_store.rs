//! The stores of parts that are meshed, opened when they are needed.

use crate::durable::directory::JobDirectory;
use crate::index::{PartIndex, TileIndex};
use crate::partition::result::Partition;
use crate::records::{JobStep, RecordRef, Store};
use crate::run::part_entries::{PartHeader, entries_of, open_store, records_of};
use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex, PoisonError};
use sys::{Error, Result};

/// A part whose records can be read.
pub(crate) struct OpenPart {
    pub(crate) store: Store,
    pub(crate) partition: Partition,
    /// The records of finished borders.
    pub(crate) borders: HashMap<TileIndex, RecordRef>,
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
    pub(crate) fn new(directory: &JobDirectory, job: u64) -> PartStores {
        PartStores { directory: directory.clone(), job, open: Mutex::default() }
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
        if !entries.iter().any(|entry| entry.step == JobStep::MeshPart) {
            return Err(Error::Broken(format!("part {part} is not meshed")));
        }
        let records = records_of(&entries);
        let store = open_store(&directory, &records)?;
        let borders = entries.iter().filter_map(|entry| match entry.step {
            JobStep::BorderNormals(tile) => Some((tile, *entry.records.first()?)),
            _ => None,
        });
        let borders = borders.collect();
        let opened = Arc::new(OpenPart { partition: Partition::load(&store)?, store, borders });
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
