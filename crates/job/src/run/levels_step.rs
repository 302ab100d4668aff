//! Running step 7 for all coarser tiles.

use crate::index::PartIndex;
use crate::levels::hierarchy::{Hierarchy, LevelSizes};
use crate::levels::make_level::{LevelContext, LevelStats, TopOf, level_memory, make_level};
use crate::partition::result::Partition;
use crate::plan::job_plan::Plan;
use crate::records::JobStep;
use crate::run::run_context::RunContext;
use crate::tiles::style::TileStyle;
use rayon::prelude::*;
use sys::Result;
use sys::threads::on_threads;

/// The coarser tiles of a job, or of a part.
pub(crate) struct LevelResult {
    pub(crate) hierarchy: Hierarchy,
    pub(crate) stats: LevelStats,
}

/// Returns how large the coarser tiles of a job are to be.
pub(crate) fn level_sizes(plan: &Plan) -> LevelSizes {
    LevelSizes::new(plan.options.output.max_points_per_level_tile.0, plan.options.limits.memory.0)
}

/// Returns the coarser tiles of a part.
pub(crate) fn hierarchy_of(plan: &Plan, partition: &Partition) -> Hierarchy {
    let points: Vec<u64> = partition.tree.tiles().map(|tile| partition.points(tile)).collect();
    Hierarchy::new(&partition.tree, &points, level_sizes(plan))
}

/// Makes the coarser tiles of `hierarchy`, over the tree of `part`. Those of one height are made in parallel, as many at a time as the
/// memory has room for. `top_of` returns the topmost tiles of other parts.
///
/// # Errors
/// Those of [`make_level`].
pub(crate) fn make_levels(
    run: &RunContext,
    plan: &Plan,
    part: PartIndex,
    hierarchy: Hierarchy,
    style: &TileStyle,
    top_of: TopOf,
) -> Result<LevelResult> {
    let output = &plan.options.output;
    let sizes = level_sizes(plan);
    let stage = run.progress.stage("levels", hierarchy.tiles.len() as u64, "tiles");
    let (directory, store) = (run.directory, run.store);
    let context =
        LevelContext { directory, store, hierarchy: &hierarchy, style, sizes, meshes: output.levels, part, top_of };
    let make = |index: usize| {
        let stats = run.journal.step(JobStep::Level(hierarchy.tiles[index].node), || make_level(&context, index))?;
        stage.advance(1);
        Ok(stats)
    };
    let sum = |mut a: LevelStats, b| {
        a += b;
        Ok(a)
    };
    let make_all =
        |tiles: Vec<usize>| tiles.into_par_iter().with_max_len(1).map(make).try_reduce(LevelStats::default, sum);
    let mut stats = LevelStats::default();
    for height in hierarchy.by_height() {
        if !output.levels {
            stats += make_all(height)?;
            continue;
        }
        // A level reads the tiles below, which must have their names.
        run.journal.commit()?;
        for (tiles, threads) in
            batches(&context, height, run.threads)?.into_iter().filter(|(tiles, _)| !tiles.is_empty())
        {
            // Threads keep the memory of the largest mesh that they have made, so each batch has its own.
            stats += on_threads(threads, || make_all(tiles))?;
        }
    }
    run.add_stage(stage.finish());
    Ok(LevelResult { hierarchy, stats })
}

/// Divides coarser tiles into those that can be made on all `threads` at once and those that take more memory, each with the number of
/// threads.
fn batches(context: &LevelContext, tiles: Vec<usize>, threads: usize) -> Result<[(Vec<usize>, usize); 2]> {
    let each = context.sizes.memory / threads as u64;
    let (mut small, mut large, mut largest) = (Vec::new(), Vec::new(), 1);
    for tile in tiles {
        match level_memory(context, tile)? {
            bytes if bytes <= each => small.push(tile),
            bytes => {
                largest = largest.max(bytes);
                large.push(tile);
            }
        }
    }
    Ok([(small, threads), (large, ((context.sizes.memory / largest) as usize).clamp(1, threads))])
}

/// Returns what the user should know about coarser tiles without a mesh.
pub(crate) fn left_out_warning(plan: &Plan, levels: &LevelStats) -> Option<String> {
    (levels.left_out > 0).then(|| {
        format!(
            "{} of {} coarser tiles are left out, because the tiles below them have too many vertices for [limits] memory = \"{}\": \
             viewers load the finer ones at once; raise memory, lower [triangulation] max_points_per_tile, or cut less with \
             [output] max_edge",
            levels.left_out,
            levels.files + levels.left_out,
            plan.options.limits.memory
        )
    })
}
