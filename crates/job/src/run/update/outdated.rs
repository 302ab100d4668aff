//! Taking phases that are outdated out of a journal, with the files that they left.

use crate::durable::atomic_file::remove_file;
use crate::index::PartIndex;
use crate::partition::part_points::ReadInputs;
use crate::records::JobStep;
use crate::run::job::Job;

/// Takes `step` out of the journal of `part`, or of the nodes above the parts, and the phases of the same folder that follow from it.
///
/// # Errors
/// [`sys::Error::Io`] on the folder, [`crate::Error::InUse`] if another process has it.
pub(crate) fn forget_from(job: &Job, part: PartIndex, step: JobStep) -> crate::Result<()> {
    let entries = job.entries(part)?;
    job.rewrite(part, |entry| Ok((!follows(entry.step, step)).then_some(entry)))?;
    if step == JobStep::Read {
        let read = entries.figures::<ReadInputs>(step)?;
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
