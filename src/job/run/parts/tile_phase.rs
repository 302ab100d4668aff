//! The tiles that have waited for other parts.

use crate::Result;
use crate::job::index::{PartIndex, TileIndex};
use crate::job::records::{FinishedBorder, JobStep};
use crate::job::run::part_entries::entries_of;
use crate::job::run::parts::done::Done;
use crate::job::run::parts::join::JoinedParts;
use crate::job::run::parts::part_journal::PartSession;
use crate::job::run::parts::part_store::PartStores;
use crate::job::run::parts::parts_job::PartsJob;
use crate::job::run::tile_queue::TileLook;
use crate::job::tiles::border_normals::{finish_border_normals, finished_border};
use crate::job::tiles::write_tile::{TileStats, write_tile};
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

/// Writes the tiles of `part` that have `waiting`, unless that is done. Returns the totals over them.
///
/// # Errors
/// Those of the steps; [`crate::Error::InUse`] if another process has the part.
pub(crate) fn finish_part(borders: &ForeignBorders, part: PartIndex, waiting: &[TileIndex]) -> Result<TileStats> {
    let ForeignBorders { job, stores, joined, .. } = *borders;
    let (directory, header) = (&job.directory.part(part), job.header(part));
    let lock = directory.lock()?;
    let entries = entries_of(directory, header)?;
    if let Some(done) = Done::find(&entries, JobStep::WriteWaiting)? {
        return Ok(done.figures);
    }
    let open = stores.open(part)?;
    let tree = &open.partition.tree;
    // The store of the part grows, so nobody may go on with what is open now.
    stores.close(part);
    let session = PartSession::begin(directory, lock, header, entries)?;
    let stage = job.progress.stage("write borders", waiting.len() as u64, "tiles");
    let (store, journal) = (&session.store, &session.journal);
    let TileLook { style, canvas } = &*joined.look;
    let seam = |tile| joined.seam_of(job, store, tree, tile);
    waiting.par_iter().try_for_each(|&tile| {
        let work = || finish_border_normals(store, tree, style, tile, &seam(tile)?);
        journal.step(JobStep::BorderNormals(tile), work).map(|_: Vec<TileIndex>| ())
    })?;
    let write = |&tile: &TileIndex| {
        let border_of = |other: TileIndex| match other.part() == part {
            true => FinishedBorder::load(store, other),
            false => borders.of(other),
        };
        let work = || write_tile(directory, store, style, canvas, tile, &seam(tile)?, &border_of);
        let stats = journal.step(JobStep::WriteTile(tile), work)?;
        stage.advance(1);
        Ok(stats)
    };
    let add = |mut a: TileStats, b| {
        a += b;
        Ok(a)
    };
    let stats = waiting.par_iter().map(write).try_reduce(TileStats::default, add)?;
    session.finish(JobStep::WriteWaiting, stats, vec![stage.finish()], Vec::new())
}

/// How many borders of other parts stay in memory, some ten kilobytes each.
const MOST_KNOWN: usize = 1000;

/// Finished borders of tiles of other parts. They are computed again rather than written: a part's folder has one writer.
pub(crate) struct ForeignBorders<'a> {
    job: &'a PartsJob<'a>,
    stores: &'a PartStores,
    joined: &'a JoinedParts,
    known: Mutex<HashMap<TileIndex, FinishedBorder>>,
}

impl<'a> ForeignBorders<'a> {
    /// Returns the borders of a job whose parts are joined.
    pub(crate) fn new(job: &'a PartsJob<'a>, stores: &'a PartStores, joined: &'a JoinedParts) -> ForeignBorders<'a> {
        ForeignBorders { job, stores, joined, known: Mutex::default() }
    }

    fn of(&self, tile: TileIndex) -> Result<FinishedBorder> {
        let known = || self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(border) = known().get(&tile) {
            return Ok(border.clone());
        }
        let part = self.stores.open(tile.part())?;
        let seam = self.joined.seam_of(self.job, &part.store, &part.partition.tree, tile)?;
        let style = &self.joined.look.style;
        let border = finished_border(&part.store, &part.partition.tree, style, tile, &seam)?;
        let mut known = known();
        if known.len() >= MOST_KNOWN {
            known.clear();
        }
        known.insert(tile, border.clone());
        Ok(border)
    }
}
