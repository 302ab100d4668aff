//! The tiles that have waited for other parts.

use crate::job::index::{PartIndex, TileIndex};
use crate::job::plan::job_plan::Claims;
use crate::job::records::{FinishedBorder, JobStep, Leaf, StepOutput};
use crate::job::run::part_entries::{PartHeader, entries_of};
use crate::job::run::parts::join::JoinedParts;
use crate::job::run::parts::mesh_phase::{MeshedPart, MeshedParts};
use crate::job::run::parts::part_journal::PartSession;
use crate::job::run::parts::part_store::PartStores;
use crate::job::run::parts::parts_job::PartsJob;
use crate::job::run::tile_queue::TileLook;
use crate::job::tiles::border_normals::{finish_border_normals, finished_border};
use crate::job::tiles::max_edge::MaxEdgeRule;
use crate::job::tiles::write_tile::{TileStats, write_tile};
use crate::{Error, Result};
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

/// Returns how tiles look, now that all sites are known.
///
/// # Errors
/// [`Error::Io`] or [`Error::Broken`] on a store.
pub(crate) fn final_look(job: &PartsJob, stores: &PartStores, meshed: &MeshedParts) -> Result<TileLook> {
    let Some(Claims { bounds, max_rgb }) = job.plan.claims else {
        return Err(Error::Broken("a job of several parts has no claims".into()));
    };
    let sites = meshed.parts.iter().map(|part| part.leaves.sites).sum();
    let visit = |visit: &(dyn Fn(&[i32; 3]) + Sync)| {
        job.parts.all().try_for_each(|part| {
            let open = stores.open(part)?;
            let tiles: Vec<TileIndex> = open.partition.tree.tiles().collect();
            tiles.into_par_iter().try_for_each(|tile| Leaf::visit_positions(&open.store, tile, visit))
        })
    };
    let rule = MaxEdgeRule::new(job.plan.options.output.max_edge, &job.plan.frame, sites, bounds, &visit)?;
    Ok(TileLook::new(job.plan, max_rgb, bounds, rule))
}

/// Writes the tiles of all parts that have waited. Returns the totals over them.
///
/// # Errors
/// Those of the steps.
pub(crate) fn finish_tiles(
    job: &PartsJob,
    stores: &PartStores,
    joined: &JoinedParts,
    look: &TileLook,
    meshed: &MeshedParts,
) -> Result<TileStats> {
    let waiting = meshed.parts.iter().map(|part| part.waiting.len() as u64).sum();
    let stage = job.run.progress.stage("write borders", waiting, "tiles");
    let borders = &ForeignBorders { job, stores, joined, look, known: Mutex::default() };
    let mut all = TileStats::default();
    for (part, meshed) in job.parts.all().zip(&meshed.parts) {
        all += finish_part(borders, part, meshed)?;
        stage.advance(meshed.waiting.len() as u64);
    }
    job.run.add_stage(stage.finish());
    Ok(all)
}

fn finish_part(borders: &ForeignBorders, part: PartIndex, meshed: &MeshedPart) -> Result<TileStats> {
    let ForeignBorders { job, stores, joined, look, .. } = *borders;
    let open = stores.open(part)?;
    if let Some(done) = open.entries.iter().find(|entry| entry.step == JobStep::WriteWaiting) {
        return done.stats();
    }
    let directory = job.run.directory.part(part);
    let TileLook { style, canvas } = look;
    let tree = &open.partition.tree;
    // The journal of the part is written again, so nobody may read the old one meanwhile.
    stores.close(part);
    let header = PartHeader { job: job.run.job_id, part };
    let session = PartSession::begin(&directory, header, entries_of(&directory, header)?)?;
    let (store, journal) = (&session.store, &session.journal);
    let seam = |tile| joined.seam_of(job, store, tree, tile);
    meshed.waiting.par_iter().try_for_each(|&tile| {
        let work = || finish_border_normals(store, tree, style, tile, &seam(tile)?);
        journal.step(JobStep::BorderNormals(tile), work).map(|_: Vec<TileIndex>| ())
    })?;
    let write = |&tile: &TileIndex| {
        let border_of = |other: TileIndex| match other.part() == part {
            true => FinishedBorder::load(store, other),
            false => borders.of(other),
        };
        let work = || write_tile(&directory, store, style, canvas, tile, &seam(tile)?, &border_of);
        journal.step(JobStep::WriteTile(tile), work)
    };
    let add = |mut a: TileStats, b| {
        a += b;
        Ok(a)
    };
    let stats = meshed.waiting.par_iter().map(write).try_reduce(TileStats::default, add)?;
    journal.commit()?;
    journal.record(JobStep::WriteWaiting, StepOutput::new(stats, Vec::new()))?;
    session.end()?;
    Ok(stats)
}

/// How many borders of other parts stay in memory, some ten kilobytes each.
const MOST_KNOWN: usize = 1000;

/// Finished borders of tiles of other parts. They are computed again rather than written: a part's folder has one writer.
struct ForeignBorders<'a> {
    job: &'a PartsJob<'a>,
    stores: &'a PartStores,
    joined: &'a JoinedParts,
    look: &'a TileLook,
    known: Mutex<HashMap<TileIndex, FinishedBorder>>,
}

impl ForeignBorders<'_> {
    fn of(&self, tile: TileIndex) -> Result<FinishedBorder> {
        let known = || self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(border) = known().get(&tile) {
            return Ok(border.clone());
        }
        let part = self.stores.open(tile.part())?;
        let seam = self.joined.seam_of(self.job, &part.store, &part.partition.tree, tile)?;
        let border = finished_border(&part.store, &part.partition.tree, &self.look.style, tile, &seam)?;
        let mut known = known();
        if known.len() >= MOST_KNOWN {
            known.clear();
        }
        known.insert(tile, border.clone());
        Ok(border)
    }
}
