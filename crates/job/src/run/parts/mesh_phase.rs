//! Meshing a part whose points have all been read.

use crate::durable::directory::JobDirectory;
use crate::index::PartIndex;
use crate::partition::result::Partition;
use crate::progress::stats::StageStats;
use crate::records::{JobStep, JournalEntry, StepOutput, StepRecord, Store};
use crate::run::mesh_and_tiles::{Writing, mesh_part};
use crate::run::part_entries::{entries_of, entries_of_steps, is_whole, open_store, records_of};
use crate::run::parts::done::Done;
use crate::run::parts::meshed_part::MeshedPart;
use crate::run::parts::part_journal::PartSession;
use crate::run::parts::parts_job::PartsJob;
use crate::run::parts::read_phase::points_of;
use crate::run::resume_parts::resume_part;
use crate::run::tile_queue::TileAppearance;
use crate::{Error, Result};
use std::sync::{Arc, PoisonError};

/// Meshes a part whose points have all been read, unless that is done. Temporary files of other parts take `others` bytes; `None` where
/// nobody knows.
///
/// # Errors
/// Those of the steps; [`Error::DamagedSteps`] if the points are damaged; [`Error::InUse`] if another process has the
/// part.
pub(crate) fn mesh_one(
    job: &PartsJob,
    part: PartIndex,
    appearance: Option<&Arc<TileAppearance>>,
    others: Option<u64>,
) -> Result<MeshedPart> {
    let directory = &job.directory.part(part);
    let meshed = match done(job, directory, part)? {
        Some(meshed) => meshed,
        None => {
            let lock = directory.lock_within()?;
            // Another process may have done it since.
            match done(job, directory, part)? {
                Some(meshed) => meshed,
                None => {
                    let header = job.header(part);
                    let max_edge = job.plan.options.output.max_edge;
                    let (entries, partition) =
                        resume_part(directory, entries_of(directory, header)?, max_edge, job.progress)?;
                    mesh(
                        job,
                        PartSession::begin(directory, lock, header, entries)?,
                        part,
                        partition,
                        appearance,
                        others,
                    )?
                }
            }
        }
    };
    directory.remove_points()?;
    Ok(meshed)
}

fn done(job: &PartsJob, directory: &JobDirectory, part: PartIndex) -> sys::Result<Option<MeshedPart>> {
    let step = JobStep::MeshPart;
    let done = Done::find(&entries_of_steps(directory, job.header(part), |found| found == step)?, step)?;
    Ok(done.map(|done| done.figures))
}

fn mesh(
    job: &PartsJob,
    session: PartSession,
    part: PartIndex,
    partition: Option<Partition>,
    appearance: Option<&Arc<TileAppearance>>,
    others: Option<u64>,
) -> Result<MeshedPart> {
    let context = session.context(job);
    let partition = match partition {
        Some(partition) => partition,
        None => {
            let partition = points_of(job, part)?.partition(session.directory)?;
            let record = partition.save(&session.store)?;
            session.journal.record(JobStep::Partition, StepOutput::new((), vec![record]))?;
            partition
        }
    };
    let writing = appearance.map_or(Writing::Later, |appearance| Writing::AtOnce(appearance.clone()));
    let mesh = mesh_part(&context, job.plan, &partition, writing)?;
    let own = context.temporary.measure(&partition, context.store);
    let stages: Vec<StageStats> = context.stages.into_inner().unwrap_or_else(PoisonError::into_inner);
    let meshed = MeshedPart {
        points: partition.summary.counts.kept,
        leaves: mesh.leaves,
        tiles: mesh.tiles.stats,
        waiting: mesh.tiles.waiting,
        open: mesh.tiles.open,
        temporary: own + others.unwrap_or(0),
        by_task: others.is_none(),
        stored: session.store.bytes(),
    };
    Ok(session.finish(JobStep::MeshPart, meshed, stages, Vec::new())?)
}

/// Tells whether what `step` needs, besides the steps that were lost with it, is still whole. It may have been freed, and a hole reads as
/// zeros.
fn can_do_again(store: &Store, entries: &[JournalEntry], step: JobStep) -> bool {
    let (JobStep::BorderNormals(tile) | JobStep::WriteTile(tile)) = step else { return true };
    let Ok(Partition { tree, .. }) = Partition::load(store) else { return false };
    let seams: Vec<StepRecord> = tree.merges_above(tree.leaf(tile)).map(StepRecord::Seam).collect();
    let is_needed = |step: JobStep, key: StepRecord| match step {
        JobStep::Leaf(of) => of == tile,
        JobStep::Merge(_) => seams.contains(&key),
        // Those of its neighbours, at least.
        JobStep::BorderNormals(_) => true,
        _ => false,
    };
    let needed = entries.iter().flat_map(|entry| entry.records.iter().map(move |record| (entry.step, record)));
    needed.filter(|(step, record)| is_needed(*step, record.key())).all(|(_, record)| store.is_whole(record))
}

/// Removes from the journal of a part that is meshed the later steps that a power failure has damaged: they can be done again.
///
/// # Errors
/// [`Error::DamagedSteps`] if they cannot; [`sys::Error::Io`] on the part's folder, [`Error::InUse`] if another process has it.
pub(crate) fn drop_damaged_steps(job: &PartsJob, part: PartIndex) -> Result<()> {
    let (directory, header) = (&job.directory.part(part), job.header(part));
    let lock = directory.lock_within()?;
    let mut entries = entries_of(directory, header)?;
    let Some(meshed) = entries.iter().position(|entry| entry.step == JobStep::MeshPart) else { return Ok(()) };
    let store = open_store(directory, &records_of(&entries))?;
    let later = entries.split_off(meshed + 1);
    let (mut later, lost): (Vec<JournalEntry>, Vec<JournalEntry>) =
        later.into_iter().partition(|entry| is_whole(directory, &store, entry));
    if lost.is_empty() {
        return Ok(());
    }
    if !lost.iter().all(|entry| can_do_again(&store, &entries, entry.step)) {
        return Err(Error::DamagedSteps);
    }
    // What is complete no longer is.
    later.retain(|entry| !matches!(entry.step, JobStep::WriteWaiting | JobStep::Levels));
    entries.extend(later);
    Ok(PartSession::begin(directory, lock, header, entries)?.end()?)
}
