//! Running step 7 for all coarser tiles.

use crate::Result;
use crate::job::levels::hierarchy::{Hierarchy, LevelSizes};
use crate::job::levels::make_level::{LevelRoom, LevelStats, level_memory, make_level};
use crate::job::partition::result::Partition;
use crate::job::plan::job_plan::Plan;
use crate::job::records::JobStep;
use crate::job::run::run_context::RunContext;
use crate::job::tiles::style::TileStyle;
use crate::threads::on_threads;
use rayon::prelude::*;

/// The coarser tiles of a job.
pub(crate) struct LevelResult {
    pub(crate) hierarchy: Hierarchy,
    pub(crate) stats: LevelStats,
    pub(crate) warning: Option<String>,
}

/// Makes the coarser tiles. Those of one height are made in parallel, as many at a time as the memory
/// has room for.
///
/// # Errors
/// Those of [`make_level`].
pub(crate) fn make_levels(
    run: &RunContext,
    plan: &Plan,
    partition: &Partition,
    style: &TileStyle,
) -> Result<LevelResult> {
    let output = &plan.options.output;
    let points: Vec<u64> = partition.tree.tiles().map(|tile| partition.points(tile)).collect();
    let sizes = LevelSizes::new(output.max_points_per_level_tile.0, plan.options.limits.memory.0);
    let hierarchy = Hierarchy::new(&partition.tree, &points, sizes);
    let stage = run.progress.stage("levels", hierarchy.tiles.len() as u64, "tiles");
    let room = LevelRoom {
        directory: run.directory,
        store: run.store,
        hierarchy: &hierarchy,
        style,
        sizes,
        meshes: output.levels,
    };
    let make = |index: usize| {
        let stats = run.journal.step(JobStep::Level(hierarchy.tiles[index].node), || make_level(&room, index))?;
        stage.advance(1);
        Ok(stats)
    };
    let sum = |mut a: LevelStats, b| {
        a += b;
        Ok(a)
    };
    let mut stats = LevelStats::default();
    for height in hierarchy.by_height() {
        if output.levels {
            // A level reads the tiles below, which must have their names.
            run.journal.commit()?;
        }
        for (tiles, threads) in batches(&room, height, run.threads)? {
            // Threads keep the memory of the largest mesh that they have made, so each batch has its own.
            let make_all = || tiles.into_par_iter().with_max_len(1).map(make).try_reduce(LevelStats::default, sum);
            stats += on_threads(threads, make_all)?;
        }
    }
    run.add_stage(stage.finish());
    let warning = left_out_warning(plan, &hierarchy, stats.left_out);
    Ok(LevelResult { hierarchy, stats, warning })
}

/// Divides coarser tiles into those that can be made on all `threads` at once and those that take more memory, each with the number of
/// threads.
fn batches(room: &LevelRoom, tiles: Vec<usize>, threads: usize) -> Result<[(Vec<usize>, usize); 2]> {
    let each = room.sizes.memory / threads as u64;
    let (mut small, mut large, mut largest) = (Vec::new(), Vec::new(), 1);
    for tile in tiles {
        match level_memory(room, tile)? {
            bytes if bytes <= each => small.push(tile),
            bytes => {
                largest = largest.max(bytes);
                large.push(tile);
            }
        }
    }
    Ok([(small, threads), (large, ((room.sizes.memory / largest) as usize).clamp(1, threads))])
}

fn left_out_warning(plan: &Plan, hierarchy: &Hierarchy, without: u64) -> Option<String> {
    (without > 0).then(|| {
        format!(
            "{without} of {} coarser tiles are left out, because the tiles below them have too many vertices for [limits] memory = \"{}\": \
             viewers load the finer ones at once; raise memory, lower [triangulation] max_points_per_tile, or cut less with \
             [output] max_edge",
            hierarchy.tiles.len(),
            plan.options.limits.memory
        )
    })
}
