//! What the journals of parts say of phases that are complete.

use crate::durable::journal::records_of;
use crate::levels::make_level::LevelStats;
use crate::partition::part_points::ReadInputs;
use crate::phase::Phase;
use crate::progress::stats::StageStats;
use crate::records::{JobStep, RecordRef};
use crate::run::meshed_part::{MeshedPart, SomeTiles};
use crate::run::part_entries::{Done, PartEntries};
use crate::run::phases::select_phase::SelectedPart;
use serde::de::IgnoredAny;
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
    /// Returns what the `entries` of the part tell.
    ///
    /// # Errors
    /// [`sys::Error::Broken`] if they are not understood.
    pub(crate) fn of(entries: &PartEntries) -> Result<PartProgress> {
        Ok(PartProgress {
            read: entries.known(JobStep::Read)?,
            selected: entries.known(JobStep::Select)?,
            mesh: entries.known(JobStep::Mesh)?,
            tiles: SomeTiles::of(entries)?,
            levels: entries.known(JobStep::Levels)?,
            stored: records_of(&entries.entries).values().map(RecordRef::bytes).sum(),
            costs: entries.entries.iter().map(|entry| Ok((entry.step, entry.figures()?))).collect::<Result<_>>()?,
        })
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
