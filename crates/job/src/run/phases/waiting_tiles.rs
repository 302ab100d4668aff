//! The front of a job that does its parts one after the other: the tiles that wait for parts to come. As soon as the parts around a tile
//! are merged, it is written, and what it needed is given back to the disk, unless the job keeps its mesh. So a job holds no more than its
//! front.

use crate::index::{NodeIndex, PartIndex, TileIndex};
use crate::records::StepRecord;
use crate::run::job::Job;
use crate::run::meshed_part::MeshedPart;
use crate::run::phases::join::{JoinedParts, merge_through};
use crate::run::phases::tile_phase::{BorderSession, TilesBefore, waiting_tiles};
use crate::tiles::appearance::TileAppearance;
use std::collections::{BTreeMap, HashSet};
use std::sync::Arc;
use sys::Result;

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
                let session = BorderSession::open(job, &joined, part, tiles.len())?;
                let before = session.store().bytes();
                let some = session.write_ready(tiles, open)?;
                if !meshed.is_kept {
                    free_written(&session, &some.written, tiles.is_empty().then_some(&meshed.open))?;
                }
                *stored = (*stored + session.finish(some)?).saturating_sub(before);
            }
        }
        self.waiting.retain(|_, (tiles, _)| !tiles.is_empty());
        Ok(())
    }
}

/// Gives up what `written` tiles needed. Once all tiles of a part are written, also what else no phase needs any more: all but the borders of
/// its `outer` tiles, which other parts may still ask for.
fn free_written(session: &BorderSession, written: &[TileIndex], outer: Option<&Vec<TileIndex>>) -> Result<()> {
    let (store, partition) = (session.store(), session.partition());
    let tree = &partition.tree;
    written.iter().flat_map(|&tile| partition.records_of_leaf(tile)).try_for_each(|record| store.free(record))?;
    let Some(outer) = outer else { return Ok(()) };
    let inner = tree.tiles().filter(|tile| !outer.contains(tile));
    inner.into_iter().try_for_each(|tile| store.free(StepRecord::FinishedBorder(tile)))?;
    (1..tree.nodes.len()).map(NodeIndex::new).try_for_each(|node| store.free(StepRecord::Seam(node)))
}
