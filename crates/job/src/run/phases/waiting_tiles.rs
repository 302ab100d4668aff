//! The front of a job that does its parts one after the other: the tiles that wait for parts to come. As soon as the parts around a tile
//! are merged, it is written, and what it needed is given back to the disk, unless the job keeps its mesh. So a job holds no more than its
//! front.

use crate::index::{PartIndex, TileIndex};
use crate::run::job::Job;
use crate::run::meshed_part::MeshedPart;
use crate::run::phases::join::{JoinedParts, merge_through};
use crate::run::phases::tile_phase::{waiting_tiles, write_waiting};
use crate::run::phases::tile_queue::TilesBefore;
use crate::tiles::appearance::TileAppearance;
use std::collections::{BTreeMap, HashSet};
use std::sync::Arc;

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
