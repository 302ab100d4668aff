//! The coarser tiles of a part.

use crate::index::PartIndex;
use crate::levels::make_level::LevelStats;
use crate::records::JobStep;
use crate::run::levels_step::{hierarchy_of, make_levels};
use crate::run::part_entries::entries_of;
use crate::run::parts::done::Done;
use crate::run::parts::join::JoinedParts;
use crate::run::parts::part_journal::PartSession;
use crate::run::parts::part_store::PartStores;
use crate::run::parts::parts_job::PartsJob;
use std::sync::PoisonError;
use sys::Error;

/// Makes the coarser tiles of `part`, unless that is done. If viewers get none, because the job has no tileset, notes that.
///
/// # Errors
/// Those of [`make_levels`]; [`crate::Error::InUse`] if another process has the part.
pub(crate) fn levels_of_part(
    job: &PartsJob,
    stores: &PartStores,
    joined: &JoinedParts,
    part: PartIndex,
    has_tileset: bool,
) -> crate::Result<LevelStats> {
    let (directory, header) = (&job.directory.part(part), job.header(part));
    let lock = directory.lock_within()?;
    let entries = entries_of(directory, header)?;
    if let Some(done) = Done::find(&entries, JobStep::Levels)? {
        return Ok(done.figures);
    }
    let open = stores.open(part)?;
    // The store of the part grows, so nobody may go on with what is open now.
    stores.close(part);
    let session = PartSession::begin(directory, lock, header, entries)?;
    let context = session.context(job);
    let mut stats = LevelStats::default();
    if has_tileset {
        let hierarchy = hierarchy_of(job.plan, &open.partition);
        let no_other = |other: PartIndex| Err(Error::Broken(format!("part {part} has no tile of part {other}")));
        stats = make_levels(&context, job.plan, part, hierarchy, &joined.appearance.style, &no_other)?.stats;
    }
    let stages = context.stages.into_inner().unwrap_or_else(PoisonError::into_inner);
    Ok(session.finish(JobStep::Levels, stats, stages, Vec::new())?)
}
