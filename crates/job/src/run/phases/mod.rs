//! The phases of a job: a process that does all of it walks through them, one part after the other, with all threads inside
//! ([`do_phases`]); tasks of a cluster take their share of each.
//!
//! A part is meshed as soon as all inputs that reach it have been read, and its points go then. Tiles that touch other parts wait for
//! the nodes above the parts. Every part has a folder, a journal and a store of its own.

pub(crate) mod appearance;
pub(crate) mod join;
pub(crate) mod level_phase;
pub(crate) mod mesh_phase;
mod outdated_levels;
mod outdated_tiles;
pub(crate) mod plan_phase;
pub(crate) mod publish_phase;
pub(crate) mod read_phase;
pub(crate) mod select_phase;
pub(crate) mod tile_phase;
mod tile_queue;
mod tree_walk;

use crate::Result;
use crate::index::PartIndex;
use crate::partition::parts::Parts;
use crate::plan::first_plan_file::keep_first_plan;
use crate::plan::job_plan::Plan;
use crate::publish::written_tiles::wants_tileset;
use crate::report::job_report::Report;
use crate::run::job::Job;
use crate::run::phases::appearance::early_appearance;
use crate::run::phases::join::{JoinedParts, join_parts};
use crate::run::phases::level_phase::levels_of_part;
use crate::run::phases::mesh_phase::mesh_one;
use crate::run::phases::outdated_tiles::forget_outdated_tiles;
use crate::run::phases::plan_phase::settled;
use crate::run::phases::publish_phase::publish_job;
use crate::run::phases::read_phase::{read_for, sum_up};
use crate::run::phases::select_phase::{select_vertices, selects};
use crate::run::phases::tile_phase::{WaitingTiles, finish_part};
use crate::run::whole_run::WholeRun;
use crate::tiles::write_tile::TileStats;

/// Does all phases that an interrupted run has left.
///
/// # Errors
/// Those of the phases; [`crate::Error::OtherThanClaimed`] if what is read contradicts the plan; [`crate::Error::DamagedSteps`] if what an
/// interrupted run left proves damaged.
pub(crate) fn do_phases(run: &WholeRun, plan: Plan) -> Result<Report> {
    // Step 1, and step 2 where one part reads all.
    let plan = &settled(run, plan)?;
    let parts = &Parts::of(plan);
    let job = &Job::new(run.process, plan, parts);
    if parts.all().len() > 1 {
        keep_first_plan(job.directory, plan)?;
    }
    // Steps 2 to 6 for each part, as far as it needs no later one.
    read_and_mesh(job)?;
    // Step 4 for the nodes above the parts.
    join_parts(job)?;
    let joined = JoinedParts::open(job)?;
    forget_outdated_tiles(job, &joined)?;
    // Steps 5 and 6 for the tiles that have waited.
    let tiles = parts.all().map(|part| finish_part(job, &joined, part)).sum::<Result<TileStats>>()?;
    // Step 7 for each part.
    let has_tileset = wants_tileset(plan, &tiles);
    parts.all().try_for_each(|part| levels_of_part(job, &joined, part, has_tileset).map(|_| ()))?;
    // Step 7 above the parts, and step 8.
    publish_job(run, job, &joined)
}

/// Reads and meshes all parts, or those that an interrupted run left.
fn read_and_mesh(job: &Job) -> Result<()> {
    // Bytes of points that wait, by part, and bytes that parts keep once they are meshed.
    let (mut malformed, mut waiting, mut stored) = (0, vec![0; job.parts.all().len()], 0);
    let mut read_next = |part: PartIndex, waiting: &mut [u64]| -> Result<()> {
        let inputs = read_for(job, part, malformed)?;
        inputs.by_part.iter().for_each(|found| waiting[found.part.get()] += found.bytes);
        malformed += inputs.summary.counts.malformed;
        Ok(())
    };
    let selects = selects(job.plan);
    if selects {
        // Any point may decide about any other.
        job.parts.all().try_for_each(|part| read_next(part, &mut waiting))?;
        sum_up(job)?;
        select_vertices(job)?;
    }
    let appearance = early_appearance(job)?;
    // A job with `--update` keeps everything, and compares the tiles that wait with those of its last run.
    let waits = appearance.clone().filter(|_| !job.plan.options.updates);
    let mut front = waits.map(|appearance| WaitingTiles::new(job, appearance));
    for part in job.parts.all() {
        if !selects {
            read_next(part, &mut waiting)?;
        }
        let others = waiting[part.get() + 1..].iter().sum::<u64>() + stored;
        let meshed = mesh_one(job, part, appearance.as_ref(), Some(others))?;
        stored += meshed.stored;
        front.as_mut().map(|front| front.pass(part, meshed, &mut stored)).transpose()?;
    }
    sum_up(job).map(|_| ())
}
