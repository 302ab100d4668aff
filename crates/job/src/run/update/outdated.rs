//! Taking phases that are outdated out of a journal, with the files that they left.

use crate::durable::atomic_file::remove_file;
use crate::durable::directory::JobDirectory;
use crate::index::PartIndex;
use crate::partition::part_points::ReadInputs;
use crate::records::{JobStep, Journal, JournalEntry};
use crate::run::done::Done;
use crate::run::job::Job;
use crate::run::part_entries::entries_of;

/// Takes `step` out of the journal of `part`, or of the nodes above the parts, whose folder is `directory`, and the phases of the same
/// folder that follow from it.
///
/// # Errors
/// [`sys::Error::Io`] on the folder, [`crate::Error::InUse`] if another process has it.
pub(crate) fn forget_from(job: &Job, directory: &JobDirectory, part: PartIndex, step: JobStep) -> crate::Result<()> {
    let _lock = directory.lock_within()?;
    let entries = entries_of(directory, job.header(part))?;
    let (gone, kept) = entries.into_iter().partition(|entry| follows(entry.step, step));
    drop(Journal::begin(directory, &job.header(part), kept)?);
    remove_files(directory, &gone)?;
    if let Some(read) = gone.iter().find(|entry| entry.step == JobStep::Read) {
        let read = read.figures::<Done<ReadInputs>>()?.figures;
        let files = read.by_part.iter().map(|found| job.directory.part(found.part).point_file(part.0 as u16));
        files.into_iter().try_for_each(|file| remove_file(&file))?;
    }
    Ok(())
}

/// Tells whether `step` is `changed`, or follows from it in the same folder.
fn follows(step: JobStep, changed: JobStep) -> bool {
    match changed {
        JobStep::Mesh => matches!(step, JobStep::Mesh | JobStep::Tiles | JobStep::LevelTiles | JobStep::Levels),
        JobStep::Join => matches!(step, JobStep::Merge(_) | JobStep::Join),
        _ => step == changed,
    }
}

/// Removes the results of these phases that wait. A result in its place is another link to the same file, which stays.
fn remove_files(directory: &JobDirectory, entries: &[JournalEntry]) -> sys::Result<()> {
    let files = entries.iter().flat_map(|entry| &entry.files);
    files.into_iter().try_for_each(|file| remove_file(&directory.file(&file.name)))
}
