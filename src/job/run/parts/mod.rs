//! Running a job of several parts: the same phases that a cluster runs as tasks, one part after the other, with all threads inside.
//!
//! A part is meshed as soon as all inputs that reach it have been read, and its points go then. Tiles that touch other parts wait for
//! the nodes above the parts. Every part has a folder, a journal and a store of its own.

mod join;
mod mesh_phase;
mod part_journal;
mod part_store;
mod parts_job;
mod publish_parts;
mod tile_phase;

use crate::Result;
use crate::job::partition::parts::Parts;
use crate::job::plan::job_plan::Plan;
use crate::job::records::{JobStep, StepOutput};
use crate::job::report::job_report::Report;
use crate::job::run::parts::join::join_parts;
use crate::job::run::parts::mesh_phase::mesh_all;
use crate::job::run::parts::part_store::PartStores;
use crate::job::run::parts::parts_job::PartsJob;
use crate::job::run::parts::publish_parts::publish_parts;
use crate::job::run::parts::tile_phase::{final_look, finish_tiles};
use crate::job::run::run_context::RunContext;

/// The walk through the phases after the plan.
///
/// # Errors
/// Those of the steps; [`crate::Error::NeedsOnePart`] if what is read contradicts the headers.
pub(crate) fn walk(run: &RunContext, plan: &Plan) -> Result<Report> {
    let parts = &Parts::of(plan);
    let job = &PartsJob { run, plan, parts };
    run.journal.step(JobStep::Plan, || {
        let files = vec![plan.write(&run.directory.plan())?];
        Ok(StepOutput { files, ..StepOutput::new((), Vec::new()) })
    })?;
    // Steps 2 to 6 for each part, as far as it needs no other.
    let meshed = mesh_all(job)?;
    // Step 4 for the nodes above the parts.
    let stores = &PartStores::new(run.directory, run.job_id);
    let joined = &join_parts(job, stores)?;
    // Steps 5 and 6 for the tiles that have waited.
    let look = &final_look(job, stores, &meshed)?;
    let written = finish_tiles(job, stores, joined, look, &meshed)?;
    // Steps 7 and 8.
    publish_parts(job, stores, joined, look, &meshed, written)
}
