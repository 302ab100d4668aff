//! The tiles that have waited for other parts.

use crate::durable::directory::JobDirectory;
use crate::index::{PartIndex, TileIndex};
use crate::merge_records::SeamOfTile;
use crate::partition::result::Partition;
use crate::progress::stage::Stage;
use crate::progress::stats::StageStats;
use crate::records::{FinishedBorder, JobStep, Store};
use crate::run::part_entries::entries_of;
use crate::run::parts::done::Done;
use crate::run::parts::join::JoinedParts;
use crate::run::parts::part_journal::PartSession;
use crate::run::parts::part_store::{OpenPart, PartStores};
use crate::run::parts::parts_job::PartsJob;
use crate::run::tile_queue::TileAppearance;
use crate::tiles::border_normals::{finish_border_normals, finished_border};
use crate::tiles::write_tile::{TileStats, write_tile};
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use sys::Result;

/// Writes the tiles of `part` that have `waiting`, unless that is done. `before` is what writing some of them took already. Returns the
/// totals over all of them.
///
/// # Errors
/// Those of the steps; [`crate::Error::InUse`] if another process has the part.
pub(crate) fn finish_part(
    borders: &ForeignBorders,
    part: PartIndex,
    waiting: &[TileIndex],
    before: Option<StageStats>,
) -> crate::Result<TileStats> {
    let directory = &borders.job.directory.part(part);
    let entries = entries_of(directory, borders.job.header(part))?;
    if let Some(done) = Done::find(&entries, JobStep::WriteWaiting)? {
        return Ok(done.figures);
    }
    let session = BorderSession::begin(borders, directory, part, waiting.len())?;
    session.finish_borders(waiting)?;
    let stats = session.write_tiles(waiting)?;
    let BorderSession { session, stage, .. } = session;
    let mut took = stage.finish();
    before.iter().for_each(|before| took.add(before));
    Ok(session.finish(JobStep::WriteWaiting, stats, vec![took], Vec::new())?)
}

/// A part whose waiting tiles this process writes.
pub(crate) struct BorderSession<'a> {
    borders: &'a ForeignBorders<'a>,
    session: PartSession<'a>,
    open: Arc<OpenPart>,
    part: PartIndex,
    stage: Stage,
}

impl<'a> BorderSession<'a> {
    /// Opens the folder of `part`, which is `directory`, to write some of `tiles` tiles.
    ///
    /// # Errors
    /// [`sys::Error::Io`] or [`sys::Error::Broken`] on the folder, [`crate::Error::InUse`] if another process has the part.
    pub(crate) fn begin(
        borders: &'a ForeignBorders<'a>,
        directory: &'a JobDirectory,
        part: PartIndex,
        tiles: usize,
    ) -> crate::Result<BorderSession<'a>> {
        let ForeignBorders { job, stores, .. } = *borders;
        let lock = directory.lock_within()?;
        let header = job.header(part);
        let entries = entries_of(directory, header)?;
        let open = stores.open(part)?;
        // The store of the part grows, so nobody may go on with what is open now.
        stores.close(part);
        let session = PartSession::begin(directory, lock, header, entries)?;
        let stage = job.progress.stage("write borders", tiles as u64, "tiles");
        Ok(BorderSession { borders, session, open, part, stage })
    }

    pub(crate) fn store(&self) -> &Store {
        &self.session.store
    }

    pub(crate) fn partition(&self) -> &Partition {
        &self.open.partition
    }

    fn seam(&self, tile: TileIndex) -> Result<SeamOfTile> {
        let ForeignBorders { job, joined, .. } = *self.borders;
        joined.seam_of(job, self.store(), &self.partition().tree, tile)
    }

    /// Finishes the borders of `tiles`, which no merge can change any more. Returns each with the tiles that must be finished before it can
    /// be written.
    ///
    /// # Errors
    /// Those of [`finish_border_normals`].
    pub(crate) fn finish_borders(&self, tiles: &[TileIndex]) -> Result<Vec<(TileIndex, Vec<TileIndex>)>> {
        let (tree, style) = (&self.partition().tree, &self.borders.joined.appearance.style);
        let finish = |&tile: &TileIndex| {
            let work = || finish_border_normals(self.store(), tree, style, tile, &self.seam(tile)?);
            Ok((tile, self.session.journal.step(JobStep::BorderNormals(tile), work)?))
        };
        tiles.par_iter().map(finish).collect()
    }

    /// Writes `tiles`, whose borders are finished. Returns the totals over them.
    ///
    /// # Errors
    /// Those of [`write_tile`].
    pub(crate) fn write_tiles(&self, tiles: &[TileIndex]) -> Result<TileStats> {
        let TileAppearance { style, canvas } = &*self.borders.joined.appearance;
        let border_of = |other: TileIndex| match other.part() == self.part {
            true => FinishedBorder::load(self.store(), other),
            false => self.borders.of(other),
        };
        let write = |&tile: &TileIndex| {
            let (directory, store) = (self.session.directory, self.store());
            let work = || write_tile(directory, store, style, canvas, tile, &self.seam(tile)?, &border_of);
            let (step, journal) = (JobStep::WriteTile(tile), &self.session.journal);
            let stats = journal.step(step, work)?;
            if journal.has(step) {
                self.stage.take_over(1)
            } else {
                self.stage.advance(1)
            }
            Ok(stats)
        };
        let add = |mut a: TileStats, b| {
            a += b;
            Ok(a)
        };
        tiles.par_iter().map(write).try_reduce(TileStats::default, add)
    }

    /// Waits until all that was written is on the disk.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(crate) fn make_durable(&self) -> Result<()> {
        self.session.journal.commit()?;
        self.store().sync()
    }

    /// Ends the session while tiles still wait. Returns what it took.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(crate) fn end(self) -> Result<StageStats> {
        self.session.end()?;
        Ok(self.stage.finish())
    }
}

/// How many borders of other parts stay in memory, some ten kilobytes each.
const MOST_KNOWN: usize = 1000;

/// Finished borders of tiles of other parts. Those that are not stored yet are computed: a part's folder has one writer.
pub(crate) struct ForeignBorders<'a> {
    job: &'a PartsJob<'a>,
    stores: &'a PartStores,
    joined: &'a JoinedParts,
    known: Mutex<HashMap<TileIndex, FinishedBorder>>,
}

impl<'a> ForeignBorders<'a> {
    /// Returns the borders of a job whose parts are joined as far as `joined` tells.
    pub(crate) fn new(job: &'a PartsJob<'a>, stores: &'a PartStores, joined: &'a JoinedParts) -> ForeignBorders<'a> {
        ForeignBorders { job, stores, joined, known: Mutex::default() }
    }

    fn of(&self, tile: TileIndex) -> Result<FinishedBorder> {
        let known = || self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(border) = known().get(&tile) {
            return Ok(border.clone());
        }
        let border = self.find(tile)?;
        let mut known = known();
        if known.len() >= MOST_KNOWN {
            known.clear();
        }
        known.insert(tile, border.clone());
        Ok(border)
    }

    fn find(&self, tile: TileIndex) -> Result<FinishedBorder> {
        let OpenPart { store, partition, borders } = &*self.stores.open(tile.part())?;
        // Another machine may be writing it. But what a written tile needed may be gone, and then it is whole.
        if borders.get(&tile).is_some_and(|record| store.is_whole(record)) {
            return FinishedBorder::load(store, tile);
        }
        let seam = self.joined.seam_of(self.job, store, &partition.tree, tile)?;
        finished_border(store, &partition.tree, &self.joined.appearance.style, tile, &seam)
    }
}
