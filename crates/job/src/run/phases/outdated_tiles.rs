//! Tiles of an update that are to be written again although their part has not changed: those that a part with another mesh touches, and the
//! neighbours whose borders they show.

use crate::Result;
use crate::index::{PartIndex, TileIndex};
use crate::records::{JobStep, StepRecord};
use crate::run::job::Job;
use crate::run::meshed_part::{SomeTiles, WaitedTile};
use crate::run::part_entries::Done;
use crate::run::phases::join::JoinedParts;
use rayon::prelude::*;
use std::collections::HashSet;
use std::path::PathBuf;

/// Takes the tiles that are outdated out of the journals of their parts, with `--update`. All parts are meshed and joined.
///
/// # Errors
/// [`sys::Error::Io`] or [`sys::Error::Broken`] on a folder, [`crate::Error::InUse`] if another process has one.
pub(crate) fn forget_outdated_tiles(job: &Job, joined: &JoinedParts) -> Result<()> {
    if !job.plan.options.updates {
        return Ok(());
    }
    let parts: Vec<PartIndex> = job.parts.all().collect();
    let tiles_of = |&part: &PartIndex| job.entries(part)?.tiles();
    let known = parts.par_iter().map(tiles_of).collect::<sys::Result<Vec<SomeTiles>>>()?;
    let written: HashSet<TileIndex> = known.iter().flat_map(|tiles| &tiles.written).copied().collect();
    let waited: Vec<&WaitedTile> = known.iter().flat_map(|tiles| &tiles.waited).collect();
    let is_changed = |tile: &&WaitedTile| Ok((tile.tile, joined.key_of_tile(job, tile.tile)? != tile.key));
    let judged = waited.par_iter().map(is_changed).collect::<sys::Result<Vec<(TileIndex, bool)>>>()?;
    let changed: HashSet<TileIndex> =
        judged.into_iter().filter(|(_, changed)| *changed).map(|(tile, _)| tile).collect();
    // The tiles of a part with another mesh are not written yet.
    let is_other = |tile: &TileIndex| changed.contains(tile) || !written.contains(tile);
    for (&part, tiles) in parts.iter().zip(&known) {
        let outdated = tiles.waited.iter().filter(|tile| is_other(&tile.tile) || tile.neighbours.iter().any(is_other));
        let outdated: HashSet<TileIndex> = outdated.map(|tile| tile.tile).collect();
        if !outdated.is_empty() {
            forget_tiles(job, part, &outdated)?;
        }
    }
    Ok(())
}

fn forget_tiles(job: &Job, part: PartIndex, outdated: &HashSet<TileIndex>) -> Result<()> {
    let output = job.directory.output();
    let paths = outdated.iter().flat_map(|tile| [output.tile(tile.number()), output.cut_tile(tile.number())]);
    let names: HashSet<PathBuf> = paths.map(|path| job.directory.name(&path)).collect();
    job.rewrite(part, |mut entry| {
        if entry.step != JobStep::Tiles {
            return Ok(Some(entry));
        }
        let mut done = entry.figures::<Done<SomeTiles>>()?;
        let SomeTiles { stats, written, waited, .. } = &mut done.figures;
        if waited.is_empty() {
            // The tiles that have not waited depend on no other part.
            return Ok(Some(entry));
        }
        waited.retain(|tile| !outdated.contains(&tile.tile));
        written.retain(|tile| !outdated.contains(tile));
        *stats = waited.iter().map(|tile| tile.stats).sum();
        entry.files.retain(|file| !names.contains(&file.name));
        entry.changes.written.retain(|record| match record.key() {
            StepRecord::FinishedBorder(tile) | StepRecord::Pixels(tile) | StepRecord::Tile(tile) => {
                !outdated.contains(&tile)
            }
            _ => true,
        });
        entry.with_figures(&done).map(Some)
    })
}
