//! What the journals of parts say of phases that are complete.

use crate::durable::directory::JobDirectory;
use crate::durable::journal::records_of;
use crate::levels::make_level::LevelStats;
use crate::partition::part_points::ReadInputs;
use crate::phase::Phase;
use crate::progress::stats::StageStats;
use crate::records::{JobStep, JournalEntry, RecordRef};
use crate::run::done::Done;
use crate::run::part_entries::{PartHeader, entries_of};
use crate::run::phases::meshed_part::{MeshedPart, SomeTiles};
use crate::run::phases::select_phase::SelectedPart;
use serde::de::{DeserializeOwned, IgnoredAny};
use sys::Result;

/// The phases of a part that are complete.
#[derive(Default)]
pub(crate) struct PartProgress {
    pub(crate) read: Option<ReadInputs>,
    pub(crate) selected: Option<SelectedPart>,
    pub(crate) mesh: Option<MeshedPart>,
    /// What is written of its tiles.
    pub(crate) tiles: SomeTiles,
    pub(crate) levels: Option<LevelStats>,
    /// Bytes that its store keeps.
    pub(crate) stored: u64,
    /// What each took.
    costs: Vec<(JobStep, Done<IgnoredAny>)>,
}

impl PartProgress {
    /// Reads the journal in `directory`, which is that of the part with `header`.
    ///
    /// # Errors
    /// [`sys::Error::Io`] or [`sys::Error::Broken`] on the journal.
    pub(crate) fn of(directory: &JobDirectory, header: PartHeader) -> Result<PartProgress> {
        let entries = entries_of(directory, header)?;
        let stored = records_of(&entries).values().map(RecordRef::bytes).sum();
        let mut progress = PartProgress { stored, ..PartProgress::default() };
        for entry in entries {
            fn figures<T: DeserializeOwned>(entry: &JournalEntry) -> Result<T> {
                entry.figures::<Done<T>>().map(|done| done.figures)
            }
            match entry.step {
                JobStep::Read => progress.read = Some(figures(&entry)?),
                JobStep::Select => progress.selected = Some(figures(&entry)?),
                JobStep::Mesh => progress.mesh = Some(figures(&entry)?),
                JobStep::Tiles => progress.tiles.add(figures(&entry)?),
                JobStep::Levels => progress.levels = Some(figures(&entry)?),
                _ => {}
            }
            progress.costs.push((entry.step, entry.figures()?));
        }
        Ok(progress)
    }

    /// Tells whether `phase` is complete.
    pub(crate) fn has(&self, phase: Phase) -> bool {
        match phase {
            Phase::Read => self.read.is_some(),
            Phase::Select => self.selected.is_some(),
            Phase::Mesh => self.mesh.is_some(),
            Phase::Tiles => self.mesh.as_ref().is_some_and(|mesh| mesh.tiles == self.tiles.written.len()),
            Phase::Levels => self.levels.is_some(),
            Phase::Plan | Phase::Join | Phase::Publish => false,
        }
    }

    /// Returns the number of tiles that are not written yet.
    pub(crate) fn tiles_left(&self) -> usize {
        self.mesh.as_ref().map_or(0, |mesh| mesh.tiles.saturating_sub(self.tiles.written.len()))
    }

    /// Returns how long the phases took together that are about this part alone.
    pub(crate) fn seconds(&self) -> f64 {
        self.costs.iter().filter(|(step, _)| *step != JobStep::Select).map(|(_, done)| done.seconds).sum()
    }

    /// Returns the largest resident set of the processes that did the phases.
    pub(crate) fn peak_memory(&self) -> Option<u64> {
        self.costs.iter().filter_map(|(_, done)| done.peak_memory).max()
    }

    /// Returns the stages of `step`.
    pub(crate) fn stages_of(&self, step: JobStep) -> impl Iterator<Item = &StageStats> {
        self.costs.iter().filter(move |(of, _)| *of == step).flat_map(|(_, done)| &done.stages)
    }
}
