//! Steps 5 and 6 for tiles of parts that have waited for other parts.

use crate::index::{PartIndex, TileIndex};
use crate::merge_records::SeamOfTile;
use crate::partition::result::Partition;
use crate::progress::stage::Stage;
use crate::records::{FinishedBorder, JobStep, StepRecord, Store};
use crate::run::folder::Folder;
use crate::run::job::{Job, OpenPart};
use crate::run::meshed_part::{SomeTiles, WaitedTile};
use crate::run::phases::join::JoinedParts;
use crate::tiles::appearance::TileAppearance;
use crate::tiles::border_normals::{finish_border_normals, finished_border};
use crate::tiles::write_tile::{TileStats, write_tile};
use rayon::prelude::*;
use std::collections::{BTreeMap, HashSet};
use std::sync::{Arc, PoisonError};
use sys::{Result, interrupt};

/// The tiles of a part that are not written yet, each with the tiles that must be finished before it, if they are known.
pub(crate) type TilesBefore = BTreeMap<TileIndex, Option<Vec<TileIndex>>>;

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
    let entries = job.entries(part)?;
    let left = entries.tiles_left()?;
    if left == Some(0) {
        return Ok(entries.tiles()?.stats);
    }
    let session = BorderSession::open(job, joined, part, left.unwrap_or_default())?;
    // What another process has written since is in the journal that is locked now.
    let (mut all, mut waiting) = (session.open.tiles.stats, waiting_tiles(&session.open));
    if !waiting.is_empty() {
        let written = session.write_ready(&mut waiting, &HashSet::new())?;
        all += written.stats;
        session.finish(written)?;
    }
    Ok(all)
}

/// A part whose waiting tiles this process writes.
pub(crate) struct BorderSession<'a> {
    job: &'a Job<'a>,
    joined: &'a JoinedParts,
    folder: Folder,
    open: Arc<OpenPart>,
    part: PartIndex,
    stage: Stage,
}

