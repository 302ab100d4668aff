//! Steps 5 and 6 for tiles of parts that have waited for other parts.
//!
//! A job that does its parts one after the other has a front: the tiles that wait for parts to come. As soon as the parts around a tile are
//! merged, it is written, and what it needed is given back to the disk, unless the job keeps its mesh. So a job holds no more than its front.

use crate::index::{NodeIndex, PartIndex, TileIndex};
use crate::partition::result::Partition;
use crate::records::{JobStep, StepRecord, Store};
use crate::run::folder::Folder;
use crate::run::job::{Job, OpenPart};
use crate::run::meshed_part::MeshedPart;
use crate::run::phases::join::{JoinedParts, merge_through};
use crate::run::phases::tile_queue::{TileQueue, TilesBefore};
use crate::tiles::appearance::TileAppearance;
use crate::tiles::write_tile::TileStats;
use std::collections::{BTreeMap, HashSet};
use std::sync::Arc;
use sys::Result;

/// Returns the tiles of a part that are not written yet.
fn waiting_tiles(OpenPart { partition, tiles, .. }: &OpenPart) -> TilesBefore {
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
fn write_waiting(
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

/// The tiles that wait for parts to come.
pub(crate) struct WaitingTiles<'a> {
    job: &'a Job<'a>,
    appearance: Arc<TileAppearance>,
    /// The tiles that merges may still change.
    open: HashSet<TileIndex>,
    /// The parts with tiles that are not written yet.
    waiting: BTreeMap<PartIndex, (TilesBefore, MeshedPart)>,
}

impl<'a> WaitingTiles<'a> {
    /// Returns the front before any part is done.
    pub(crate) fn new(job: &'a Job<'a>, appearance: Arc<TileAppearance>) -> WaitingTiles<'a> {
        WaitingTiles { job, appearance, open: HashSet::new(), waiting: BTreeMap::new() }
    }

    /// Takes `part`, which is `meshed`: merges what is complete now, and writes the tiles that have waited for that. Corrects `stored`, the bytes
    /// that all parts so far keep on the disk.
    ///
    /// # Errors
    /// Those of the steps.
    pub(crate) fn pass(&mut self, part: PartIndex, meshed: MeshedPart, stored: &mut u64) -> crate::Result<()> {
        self.open.extend(&meshed.open);
        self.waiting.insert(part, (waiting_tiles(&*self.job.open(part)?), meshed));
        for tile in merge_through(self.job, part)? {
            self.open.remove(&tile);
        }
        self.write_ready_tiles(stored)
    }

    fn write_ready_tiles(&mut self, stored: &mut u64) -> crate::Result<()> {
        let WaitingTiles { job, appearance, open, waiting } = self;
        let is_due = |(tile, before): (&TileIndex, &Option<Vec<TileIndex>>)| {
            let all = before.iter().flatten().chain([tile]);
            all.into_iter().all(|tile| !open.contains(tile))
        };
        let mut due = waiting.iter_mut().filter(|(_, (tiles, _))| tiles.iter().any(is_due)).peekable();
        if due.peek().is_some() {
            let joined = JoinedParts::so_far(job, appearance.clone())?;
            for (&part, (tiles, meshed)) in due {
                let outer = (!meshed.is_kept).then_some(meshed.open.as_slice());
                let (waiting, [before, after]) = write_waiting(job, &joined, part, open, outer)?;
                *stored = (*stored + after).saturating_sub(before);
                *tiles = waiting;
            }
        }
        self.waiting.retain(|_, (tiles, _)| !tiles.is_empty());
        Ok(())
    }
}
