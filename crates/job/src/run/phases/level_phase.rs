//! Step 7: the coarser tiles of a part, and those above the parts.

use crate::index::{NodeIndex, PartIndex};
use crate::levels::hierarchy::Hierarchy;
use crate::levels::make_level::{LevelContext, LevelStats, TopOf, level_memory, make_level};
use crate::partition::result::Partition;
use crate::plan::job_plan::Plan;
use crate::records::JobStep;
use crate::run::folder::{Folder, done_with, once};
use crate::run::job::Job;
use crate::run::phases::join::JoinedParts;
use crate::run::phases::outdated_levels::{
    MadeLevel, forget_outdated_levels, key_of_tiles, keys_of_levels, level_sizes,
};
use crate::tiles::style::TileStyle;
use rayon::prelude::*;
use std::collections::HashSet;
use sys::threads::on_threads;
use sys::{Error, Result, interrupt};

/// Makes the coarser tiles of `part`, unless that is done. If viewers get none, because the job has no tileset, notes that.
///
/// # Errors
/// Those of [`make_levels`]; [`crate::Error::InUse`] if another process has the part.
pub(crate) fn levels_of_part(
    job: &Job,
    joined: &JoinedParts,
    part: PartIndex,
    has_tileset: bool,
) -> crate::Result<LevelStats> {
    let hierarchy = hierarchy_of(job.plan, &job.open(part)?.partition);
    // The store of the part grows, so what is open now must not be used again.
    job.close(part);
    let no_other = |other: PartIndex| Err(Error::Broken(format!("part {part} has no tile of part {other}")));
    levels_over(job, joined, part, &hierarchy, has_tileset, &no_other)
}

/// Makes the coarser tiles of `hierarchy`, which is that of `part` or of the nodes above the parts, unless that is done. `top_of` returns the
/// topmost tiles of other parts.
///
/// # Errors
/// Those of [`make_levels`]; [`crate::Error::InUse`] if another process has the folder.
pub(crate) fn levels_over(
    job: &Job,
    joined: &JoinedParts,
    part: PartIndex,
    hierarchy: &Hierarchy,
    has_tileset: bool,
    top_of: TopOf,
) -> crate::Result<LevelStats> {
    let key = job.key(|| key_of_tiles(job, part, has_tileset))?;
    if let Some(done) = done_with(job, part, JobStep::Levels, key)? {
        return Ok(done.figures);
    }
    forget_outdated_levels(job, part, hierarchy, has_tileset)?;
    once(job, part, JobStep::Levels, key, |folder| match has_tileset {
        true => make_levels(job, folder, part, hierarchy, &joined.appearance.style, top_of),
        false => Ok(folder.record(JobStep::Levels, LevelStats::default(), Vec::new())?),
    })
}

/// Returns the coarser tiles of a part.
pub(crate) fn hierarchy_of(plan: &Plan, partition: &Partition) -> Hierarchy {
    let points: Vec<u64> = partition.tree.tiles().map(|tile| partition.points(tile)).collect();
    Hierarchy::new(&partition.tree, &points, level_sizes(plan))
}

/// Makes the coarser tiles of `hierarchy`, over the tree of `part`, in the folder of the part. Those of one height are made in parallel, as
/// many at a time as the memory has room for. `top_of` returns the topmost tiles of other parts.
///
/// # Errors
/// Those of [`make_level`]; [`Error::Io`] on the folder.
fn make_levels(
    job: &Job,
    folder: &Folder,
    part: PartIndex,
    hierarchy: &Hierarchy,
    style: &TileStyle,
    top_of: TopOf,
) -> crate::Result<LevelStats> {
    let (output, sizes) = (&job.plan.options.output, level_sizes(job.plan));
    let keys = keys_of_levels(job, part, hierarchy)?;
    let Folder { directory, store, journal, .. } = folder;
    let known: Vec<MadeLevel> = job.entries(part)?.all_figures::<Vec<MadeLevel>>(JobStep::LevelTiles)?.concat();
    let is_known: HashSet<NodeIndex> = known.iter().map(|made| made.node).collect();
    let stage = job.progress.stage("levels", (hierarchy.tiles.len() - is_known.len()) as u64, "tiles");
    let (meshes, keeps_meshes) = (output.levels, job.plan.options.updates);
    let context = LevelContext { directory, store, hierarchy, style, sizes, meshes, part, top_of, keeps_meshes };
    let make = |index: usize| {
        interrupt::check()?;
        let (stats, files) = make_level(&context, index)?;
        journal.add_files(&files);
        stage.advance(1);
        let (node, key) = (hierarchy.tiles[index].node, keys.get(index).copied().unwrap_or(0));
        Ok::<_, Error>(MadeLevel { node, key, stats })
    };
    let make_all =
        |tiles: Vec<usize>| tiles.into_par_iter().with_max_len(1).map(make).collect::<Result<Vec<MadeLevel>>>();
    let mut made = Vec::new();
    for mut height in hierarchy.by_height() {
        height.retain(|index| !is_known.contains(&hierarchy.tiles[*index].node));
        if !output.levels {
            made.extend(make_all(height)?);
            continue;
        }
        let batches = batches(&context, height, job.threads)?;
        for (tiles, threads) in batches.into_iter().filter(|(tiles, _)| !tiles.is_empty()) {
            // Threads keep the memory of the largest mesh that they have made, so each batch has its own.
            made.extend(on_threads(threads, || make_all(tiles))?);
        }
        // A level reads the tiles below, which must have their names.
        journal.name_files()?;
    }
    let mut stats = LevelStats::default();
    known.iter().chain(&made).for_each(|made| stats += made.stats);
    if job.plan.options.updates {
        folder.record(JobStep::LevelTiles, made, Vec::new())?;
    }
    Ok(folder.record(JobStep::Levels, stats, vec![stage.finish()])?)
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
