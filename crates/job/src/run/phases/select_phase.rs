//! Finding the points that are vertices, in jobs with `surface = "bare-earth"` or `[output] max_error`. All parts are read before, and none is
//! meshed.

use crate::Result;
use crate::durable::columns::{ColumnReader, ColumnWriter};
use crate::index::PartIndex;
use crate::mesh::ground_record::{load_ground, save_ground};
use crate::mesh::hull_rule::HullRule;
use crate::mesh::selection::{PartInBlocks, PointsInBlocks, WrittenPoints, error_bound, points_per_block};
use crate::mesh::selection_file::SelectionFile;
use crate::partition::part_points::{PointsOfPart, file_of_selected};
use crate::plan::budget::selection_memory;
use crate::plan::job_plan::Plan;
use crate::records::{JobStep, StepRecord, Store};
use crate::run::folder::{Folder, done_with};
use crate::run::job::Job;
use crate::run::phases::read_phase::{checked, listed_points_of, points_of};
use delaunay::geometry::Site;
use ground::Ground;
use selection::{Figures, Selection, select};
use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::xxh3_64;

/// What is known of a part once its vertices are selected.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct SelectedPart {
    /// With `max_error`: the figures of the selection of all parts.
    pub(crate) all: Option<Figures>,
    /// The points of this part that vertices were selected from: all, or those on the ground.
    pub(crate) wanted: u64,
    /// Those of them that were dropped because another has the same x and y.
    pub(crate) duplicates: u64,
    /// Bytes of the point files of all parts, with the selected points of those that were written when this part was done.
    pub(crate) temporary: u64,
    /// The number of blocks that the selected points of this part are in.
    blocks: u64,
    /// The digest of the selected points, with `--update`.
    digest: u64,
}

/// Tells whether the job has the phase.
pub(crate) fn selects(plan: &Plan) -> bool {
    plan.options.leaves_points_out()
}

/// Selects the vertices of all parts, unless that is done. All points have been read.
///
/// # Errors
/// [`Error::DamagedSteps`] if points are damaged; [`sys::Error::Io`] on the folders of the parts; [`Error::InUse`] if another process has one;
/// [`sys::Error::Config`] if the memory does not hold the selection.
pub(crate) fn select_vertices(job: &Job) -> Result<()> {
    let bound = error_bound(job.plan)?;
    let key = job.key(|| key_of_all_points(job))?;
    let is_done = |part| Ok(done_with::<IgnoredAny>(job, part, JobStep::Select, key)?.is_some());
    if job.parts.all().map(is_done).collect::<Result<Vec<bool>>>()?.into_iter().all(|is_done| is_done) {
        return know_selection(job);
    }
    // The lock of the first part is that of the phase: no other phase goes on before this one is done.
    let first = Folder::open(job, PartIndex::FIRST, key)?;
    let stage = job.progress.stage("select", job.plan.decoded_records(), "points");
    let memory = selection_memory(&job.plan.options);
    let per_block = points_per_block(job.plan.decoded_records(), memory, job.threads);
    let in_blocks = |part: PartIndex| {
        let directory = job.folder(part);
        let partition = points_of(job, part)?.partition(&directory, per_block)?;
        let mut files = directory.point_files()?;
        files.retain(|(number, _)| *number != file_of_selected(job.parts));
        Ok(PartInBlocks { part, partition, files })
    };
    let parts = job.parts.all().map(in_blocks).collect::<Result<Vec<PartInBlocks>>>()?;
    let waiting = SelectionFile::at(&first.directory)?;
    let mut source = PointsInBlocks::new(job.plan, job.triangulator, &parts, &waiting);
    if job.plan.options.input.finds_ground() {
        source = source.on_found_ground(|points| stage.advance(points))?;
    }
    let selection = bound.map(|bound| select(&source, bound)).transpose()?;
    let (sites, figures, on_ground) = match selection {
        Some(Selection { sites, figures, holding }) => (Some(sites), Some(figures), source.on_ground(&holding)),
        None => (None, None, Vec::new()),
    };
    if !job.plan.options.input.finds_ground() {
        stage.advance(parts.iter().map(|part| part.partition.kept).sum());
    }
    let mut stage = Some(stage);
    let mut temporary = parts.iter().map(|part| part.partition.point_bytes).sum::<u64>() + waiting.bytes();
    for (number, PartInBlocks { part, .. }) in parts.iter().enumerate() {
        let other = if number == 0 { None } else { Some(Folder::open(job, *part, key)?) };
        let folder = other.as_ref().unwrap_or(&first);
        if folder.done::<SelectedPart>(JobStep::Select)?.is_some() {
            continue;
        }
        let WrittenPoints { blocks, wanted, duplicates, digest } =
            source.write_selected(number, sites.as_ref(), job.parts, &folder.directory, job.syncs())?;
        blocks.save_as(&folder.store, StepRecord::Selected)?;
        if number == 0 {
            ColumnWriter::default().push(&on_ground).write(&folder.store, StepRecord::OnGround)?;
            source.ground().map(|ground| save_ground(ground, &folder.store)).transpose()?;
        }
        temporary += blocks.bytes();
        let (blocks, digest) = (blocks.len(), digest);
        let selected = SelectedPart { all: figures, wanted, duplicates, temporary, blocks, digest };
        let is_last = number + 1 == parts.len();
        let stages = stage.take_if(|_| is_last).map(|stage| stage.finish()).into_iter().collect();
        if is_last {
            waiting.remove()?;
        }
        folder.record(JobStep::Select, selected, stages)?;
    }
    job.plan.on_ground.set(on_ground);
    Ok(())
}

