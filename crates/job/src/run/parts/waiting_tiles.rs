//! The front of a job that does its parts one after the other: the tiles that wait for parts to come. As soon as the parts around a tile
//! are merged, it is written, and what it needed is given back to the disk. So a job holds no more than its front.

use crate::index::{NodeIndex, PartIndex, TileIndex};
use crate::partition::result::Partition;
use crate::progress::stats::StageStats;
use crate::records::{StepRecord, Store};
use crate::run::freeing::records_of_leaf;
use crate::run::parts::join::{JoinedParts, drop_damaged_merges, merge_through};
use crate::run::parts::meshed_part::MeshedPart;
use crate::run::parts::part_store::PartStores;
use crate::run::parts::parts_job::PartsJob;
use crate::run::parts::tile_phase::{BorderSession, ForeignBorders};
use crate::run::tile_queue::TileAppearance;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::sync::Arc;
use sys::Result;

/// The tiles of a part that are not written yet, each with the tiles that must be finished before it, if they are known.
type TilesBefore = BTreeMap<TileIndex, Option<Vec<TileIndex>>>;

/// A part with tiles that are not written yet.
struct WaitingPart {
    tiles: TilesBefore,
    /// The tiles that touch other parts.
    outer: HashSet<TileIndex>,
}

/// The tiles that wait for parts to come.
pub(crate) struct WaitingTiles<'a> {
    job: &'a PartsJob<'a>,
    stores: &'a PartStores,
    appearance: Arc<TileAppearance>,
    /// The tiles that merges may still change.
    open: HashSet<TileIndex>,
    waiting: BTreeMap<PartIndex, WaitingPart>,
    /// The bytes that the store of each part keeps.
    stored: HashMap<PartIndex, u64>,
    /// What writing tiles of each part took.
    pub(crate) stages: HashMap<PartIndex, StageStats>,
}

impl<'a> WaitingTiles<'a> {
    /// Returns the front before any part is done.
    ///
    /// # Errors
    /// [`sys::Error::Io`] on the folder of the merges.
    pub(crate) fn new(
        job: &'a PartsJob<'a>,
        stores: &'a PartStores,
        appearance: Arc<TileAppearance>,
    ) -> crate::Result<WaitingTiles<'a>> {
        if job.checks {
            drop_damaged_merges(job)?;
        }
        let (open, waiting) = (HashSet::new(), BTreeMap::new());
        Ok(WaitingTiles { job, stores, appearance, open, waiting, stored: HashMap::new(), stages: HashMap::new() })
    }

    /// Returns the bytes that all parts so far keep on the disk.
    pub(crate) fn stored(&self) -> u64 {
        self.stored.values().sum()
    }

    /// Takes `part`, which is meshed: merges what is complete now, and writes the tiles that have waited for that.
    ///
    /// # Errors
    /// Those of the steps.
    pub(crate) fn pass(&mut self, part: PartIndex, meshed: &MeshedPart) -> crate::Result<()> {
        let opened = self.stores.open(part)?;
        free_inner_records(&opened.store, &opened.partition, &meshed.waiting)?;
        self.stored.insert(part, opened.store.bytes());
        drop(opened);
        self.open.extend(&meshed.open);
        let tiles = meshed.waiting.iter().map(|&tile| (tile, None)).collect();
        self.waiting.insert(part, WaitingPart { tiles, outer: meshed.open.iter().copied().collect() });
        let finished = merge_through(self.job, self.stores, part)?;
        if finished.is_empty() {
            return Ok(());
        }
        finished.iter().for_each(|tile| {
            self.open.remove(tile);
        });
        self.write_ready_tiles()
    }

    fn write_ready_tiles(&mut self) -> crate::Result<()> {
        let WaitingTiles { job, stores, appearance, open, waiting, stored, stages } = self;
        let joined = JoinedParts::so_far(job, appearance.clone())?;
        let borders = &ForeignBorders::new(job, stores, &joined);
        for (&part, WaitingPart { tiles, outer }) in waiting.iter_mut() {
            let is_due = |(tile, neighbours): (&TileIndex, &Option<Vec<TileIndex>>)| {
                !open.contains(tile)
                    && neighbours.as_ref().is_none_or(|all| all.iter().all(|tile| !open.contains(tile)))
            };
            if !tiles.iter().any(is_due) {
                continue;
            }
            let directory = &job.directory.part(part);
            let session = BorderSession::begin(borders, directory, part, tiles.len())?;
            let before = session.store().bytes();
            write_ready(&session, tiles, open)?;
            if tiles.is_empty() {
                free_inner_borders(&session, outer)?;
            }
            let kept = stored.entry(part).or_default();
            *kept = (*kept + session.store().bytes()).saturating_sub(before);
            let stage = session.end()?;
            stages.entry(part).and_modify(|all| all.add(&stage)).or_insert(stage);
        }
        waiting.retain(|_, part| !part.tiles.is_empty());
        Ok(())
    }
}

