//! Running steps 3 to 6 at the same time: tiles that no node above can change are finished and written while others are still
//! triangulated and merged.

use crate::durable::journal::JournalPosition;
use crate::index::{NodeIndex, TileIndex};
use crate::mesh::leaf::LeafStats;
use crate::partition::point_file::PointFiles;
use crate::partition::result::Partition;
use crate::plan::job_plan::Plan;
use crate::preflight::estimate::has_room_besides_points;
use crate::preflight::kept_points::KeptPoints;
use crate::publish::one_file_limits::MAX_TRIANGLES_IN_ONE_FILE;
use crate::records::{JobStep, Leaf};
use crate::run::freeing::{Freeing, frees, while_freeing};
use crate::run::postponed_merges::PostponedMerges;
use crate::run::run_context::RunContext;
use crate::run::tile_queue::{TileAppearance, TileQueue, WrittenTiles};
use crate::run::tree_walk::TreeWalk;
use crate::tiles::max_edge::MaxEdgeRule;
use delaunay::geometry::Bounds;
use rayon::prelude::*;
use std::sync::Arc;
use sys::threads::run_concurrently;
use sys::{Error, Result};
use tiles::options::MaxEdge;

/// The mesh of a part, written as tiles as far as it is finished.
pub(crate) struct MeshInTiles {
    pub(crate) leaves: LeafStats,
    pub(crate) tiles: WrittenTiles,
    /// Where the journal has all leaves and merges.
    pub(crate) all_leaves: JournalPosition,
}

/// When tiles may be written.
pub(crate) enum Writing<'a> {
    /// As soon as they are finished.
    AtOnce(Arc<TileAppearance>),
    /// Once all leaves are done: then the number of sites tells how tiles look.
    AfterLeaves(&'a (dyn Fn(u64) -> Result<Arc<TileAppearance>> + Sync)),
    /// Not before the whole job is triangulated.
    Later,
}

/// Triangulates all leaves of a job of one part, merges their frontiers and writes the tiles. Its points are within `bounds`.
///
/// # Errors
/// Those of the four steps, and of [`while_freeing`].
pub(crate) fn mesh_and_tiles(
    run: &RunContext,
    plan: &Plan,
    partition: &Partition,
    bounds: Bounds<3>,
) -> crate::Result<MeshInTiles> {
    let appearance = |sites| {
        let max_edge = max_edge_rule(run, plan, partition, bounds, sites)?;
        TileAppearance::new(plan, partition.summary.counts.max_rgb, bounds, max_edge).map(Arc::new)
    };
    let writing = match may_write_at_once(plan, KeptPoints(partition.summary.counts.kept), frees(plan, partition)) {
        // The number of sites matters only to a rule for which the tiles have to wait.
        true => Writing::AtOnce(appearance(0)?),
        false => Writing::AfterLeaves(&appearance),
    };
    let mesh = mesh_part(run, plan, partition, writing)?;
    match mesh.tiles.waiting.len() {
        0 => Ok(mesh),
        waiting => Err(Error::Broken(format!("{waiting} tiles were not written")).into()),
    }
}

/// Triangulates all leaves of a part, merges their frontiers, and writes the tiles that are finished: all of them if the part is the
/// whole job.
///
/// # Errors
/// Those of the four steps, and of [`while_freeing`].
pub(crate) fn mesh_part(
    run: &RunContext,
    plan: &Plan,
    partition: &Partition,
    writing: Writing,
) -> crate::Result<MeshInTiles> {
    while_freeing(run, plan, partition, |freeing| do_steps(run, plan, partition, writing, freeing))
}

fn do_steps(
    run: &RunContext,
    plan: &Plan,
    partition: &Partition,
    writing: Writing,
    freeing: &Freeing,
) -> crate::Result<MeshInTiles> {
    let points = partition.tree.tiles().map(|tile| partition.points(tile)).sum();
    let stage = run.progress.stage("mesh", points, "points");
    let activity = run.progress.activity("triangulate", "points");
    let queue = TileQueue::new(run, partition, &stage, freeing);
    let points = open_points(run, partition)?;
    let unmerged = PostponedMerges::default();
    let walk =
        TreeWalk { run, plan, partition, points, stage: &stage, activity: &activity, queue: &queue, freeing, unmerged };
    let walked = rayon::scope(|scope| {
        if let Writing::AtOnce(appearance) = &writing {
            queue.begin(scope, appearance.clone());
        }
        let leaves = walk.walk(scope, NodeIndex::ROOT)?;
        queue.attempt(|| walk.unmerged.check(&plan.options))?;
        let all_leaves = run.journal.position();
        // This closes the point files: an open file is not freed when it is removed.
        drop(walk);
        if let Writing::AfterLeaves(appearance) = writing {
            // Not while tiles are written: on a small disk the results need the room.
            let appearance = || run_concurrently(|| run.remove_points(all_leaves), || appearance(leaves.sites));
            queue.attempt(|| appearance().map(|appearance| queue.begin(scope, appearance)))?;
        }
        Some((leaves, all_leaves))
    });
    run.add_stage(activity.finish());
    let tiles = queue.finish()?;
    let (leaves, all_leaves) = walked.unwrap_or_default();
    stage.finish();
    Ok(MeshInTiles { leaves, tiles, all_leaves })
}

/// Opens the point files if a leaf is still to be done.
fn open_points(run: &RunContext, partition: &Partition) -> Result<Option<PointFiles>> {
    let all_done = partition.tree.tiles().all(|tile| run.journal.has(JobStep::Leaf(tile)));
    if all_done { Ok(None) } else { PointFiles::open(&run.directory.point_files()?).map(Some) }
}

/// Tells whether tiles may be written before all are triangulated. They must wait if all sites decide how a tile looks, and if the
/// disk has no room for them besides the points. But points that are freed meanwhile make room.
fn may_write_at_once(plan: &Plan, kept: KeptPoints, frees: bool) -> bool {
    let has_room = || frees || has_room_besides_points(plan, kept, MAX_TRIANGLES_IN_ONE_FILE);
    plan.options.output.max_edge != MaxEdge::Auto && has_room()
}

/// Returns the rule that leaves triangles out.
fn max_edge_rule(
    run: &RunContext,
    plan: &Plan,
    partition: &Partition,
    bounds: Bounds<3>,
    sites: u64,
) -> Result<MaxEdgeRule> {
    if partition.tree.tiles().all(|tile| run.journal.has(JobStep::WriteTile(tile))) {
        // No step needs the rule, and the leaves that it counts may be gone.
        return Ok(MaxEdgeRule::KeepAll);
    }
    let visit_sites = |visit: &(dyn Fn(&[i32; 3]) + Sync)| {
        let tiles: Vec<TileIndex> = partition.tree.tiles().collect();
        tiles.into_par_iter().try_for_each(|tile| Leaf::visit_positions(run.store, tile, visit))
    };
    MaxEdgeRule::new(plan.options.output.max_edge, &plan.frame, sites, bounds, &visit_sites)
}