/// Returns the key of the selection: the digest of the points of all parts, and which triangles are asked about.
fn key_of_all_points(job: &Job) -> Result<u64> {
    job.parts
        .all()
        .try_fold(key_of_lengths(job), |all, part| Ok(all.wrapping_add(listed_points_of(job, part)?.digest())))
}

/// Tells the plan what the selection has found, if it is done. Later phases of jobs that have one fail without.
///
/// # Errors
/// [`sys::Error::Io`] or [`sys::Error::Broken`] on the store of the first part.
pub(crate) fn know_selection(job: &Job) -> Result<()> {
    let entries = job.entries(PartIndex::FIRST)?;
    if entries.has(JobStep::Select) {
        let on_ground = ColumnReader::open(&entries.store()?, StepRecord::OnGround)?.column::<[Site; 3]>()?;
        job.plan.on_ground.set(on_ground.iter().copied());
    }
    Ok(())
}

/// Returns the ground that the job has found.
///
/// # Errors
/// [`sys::Error::Io`] or [`sys::Error::Broken`] on the store of the first part.
pub(crate) fn found_ground(job: &Job) -> sys::Result<Ground> {
    load_ground(&job.entries(PartIndex::FIRST)?.store()?)
}

/// Returns a hash of the rule by which triangles along the hull may be slivers.
fn key_of_lengths(job: &Job) -> u64 {
    xxh3_64(&HullRule::of_lengths(job.plan).key().to_le_bytes())
}

/// Returns the key of the mesh of a part: the digest of its vertices, and of the long triangles on ground among them.
/// Which triangles flow is found with the mesh.
///
/// # Errors
/// As [`vertices_of`].
pub(crate) fn key_of_vertices(job: &Job, part: PartIndex) -> Result<u64> {
    if !selects(job.plan) {
        return Ok(listed_points_of(job, part)?.digest().wrapping_add(key_of_lengths(job)));
    }
    let vertices = selected_part(job, part)?.digest.wrapping_add(key_of_lengths(job));
    let is_of_part = |triangle: &&[Site; 3]| {
        triangle.iter().any(|&site| job.parts.part_of(job.parts.grid.bucket(site) as usize) == part)
    };
    let on_ground = job.plan.on_ground.get().into_iter().flat_map(|known| {
        known.iter().filter(is_of_part).map(|triangle| xxh3_64(bytemuck::bytes_of(triangle))).collect::<Vec<u64>>()
    });
    Ok(on_ground.fold(vertices, u64::wrapping_add))
}

/// Returns what is known of a part whose vertices are selected.
fn selected_part(job: &Job, part: PartIndex) -> sys::Result<SelectedPart> {
    job.entries(part)?.figures(JobStep::Select)
}

/// Returns the points of a part that are vertices: all, or those that are selected. `store` is that of the part.
///
/// # Errors
/// Those of [`points_of`]; [`sys::Error::Broken`] if they are not selected.
pub(crate) fn vertices_of<'a>(job: &Job<'a>, part: PartIndex, store: &Store) -> Result<PointsOfPart<'a>> {
    if !selects(job.plan) {
        return points_of(job, part);
    }
    let blocks = selected_part(job, part)?.blocks;
    checked(job, part, PointsOfPart::none(job.plan, job.parts, part).selected(store, blocks)?)
}