impl<'a> BorderSession<'a> {
    /// Opens the folder of `part`, which is `directory`, to write some of `tiles` tiles.
    ///
    /// # Errors
    /// [`sys::Error::Io`] or [`sys::Error::Broken`] on the folder, [`crate::Error::InUse`] if another process has the part.
    pub(crate) fn open(
        job: &'a Job<'a>,
        joined: &'a JoinedParts,
        part: PartIndex,
        tiles: usize,
    ) -> crate::Result<BorderSession<'a>> {
        let folder = Folder::open(job, part, 0)?;
        // What was opened before may be from before another process wrote here, and the store grows from now on.
        job.close(part);
        let open = job.open(part)?;
        job.close(part);
        let stage = job.progress.stage("write tiles", tiles as u64, "tiles");
        Ok(BorderSession { job, joined, folder, open, part, stage })
    }

    pub(crate) fn store(&self) -> &Store {
        &self.folder.store
    }

    pub(crate) fn partition(&self) -> &Partition {
        &self.open.partition
    }

    fn seam(&self, tile: TileIndex) -> Result<SeamOfTile> {
        self.joined.seam_of(self.job, self.store(), &self.partition().tree, tile)
    }

    /// Finishes the borders of those of the `waiting` tiles that are not `open`, because no merge can change them any more. Writes those whose
    /// neighbours are not open either, and takes them away.
    ///
    /// # Errors
    /// Those of [`finish_border_normals`] and [`write_tile`].
    pub(crate) fn write_ready(&self, waiting: &mut TilesBefore, open: &HashSet<TileIndex>) -> Result<SomeTiles> {
        let finished = waiting.iter().filter(|(tile, before)| before.is_none() && !open.contains(tile));
        let finished: Vec<TileIndex> = finished.map(|(tile, _)| *tile).collect();
        let mut with_border = self.finish_borders(&finished)?;
        with_border.iter().for_each(|(tile, before)| _ = waiting.insert(*tile, Some(before.clone())));
        let is_ready = |before: &Vec<TileIndex>| before.iter().all(|other| !open.contains(other));
        let ready: Vec<(TileIndex, Vec<TileIndex>)> =
            waiting.iter().filter_map(|(tile, before)| Some((*tile, before.clone().filter(is_ready)?))).collect();
        ready.iter().for_each(|(tile, _)| _ = waiting.remove(tile));
        with_border.retain(|(tile, _)| waiting.contains_key(tile));
        let written: Vec<TileIndex> = ready.iter().map(|(tile, _)| *tile).collect();
        let each = self.write_each(&written)?;
        let BorderSession { job, joined, .. } = *self;
        let waited = |((tile, neighbours), &stats): (&(TileIndex, Vec<TileIndex>), &TileStats)| {
            Ok(WaitedTile { tile: *tile, stats, key: joined.key_of_tile(job, *tile)?, neighbours: neighbours.clone() })
        };
        let waited = match job.plan.options.updates {
            true => ready.par_iter().zip(&each).map(waited).collect::<Result<_>>()?,
            false => Vec::new(),
        };
        Ok(SomeTiles { stats: each.into_iter().sum(), written, with_border, waited })
    }

    /// Finishes the borders of `tiles`. Returns each with the tiles that must be finished before it can be written.
    fn finish_borders(&self, tiles: &[TileIndex]) -> Result<Vec<(TileIndex, Vec<TileIndex>)>> {
        let (tree, style) = (&self.partition().tree, &self.joined.appearance.style);
        let finish = |&tile: &TileIndex| {
            interrupt::check()?;
            Ok((tile, finish_border_normals(self.store(), tree, style, tile, &self.seam(tile)?)?))
        };
        tiles.par_iter().map(finish).collect()
    }

    /// Writes `tiles`, whose borders are finished. Returns the figures of each.
    fn write_each(&self, tiles: &[TileIndex]) -> Result<Vec<TileStats>> {
        let TileAppearance { style, canvas } = &*self.joined.appearance;
        let border_of = |other: TileIndex| match other.part() == self.part {
            true => FinishedBorder::load(self.store(), other),
            false => border_of_part(self.job, self.joined, other),
        };
        let write = |&tile: &TileIndex| {
            interrupt::check()?;
            let Folder { directory, store, journal, .. } = &self.folder;
            let (stats, files) = write_tile(directory, store, style, canvas, tile, &self.seam(tile)?, &border_of)?;
            journal.add_files(&files);
            self.stage.advance(1);
            Ok(stats)
        };
        tiles.par_iter().map(write).collect()
    }

    /// Records what is written, and ends the session. Returns the bytes that the part's store keeps.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(crate) fn finish(self, some: SomeTiles) -> Result<u64> {
        self.folder.record(JobStep::Tiles, some, vec![self.stage.finish()])?;
        Ok(self.folder.store.bytes())
    }
}

/// How many borders of other parts stay in memory, some ten kilobytes each.
const MOST_KNOWN: usize = 1000;

/// Returns the finished border of a tile of another part. One that is not stored yet is computed: a part's folder has one writer.
fn border_of_part(job: &Job, joined: &JoinedParts, tile: TileIndex) -> Result<FinishedBorder> {
    let known = || joined.borders.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(border) = known().get(&tile) {
        return Ok(border.clone());
    }
    let OpenPart { store, partition, .. } = &*job.open(tile.part())?;
    // Another machine may be writing it. But what a written tile needed may be gone, and then it is whole.
    let border = match store.has_whole(StepRecord::FinishedBorder(tile))? {
        true => FinishedBorder::load(store, tile)?,
        false => {
            let seam = joined.seam_of(job, store, &partition.tree, tile)?;
            finished_border(store, &partition.tree, &joined.appearance.style, tile, &seam)?
        }
    };
    let mut known = known();
    if known.len() >= MOST_KNOWN {
        known.clear();
    }
    known.insert(tile, border.clone());
    Ok(border)
}
