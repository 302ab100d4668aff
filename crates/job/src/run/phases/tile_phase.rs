//! Steps 5 and 6 for tiles of parts that have waited for other parts.

use crate::index::{NodeIndex, PartIndex, TileIndex};
use crate::partition::result::Partition;
use crate::records::{JobStep, StepRecord, Store};
use crate::run::folder::Folder;
use crate::run::job::{Job, OpenPart};
use crate::run::phases::join::JoinedParts;
use crate::run::phases::tile_queue::{TileQueue, TilesBefore};
use crate::tiles::write_tile::TileStats;
use std::collections::HashSet;
use sys::Result;

/// Returns the tiles of a part that are not written yet.
pub(crate) fn waiting_tiles(OpenPart { partition, tiles, .. }: &OpenPart) -> TilesBefore {
    let mut waiting: TilesBefore = partition.tree.tiles().map(|tile| (tile, None)).collect();
    tiles.with_border.iter().for_each(|(tile, before)| _ = waiting.insert(*tile, Some(before.clone())));
    tiles.written.iter().for_each(|tile| _ = waiting.remove(tile));
    waiting
}

/// Writes the tiles of `part` that are not written yet. Returns the totals over all of them.
///
/// # Errors
/// Those of the steps; [`crate::Error::InUse`] if another process has the part.
pub(crate) fn finish_part(job: &Job, joined: &JoinedParts, part: PartIndex) -> crate::Result<TileStats> {
    if job.entries(part)?.tiles_left()? != Some(0) {
        write_waiting(job, joined, part, &HashSet::new(), None)?;
    }
    Ok(job.entries(part)?.tiles()?.stats)
}

/// Writes those of the tiles of `part` that have waited which no `open` tile keeps waiting. If the mesh is not kept, gives up what they needed;
/// the `outer` tiles of the part touch others. Returns the tiles that still wait, and the bytes that the store of the part kept before and keeps
/// now.
///
/// # Errors
/// Those of the steps; [`crate::Error::InUse`] if another process has the part.
pub(crate) fn write_waiting(
    job: &Job,
    joined: &JoinedParts,
    part: PartIndex,
    open: &HashSet<TileIndex>,
    outer: Option<&[TileIndex]>,
) -> crate::Result<(TilesBefore, [u64; 2])> {
    let folder = Folder::open(job, part, 0)?;
    // What was opened before may be from before another process wrote here, and the store grows from now on.
    job.close(part);
    let opened = job.open(part)?;
    job.close(part);
    let (mut waiting, before) = (waiting_tiles(&opened), folder.store.bytes());
    if waiting.is_empty() {
        return Ok((waiting, [before; 2]));
    }
    let stage = job.progress.stage("write tiles", waiting.len() as u64, "tiles");
    let partition = &opened.partition;
    let queue = TileQueue::after_merges(job, &folder, partition, &stage, joined, open, outer.is_some());
    rayon::scope(|scope| queue.push_waiting(scope, &waiting));
    let (mut some, _) = queue.finish(&mut Vec::new())?;
    // The journal knows the others.
    some.with_border.retain(|(tile, _)| waiting.get(tile) == Some(&None));
    some.with_border.iter().for_each(|(tile, before)| _ = waiting.insert(*tile, Some(before.clone())));
    some.written.iter().for_each(|tile| _ = waiting.remove(tile));
    if let Some(outer) = outer.filter(|_| waiting.is_empty()) {
        free_all_but(outer, &folder.store, partition)?;
    }
    folder.record(JobStep::Tiles, some, vec![stage.finish()])?;
    Ok((waiting, [before, folder.store.bytes()]))
}

/// Gives up what no phase needs any more once all tiles of a part are written: all but the borders of its `outer` tiles, which other parts may
/// still ask for.
fn free_all_but(outer: &[TileIndex], store: &Store, Partition { tree, .. }: &Partition) -> Result<()> {
    let mut inner = tree.tiles().filter(|tile| !outer.contains(tile));
    inner.try_for_each(|tile| store.free(StepRecord::FinishedBorder(tile)))?;
    (1..tree.nodes.len()).map(NodeIndex::new).try_for_each(|node| store.free(StepRecord::Seam(node)))
}