/// Finishes the borders of those of the `waiting` tiles that are not `open`, writes those whose neighbours are not open either, and takes
/// them away.
fn write_ready(session: &BorderSession, waiting: &mut TilesBefore, open: &HashSet<TileIndex>) -> Result<()> {
    let finished: Vec<TileIndex> = waiting.keys().copied().filter(|tile| !open.contains(tile)).collect();
    let mut ready = Vec::new();
    for (tile, neighbours) in session.finish_borders(&finished)? {
        match neighbours.iter().any(|other| open.contains(other)) {
            true => drop(waiting.insert(tile, Some(neighbours))),
            false => ready.push(tile),
        }
    }
    session.write_tiles(&ready)?;
    session.make_durable()?;
    for tile in ready {
        waiting.remove(&tile);
        let records = records_of_leaf(session.partition(), tile);
        records.into_iter().try_for_each(|record| session.store().free(record))?;
    }
    Ok(())
}

/// Gives back what no step needs any more once all tiles of a part are written: all but the borders of its `outer` tiles, which other parts
/// may still ask for.
fn free_inner_borders(session: &BorderSession, outer: &HashSet<TileIndex>) -> Result<()> {
    let (store, tree) = (session.store(), &session.partition().tree);
    let inner = tree.tiles().filter(|tile| !outer.contains(tile));
    inner.into_iter().try_for_each(|tile| store.free(StepRecord::FinishedBorder(tile)))?;
    (0..tree.nodes.len()).map(NodeIndex::new).try_for_each(|node| store.free(StepRecord::Seam(node)))
}

/// Gives back what no step needs any more once a part is meshed, and which is so in any later run: all but the frontier of the part, and
/// what its `waiting` tiles need.
fn free_inner_records(store: &Store, partition: &Partition, waiting: &[TileIndex]) -> Result<()> {
    let tree = &partition.tree;
    let waiting: HashSet<TileIndex> = waiting.iter().copied().collect();
    let mut unneeded: Vec<StepRecord> = Vec::new();
    let mut needed = HashSet::from([NodeIndex::ROOT]);
    for tile in tree.tiles() {
        match waiting.contains(&tile) {
            true => needed.extend(tree.merges_above(tree.leaf(tile))),
            false => unneeded.extend(records_of_leaf(partition, tile)),
        }
    }
    for node in (1..tree.nodes.len()).map(NodeIndex::new).filter(|&node| tree.is_merge(node)) {
        unneeded.push(StepRecord::Frontier(node));
        unneeded.extend((!needed.contains(&node)).then_some(StepRecord::Seam(node)));
    }
    // A part of one tile passes up the frontier of its leaf.
    unneeded.retain(|&record| record != StepRecord::Frontier(NodeIndex::ROOT));
    unneeded.into_iter().try_for_each(|record| store.free(record))
}
