//! Steps 3 to 6 of a part whose points have all been read: leaves and merges, and the tiles that need no other part, each as soon as it is
//! finished.

use crate::Result;
use crate::durable::atomic_file::{remove_file, remove_tree};
use crate::index::{NodeIndex, PartIndex, TileIndex};
use crate::partition::point_file::PointFiles;
use crate::partition::result::Partition;
use crate::progress::stats::StageStats;
use crate::records::{JobStep, JournalEntry, RecordChanges, StepRecord, Store};
use crate::run::folder::{Folder, once};
use crate::run::job::Job;
use crate::run::meshed_part::{MeshedPart, SomeTiles};
use crate::run::phases::select_phase::{key_of_vertices, vertices_of};
use crate::run::phases::tile_queue::TileQueue;
use crate::run::phases::tree_walk::TreeWalk;
use crate::tiles::appearance::TileAppearance;
use std::collections::HashSet;
use std::sync::{Arc, Mutex};

/// Meshes a part whose points have all been read, unless that is done. With an `appearance` its finished tiles are written meanwhile.
/// Temporary files of other parts take `others` bytes; `None` where nothing tells.
///
/// # Errors
/// Those of the steps; [`crate::Error::DamagedSteps`] if the points are damaged; [`crate::Error::InUse`] if another process has the part.
pub(crate) fn mesh_one(
    job: &Job,
    part: PartIndex,
    appearance: Option<&Arc<TileAppearance>>,
    others: Option<u64>,
) -> Result<MeshedPart> {
    let key = job.key(|| key_of_vertices(job, part))?;
    let meshed = once(job, part, JobStep::Mesh, key, |folder| mesh(job, folder, part, appearance, others))?;
    match job.plan.options.updates {
        true => remove_divided_points(job, part)?,
        false => remove_tree(job.folder(part).points())?,
    }
    Ok(meshed)
}

fn mesh(
    job: &Job,
    folder: &Folder,
    part: PartIndex,
    appearance: Option<&Arc<TileAppearance>>,
    others: Option<u64>,
) -> Result<MeshedPart> {
    let max_points_per_tile = job.plan.options.triangulation.max_points_per_tile.0;
    let partition = vertices_of(job, part, &folder.store)?.partition(&folder.directory, max_points_per_tile)?;
    partition.save(&folder.store)?;
    let (mut meshed, tiles, stages) = mesh_in_tiles(job, folder, &partition, appearance)?;
    if !meshed.is_kept {
        free_inner_records(&folder.store, &partition, &tiles.written)?;
    }
    meshed.temporary = partition.point_bytes + folder.store.peak() + others.unwrap_or(0);
    meshed.stored = folder.store.bytes();
    let meshed = folder.done_now(meshed, stages);
    let [of_mesh, of_tiles] = by_style(folder.store.take_changes());
    // Another style needs the mesh, but not the tiles.
    let mut entries = vec![JournalEntry::new(JobStep::Mesh, &meshed, of_mesh)?];
    if appearance.is_some() {
        entries.push(JournalEntry::new(JobStep::Tiles, &folder.done_now(tiles, Vec::new()), of_tiles)?);
    }
    folder.record_all(entries)?;
    Ok(meshed.figures)
}

/// Removes the points of a part that no reader has written: those of crowded buckets, which are divided again, and the selected ones.
fn remove_divided_points(job: &Job, part: PartIndex) -> sys::Result<()> {
    let readers = job.parts.all().len();
    let written = job.folder(part).point_files()?.into_iter().filter(|(number, _)| usize::from(*number) >= readers);
    written.into_iter().try_for_each(|(_, path)| remove_file(&path))
}

/// Parts the records that hold for any style from those of tiles that are written.
fn by_style(changes: RecordChanges) -> [RecordChanges; 2] {
    let is_of_tile = |key| matches!(key, StepRecord::FinishedBorder(_) | StepRecord::Pixels(_) | StepRecord::Tile(_));
    let RecordChanges { written, dropped } = changes;
    let (of_tiles, of_mesh) = written.into_iter().partition(|record| is_of_tile(record.key()));
    [RecordChanges { written: of_mesh, dropped }, RecordChanges { written: of_tiles, dropped: Vec::new() }]
}

/// Triangulates all leaves of a part, merges their frontiers, and writes the tiles that are finished. Returns what is known of the mesh, of the
/// tiles, and the stages.
fn mesh_in_tiles(
    job: &Job,
    folder: &Folder,
    partition: &Partition,
    appearance: Option<&Arc<TileAppearance>>,
) -> Result<(MeshedPart, SomeTiles, Vec<StageStats>)> {
    let stage = job.progress.stage("mesh", partition.kept, "points");
    let activity = job.progress.activity("triangulate", "points");
    let queue = TileQueue::new(job, folder, partition, &stage, appearance.cloned());
    let points = PointFiles::open(&folder.directory.point_files()?)?;
    let unmerged = Mutex::default();
    let walk = TreeWalk { job, folder, partition, points, stage: &stage, activity: &activity, queue: &queue, unmerged };
    let leaves = rayon::scope(|scope| {
        let leaves = walk.walk(scope, NodeIndex::ROOT);
        queue.attempt(|| walk.check_memory());
        leaves
    });
    // This closes the point files: an open file is not freed when it is removed.
    drop(walk);
    let mut stages = vec![activity.finish()];
    let (tiles, open) = queue.finish(&mut stages)?;
    stage.finish();
    let meshed = MeshedPart {
        points: partition.kept,
        leaves: leaves.unwrap_or_default(),
        tiles: partition.blocks.len(),
        open,
        is_kept: job.plan.keeps_mesh(),
        by_task: job.is_task,
        ..MeshedPart::default()
    };
    Ok((meshed, tiles, stages))
}

/// Gives back what no phase needs any more once a part is meshed: all but the frontier of the part, and what the tiles need that are not
/// `written`.
fn free_inner_records(store: &Store, partition: &Partition, written: &[TileIndex]) -> sys::Result<()> {
    let tree = &partition.tree;
    let written: HashSet<TileIndex> = written.iter().copied().collect();
    let waiting = tree.tiles().filter(|tile| !written.contains(tile));
    let needed: HashSet<NodeIndex> = waiting.flat_map(|tile| tree.merges_above(tree.leaf(tile))).collect();
    for node in (1..tree.nodes.len()).map(NodeIndex::new).filter(|&node| tree.is_merge(node)) {
        store.free(StepRecord::Frontier(node))?;
        if !needed.contains(&node) {
            store.free(StepRecord::Seam(node))?;
        }
    }
    Ok(())
}
