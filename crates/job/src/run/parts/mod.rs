//! Running a job of several parts: the same phases that a cluster runs as tasks, one part after the other, with all threads inside.
//!
//! A part is meshed as soon as all inputs that reach it have been read, and its points go then. Tiles that touch other parts wait for
//! the nodes above the parts. Every part has a folder, a journal and a store of its own.

pub(crate) mod appearance;
pub(crate) mod done;
pub(crate) mod join;
pub(crate) mod level_phase;
pub(crate) mod mesh_phase;
pub(crate) mod meshed_part;
mod part_journal;
pub(crate) mod part_store;
pub(crate) mod parts_job;
mod publish_parts;
pub(crate) mod read_phase;
pub(crate) mod tile_phase;
mod waiting_tiles;

use crate::durable::directory::JobDirectory;
use crate::index::PartIndex;
use crate::partition::part_points::ReadInputs;
use crate::partition::parts::Parts;
use crate::plan::job_plan::Plan;
use crate::progress::stats::StageStats;
use crate::records::{JobStep, Journal, StepOutput};
use crate::report::job_report::Report;
use crate::run::damage::is_damage;
use crate::run::parts::appearance::{SitesOfParts, early_appearance};
use crate::run::parts::join::{JoinedParts, join_parts};
use crate::run::parts::level_phase::levels_of_part;
use crate::run::parts::mesh_phase::{drop_damaged_steps, mesh_one};
use crate::run::parts::meshed_part::MeshedPart;
use crate::run::parts::part_store::PartStores;
use crate::run::parts::parts_job::PartsJob;
use crate::run::parts::publish_parts::publish_parts;
use crate::run::parts::read_phase::{read_for, sum_up};
use crate::run::parts::tile_phase::{ForeignBorders, finish_part};
use crate::run::parts::waiting_tiles::WaitingTiles;
use crate::run::publish_step::wants_tileset;
use crate::run::run_context::RunContext;
use crate::tiles::curve::curvature_of;
use crate::{Error, Result};
use delaunay::geometry::Bounds;
use std::collections::HashMap;

/// The walk through the phases after the plan.
///
/// # Errors
/// Those of the steps; [`Error::NeedsOnePart`] if what is read contradicts the headers; [`Error::DamagedSteps`] if what an interrupted run
/// left proves damaged.
pub(crate) fn walk(run: &RunContext, plan: Plan) -> Result<Report> {
    // What was freed cannot be done again, so a missing result may show only when another step needs it.
    let goes_on = run.resumed > 0 || run.is_by_tasks;
    do_phases(run, plan).map_err(|error| match error {
        error if goes_on && is_damage(&error, run.directory) => Error::DamagedSteps,
        error => error,
    })
}

fn do_phases(run: &RunContext, plan: Plan) -> Result<Report> {
    let plan = &write_plan(run.journal, run.directory, plan)?;
    let parts = &Parts::of(plan);
    let job = &PartsJob::of_run(run, plan, parts);
    // Steps 2 to 6 for each part, as far as it needs no later one.
    let stores = &PartStores::new(job.directory, job.job_id);
    let (meshed, bounds, mut before) = read_and_mesh(job, stores)?;
    // Step 4 for the nodes above the parts.
    join_parts(job, stores, SitesOfParts { sites: meshed.iter().map(|part| part.leaves.sites).sum(), bounds })?;
    let joined = JoinedParts::open(job)?.ok_or_else(|| sys::Error::Broken("the parts are not joined".into()))?;
    // Steps 5 and 6 for the tiles that have waited.
    let borders = &ForeignBorders::new(job, stores, &joined);
    let mut tiles = meshed.iter().map(|part| part.tiles).fold(Default::default(), |mut all, part| {
        all += part;
        all
    });
    for (part, meshed) in parts.all().zip(&meshed) {
        tiles += finish_part(borders, part, &meshed.waiting, before.remove(&part))?;
    }
    // Step 7 for each part.
    let has_tileset = wants_tileset(plan, &tiles);
    parts.all().try_for_each(|part| levels_of_part(job, stores, &joined, part, has_tileset).map(|_| ()))?;
    // Step 7 above the parts, and step 8.
    publish_parts(run, job, stores, &joined)
}

/// Returns the plan with the curvature of the scene, and writes it down, unless that is done.
///
/// # Errors
/// [`sys::Error::Io`] if it cannot be written, and those of [`curvature_of`].
pub(crate) fn write_plan(journal: &Journal, directory: &JobDirectory, mut plan: Plan) -> sys::Result<Plan> {
    if let (false, Some(claims)) = (journal.has(JobStep::Plan), plan.claims) {
        plan.curvature = curvature_of(&plan, claims.bounds)?;
    }
    plan.curvature = journal.step(JobStep::Plan, || {
        let files = vec![plan.write(&directory.plan())?];
        Ok(StepOutput { files, ..StepOutput::new(plan.curvature.clone(), Vec::new()) })
    })?;
    Ok(plan)
}

/// Reads and meshes all parts, or those that an interrupted run left. Returns them, the box of all points, and what writing tiles of each
/// part took that have waited for others.
fn read_and_mesh(
    job: &PartsJob,
    stores: &PartStores,
) -> Result<(Vec<MeshedPart>, Bounds<3>, HashMap<PartIndex, StageStats>)> {
    let appearance = early_appearance(job)?;
    let mut front = appearance.clone().map(|appearance| WaitingTiles::new(job, stores, appearance)).transpose()?;
    let (mut read, mut meshed) = (Vec::<ReadInputs>::new(), Vec::<MeshedPart>::new());
    // Bytes of points that wait, by part.
    let mut waiting = vec![0; job.parts.all().len()];
    for part in job.parts.all() {
        let malformed = read.iter().map(|inputs| inputs.summary.counts.malformed).sum();
        let inputs = read_for(job, part, malformed)?;
        inputs.by_part.iter().for_each(|found| waiting[found.part.get()] += found.bytes);
        read.push(inputs);
        let stored = match &front {
            Some(front) => front.stored(),
            None => meshed.iter().map(|part| part.stored).sum::<u64>(),
        };
        let others = waiting[part.get() + 1..].iter().sum::<u64>() + stored;
        let done = mesh_one(job, part, appearance.as_ref(), Some(others))?;
        if job.checks {
            drop_damaged_steps(job, part)?;
        }
        front.as_mut().map(|front| front.pass(part, &done)).transpose()?;
        meshed.push(done);
    }
    let (_, bounds) = sum_up(job, read.iter())?;
    Ok((meshed, bounds, front.map(|front| front.stages).unwrap_or_default()))
}
