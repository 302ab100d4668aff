//! Running step 7 for all coarser tiles.

use crate::Result;
use crate::job::levels::hierarchy::{Hierarchy, LevelSizes};
use crate::job::levels::make_level::{LevelRoom, LevelStats, make_level};
use crate::job::levels::shared_memory::SharedMemory;
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
    let memory = SharedMemory::new(sizes.memory);
    let room = LevelRoom {
        directory: run.directory,
        store: run.store,
        hierarchy: &hierarchy,
        style,
        sizes,
        memory: output.levels.then_some(&memory),
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
    let stats = on_threads(run.threads, || {
        let mut all = LevelStats::default();
        for height in hierarchy.by_height() {
            if output.levels {
                // A level reads the tiles below, which must have their names.
                run.journal.commit()?;
            }
            all += height.into_par_iter().with_max_len(1).map(make).try_reduce(LevelStats::default, sum)?;
        }
        Ok(all)
    })?;
    run.add_stage(stage.finish());
    let warning = left_out_warning(plan, &hierarchy, stats.left_out);
    Ok(LevelResult { hierarchy, stats, warning })
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
