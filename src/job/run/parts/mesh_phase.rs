//! Reading and meshing the parts in their order.

use crate::job::durable::atomic_file::remove_file;
use crate::job::durable::directory::JobDirectory;
use crate::job::index::{PartIndex, TileIndex};
use crate::job::mesh::leaf::LeafStats;
use crate::job::mesh::precision_limit::PrecisionLimit;
use crate::job::partition::part_points::{PartPoints, ReadBatch};
use crate::job::partition::result::PointSummary;
use crate::job::plan::job_plan::Claims;
use crate::job::plan::no_points::no_point_is_left;
use crate::job::records::{JobStep, JournalEntry, StepOutput};
use crate::job::run::mesh_and_tiles::{Writing, mesh_part};
use crate::job::run::part_entries::{PartHeader, entries_of, is_whole, open_store, records_of};
use crate::job::run::parts::part_journal::PartSession;
use crate::job::run::parts::parts_job::PartsJob;
use crate::job::run::resume::resume_part;
use crate::job::run::tile_queue::TileLook;
use crate::job::tiles::max_edge::MaxEdgeRule;
use crate::job::tiles::write_tile::TileStats;
use crate::output::options::MaxEdge;
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// What is known of a part once it is meshed.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct MeshedPart {
    /// Points before duplicates are dropped.
    pub(crate) points: u64,
    pub(crate) leaves: LeafStats,
    /// The tiles that are written.
    pub(crate) tiles: TileStats,
    /// The tiles that wait for other parts.
    pub(crate) waiting: Vec<TileIndex>,
    /// The most bytes of temporary files while it was meshed: its own, the points of later parts, and what earlier parts keep.
    pub(crate) temporary: u64,
    /// Bytes that its store keeps.
    pub(crate) stored: u64,
}

/// All parts, meshed.
pub(crate) struct MeshedParts {
    pub(crate) parts: Vec<MeshedPart>,
    pub(crate) summary: PointSummary,
}

/// Reads and meshes all parts, or those that an interrupted run left.
///
/// # Errors
/// Those of the steps; [`Error::NeedsOnePart`] if what is read contradicts the headers.
pub(crate) fn mesh_all(job: &PartsJob) -> Result<MeshedParts> {
    let PartsJob { plan, parts, .. } = *job;
    let look = early_look(job)?;
    let mut points = PartPoints::new(plan, parts);
    let mut meshed = MeshedParts { parts: Vec::new(), summary: PointSummary::default() };
    for part in parts.all() {
        points.add(read_for(job, &points, part)?);
        let later = parts.all().skip(part.get() + 1).map(|later| points.bytes(later)).sum::<u64>();
        let others = later + meshed.parts.iter().map(|part| part.stored).sum::<u64>();
        meshed.parts.push(mesh_one(job, &points, part, look.as_ref(), others)?);
    }
    meshed.summary = points.summary.clone();
    let bounds = meshed.summary.bounds.ok_or_else(|| no_point_is_left(plan, &meshed.summary.counts))?;
    PrecisionLimit::of(&plan.frame).check_heights(bounds)?;
    Ok(meshed)
}

/// Returns how tiles look, unless all sites decide that.
fn early_look(job: &PartsJob) -> Result<Option<Arc<TileLook>>> {
    let output = &job.plan.options.output;
    match (output.max_edge, job.plan.claims) {
        (MaxEdge::Auto, _) | (_, None) => Ok(None),
        (choice, Some(Claims { bounds, max_rgb })) => {
            // No rule but "auto" looks at the sites.
            let rule = MaxEdgeRule::new(choice, &job.plan.frame, 0, bounds, &|_| Ok(()))?;
            Ok(Some(Arc::new(TileLook::new(job.plan, max_rgb, bounds, rule))))
        }
    }
}

/// Reads the inputs that `part` is the first to need, unless an earlier run has.
fn read_for(job: &PartsJob, points: &PartPoints, part: PartIndex) -> Result<ReadBatch> {
    let PartsJob { run, plan, parts } = *job;
    let step = JobStep::Read(part);
    if run.journal.has(step) {
        return ReadBatch::load(run.store, part);
    }
    if parts.new_inputs(part).is_empty() {
        return Ok(ReadBatch::default());
    }
    let records = parts.new_inputs(part).iter().map(|&input| plan.inputs[input].source.records).sum();
    let stage = run.progress.stage("read", records, "points");
    let batch = points.read(run.directory, part, run.journal.is_worth_syncing(), &stage)?;
    run.add_stage(stage.finish());
    run.journal.record(step, StepOutput::new((), vec![batch.save(run.store, part)?]))?;
    // What the part frees must not be needed again.
    run.journal.commit()?;
    Ok(batch)
}

/// Removes from the journal the steps after the one at position `done` that a power failure has damaged: they can be done again.
fn keep_whole_steps_after(
    directory: &JobDirectory,
    header: PartHeader,
    entries: Vec<JournalEntry>,
    done: usize,
) -> Result<()> {
    let store = open_store(directory, &records_of(&entries))?;
    let stays = |at: usize, entry: &JournalEntry| at <= done || is_whole(directory, &store, entry);
    let whole = (0..).zip(entries).filter(|(at, entry)| stays(*at, entry)).map(|(_, entry)| entry).collect();
    PartSession::begin(directory, header, whole)?.end()
}

/// Meshes a part whose points have all been read, unless an earlier run has. Temporary files of other parts take `others` bytes.
fn mesh_one(
    job: &PartsJob,
    points: &PartPoints,
    part: PartIndex,
    look: Option<&Arc<TileLook>>,
    others: u64,
) -> Result<MeshedPart> {
    let PartsJob { run, plan, .. } = *job;
    let directory = &run.directory.part(part);
    let header = PartHeader { job: run.job_id, part };
    let entries = entries_of(directory, header)?;
    if let Some(done) = entries.iter().position(|entry| entry.step == JobStep::MeshPart) {
        let meshed = entries[done].stats()?;
        if run.resumed > 0 {
            keep_whole_steps_after(directory, header, entries, done)?;
        }
        remove_file(&directory.points())?;
        return Ok(meshed);
    }
    let (entries, partition) = resume_part(directory, entries, plan.options.output.max_edge, run.progress)?;
    let session = PartSession::begin(directory, header, entries)?;
    let context = session.context(run);
    let partition = match partition {
        Some(partition) => partition,
        None => {
            if run.resumed > 0 && !points.are_whole(run.directory, part) {
                return Err(Error::DamagedSteps);
            }
            let partition = points.partition(run.directory, part)?;
            let record = partition.save(&session.store)?;
            session.journal.record(JobStep::Partition, StepOutput::new((), vec![record]))?;
            partition
        }
    };
    let writing = look.map_or(Writing::Later, |look| Writing::AtOnce(look.clone()));
    let mesh = mesh_part(&context, plan, &partition, writing)?;
    let own = context.temporary.measure(&partition, context.store);
    run.add_stages(context);
    let meshed = MeshedPart {
        points: partition.summary.counts.kept,
        leaves: mesh.leaves,
        tiles: mesh.tiles.stats,
        waiting: mesh.tiles.waiting,
        temporary: own + others,
        stored: session.store.bytes(),
    };
    session.journal.commit()?;
    // From here on nothing tells whether the store is whole, and the points are gone.
    session.store.sync()?;
    session.journal.record(JobStep::MeshPart, StepOutput::new(meshed.clone(), Vec::new()))?;
    session.end()?;
    remove_file(&directory.points())?;
    Ok(meshed)
}
