//! What the journals of parts say of phases that are complete.

use crate::durable::directory::JobDirectory;
use crate::levels::make_level::LevelStats;
use crate::partition::part_points::ReadInputs;
use crate::phase::Phase;
use crate::progress::stats::StageStats;
use crate::records::{JobStep, JournalEntry};
use crate::run::part_entries::{PartHeader, entries_of_steps};
use crate::run::parts::meshed_part::MeshedPart;
use crate::tiles::write_tile::TileStats;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use sys::Result;

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
}

impl<T: DeserializeOwned> Done<T> {
    /// Returns what `entries` say of `step`, if it is complete.
    ///
    /// # Errors
    /// [`sys::Error::Broken`] if they are not understood.
    pub(crate) fn find(entries: &[JournalEntry], step: JobStep) -> Result<Option<Done<T>>> {
        entries.iter().find(|entry| entry.step == step).map(JournalEntry::stats).transpose()
    }
}

/// The phases of a part that are complete.
#[derive(Default)]
pub(crate) struct PartProgress {
    pub(crate) read: Option<Done<ReadInputs>>,
    pub(crate) mesh: Option<Done<MeshedPart>>,
    pub(crate) tiles: Option<Done<TileStats>>,
    pub(crate) levels: Option<Done<LevelStats>>,
}

impl PartProgress {
    /// Reads the journal in `directory`, which is that of the part with `header`.
    ///
    /// # Errors
    /// [`sys::Error::Io`] or [`sys::Error::Broken`] on the journal.
    pub(crate) fn of(directory: &JobDirectory, header: PartHeader) -> Result<PartProgress> {
        let steps = [JobStep::Read(header.part), JobStep::MeshPart, JobStep::WriteWaiting, JobStep::Levels];
        let entries = entries_of_steps(directory, header, |step| steps.contains(&step))?;
        let [read, mesh, tiles, levels] = steps;
        Ok(PartProgress {
            read: Done::find(&entries, read)?,
            mesh: Done::find(&entries, mesh)?,
            tiles: Done::find(&entries, tiles)?,
            levels: Done::find(&entries, levels)?,
        })
    }

    /// Tells whether `phase` is complete.
    pub(crate) fn has(&self, phase: Phase) -> bool {
        match phase {
            Phase::Read => self.read.is_some(),
            Phase::Mesh => self.mesh.is_some(),
            Phase::Tiles => self.tiles.is_some(),
            Phase::Levels => self.levels.is_some(),
            Phase::Plan | Phase::Join | Phase::Publish => false,
        }
    }

    /// Returns how long the phases took together.
    pub(crate) fn seconds(&self) -> f64 {
        fn of<T>(done: &Option<Done<T>>) -> f64 {
            done.as_ref().map_or(0.0, |done| done.seconds)
        }
        of(&self.read) + of(&self.mesh) + of(&self.tiles) + of(&self.levels)
    }

    /// Returns the largest resident set of the processes that did the phases.
    pub(crate) fn peak_memory(&self) -> Option<u64> {
        fn of<T>(done: &Option<Done<T>>) -> Option<u64> {
            done.as_ref().and_then(|done| done.peak_memory)
        }
        of(&self.read).max(of(&self.mesh)).max(of(&self.tiles)).max(of(&self.levels))
    }

    /// Returns the stages of the phases, in order.
    pub(crate) fn stages(&self) -> [&[StageStats]; 4] {
        fn of<T>(done: &Option<Done<T>>) -> &[StageStats] {
            done.as_ref().map_or(&[], |done| &done.stages)
        }
        [of(&self.read), of(&self.mesh), of(&self.tiles), of(&self.levels)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hungriest_phase_counts() {
        fn done<T: Default>(peak_memory: Option<u64>) -> Option<Done<T>> {
            Some(Done { figures: T::default(), seconds: 1.0, peak_memory, stages: Vec::new() })
        }
        assert_eq!(PartProgress::default().peak_memory(), None);
        let progress = PartProgress { tiles: done(Some(7)), levels: done(Some(5)), ..PartProgress::default() };
        assert_eq!(progress.peak_memory(), Some(7));
        let progress = PartProgress { tiles: done(None), levels: done(Some(5)), ..PartProgress::default() };
        assert_eq!(progress.peak_memory(), Some(5));
    }
}
