//! Coarser tiles of an update: those stay whose finer tiles are as they were.

use crate::Result;
use crate::index::{NodeIndex, PartIndex, TileIndex};
use crate::levels::hierarchy::{ChildTile, CoarseTile, Hierarchy, LevelSizes};
use crate::levels::make_level::LevelStats;
use crate::plan::job_plan::Plan;
use crate::records::{JobStep, StepRecord};
use crate::run::job::Job;
use crate::run::part_entries::Done;
use serde::{Deserialize, Serialize};
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use tiles::checksums::Checksum;
use xxhash_rust::xxh3::Xxh3;

/// A coarser tile that is made, with `--update`.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct MadeLevel {
    pub(crate) node: NodeIndex,
    /// A hash of the checksums of the tiles below it.
    pub(crate) key: u64,
    pub(crate) stats: LevelStats,
}

/// Returns the key of the coarser tiles of `part`, or of those above the parts: a hash of the checksums of the exact ones, and of what coarser
/// ones are made of them (none unless `has_tileset`).
///
/// # Errors
/// [`sys::Error::Io`] if a journal cannot be read.
pub(crate) fn key_of_tiles(job: &Job, part: PartIndex, has_tileset: bool) -> sys::Result<u64> {
    let mut hasher = hasher_of_levels(job, has_tileset);
    for part in job.parts.all().filter(|below| *below == part || part == job.above()) {
        let entries = job.entries(part)?;
        let mut files: Vec<_> = entries.files(Some(JobStep::Tiles)).collect();
        files.sort_unstable_by(|a, b| a.name.cmp(&b.name));
        let lines = files.into_iter().map(|file| format!("{} {}\n", file.name.display(), file.checksum));
        lines.for_each(|line| hasher.update(line.as_bytes()));
    }
    Ok(hasher.digest())
}

/// Returns a hasher that has what all coarser tiles of a job depend on besides finer ones.
fn hasher_of_levels(job: &Job, has_tileset: bool) -> Xxh3 {
    let LevelSizes { sites, memory } = level_sizes(job.plan);
    let mut hasher = Xxh3::new();
    [sites, memory, u64::from(has_tileset)].iter().for_each(|value| hasher.update(&value.to_le_bytes()));
    hasher
}

/// Returns how large the coarser tiles of a job are to be.
pub(crate) fn level_sizes(plan: &Plan) -> LevelSizes {
    LevelSizes::new(plan.options.output.max_points_per_level_tile.0, plan.options.limits.memory.0)
}

/// Returns the key of each coarser tile of `hierarchy`, which is that of `part`, with `--update`; none else.
///
/// # Errors
/// [`sys::Error::Io`] if a journal cannot be read.
pub(crate) fn keys_of_levels(job: &Job, part: PartIndex, hierarchy: &Hierarchy) -> sys::Result<Vec<u64>> {
    if !job.plan.options.updates {
        return Ok(Vec::new());
    }
    let entries = job.entries(part)?;
    let files = entries.files(Some(JobStep::Tiles));
    let checksums: HashMap<&Path, Checksum> = files.map(|file| (file.name.as_path(), file.checksum)).collect();
    let line_of = |tile: TileIndex| {
        let name = job.directory.name(&job.directory.output().tile(tile.number()));
        format!("{}\n", checksums.get(name.as_path()).map(Checksum::to_string).unwrap_or_default())
    };
    let mut keys = vec![0u64; hierarchy.tiles.len()];
    for index in hierarchy.by_height().into_iter().flatten() {
        let mut hasher = hasher_of_levels(job, true);
        let CoarseTile { children, sharing, .. } = &hierarchy.tiles[index];
        let of_others =
            sharing.iter().filter(|other| **other != index).flat_map(|other| &hierarchy.tiles[*other].children);
        for &child in children.iter().chain(of_others) {
            match child {
                ChildTile::Exact(tile) => hasher.update(line_of(tile).as_bytes()),
                ChildTile::Coarse(finer) => hasher.update(&keys[finer].to_le_bytes()),
                ChildTile::Part(part) => hasher.update(&key_of_tiles(job, part, true)?.to_le_bytes()),
            }
        }
        keys[index] = hasher.digest();
    }
    Ok(keys)
}

/// With `--update`, takes the coarser tiles whose finer tiles are others now out of the journal of `part`, or of the nodes
/// above the parts; all of them unless the job `has_tileset`.
///
/// # Errors
/// [`sys::Error::Io`] on the folder, [`crate::Error::InUse`] if another process has it.
pub(super) fn forget_outdated_levels(
    job: &Job,
    part: PartIndex,
    hierarchy: &Hierarchy,
    has_tileset: bool,
) -> Result<()> {
    if !job.plan.options.updates {
        return Ok(());
    }
    let keys = if has_tileset { keys_of_levels(job, part, hierarchy)? } else { Vec::new() };
    let keys: HashMap<NodeIndex, u64> = hierarchy.tiles.iter().map(|tile| tile.node).zip(keys).collect();
    let is_whole = |made: &MadeLevel| keys.get(&made.node) == Some(&made.key);
    job.rewrite(part, |mut entry| {
        if entry.step != JobStep::LevelTiles {
            return Ok((entry.step != JobStep::Levels).then_some(entry));
        }
        let mut done = entry.figures::<Done<Vec<MadeLevel>>>()?;
        let gone: HashSet<NodeIndex> =
            done.figures.iter().filter(|made| !is_whole(made)).map(|made| made.node).collect();
        let name = |node: &NodeIndex| job.directory.name(&job.directory.output().level(part.node_number(*node)));
        let names: HashSet<PathBuf> = gone.iter().map(name).collect();
        done.figures.retain(is_whole);
        entry.files.retain(|file| !names.contains(&file.name));
        let is_of_gone = |key: StepRecord| matches!(key, StepRecord::Level(node) | StepRecord::LevelMesh(node) if gone.contains(&node));
        entry.changes.written.retain(|record| !is_of_gone(record.key()));
        entry.with_figures(&done).map(Some)
    })
}
