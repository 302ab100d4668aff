//! Writing the plan down, with what must be known of all points before the first is triangulated.

use crate::Result;
use crate::durable::directory::JobDirectory;
use crate::index::PartIndex;
use crate::mesh::precision_limit::PrecisionLimit;
use crate::mesh::selection::error_bound;
use crate::partition::parts::Parts;
use crate::plan::job_plan::{Claims, Plan, SkippedInput};
use crate::progress::stage::JobProgress;
use crate::records::{JobStep, Journal};
use crate::run::phases::read_phase::{read_for, sum_up};
use crate::run::whole_run::WholeRun;
use crate::tiles::curve::curvature_of;

/// Returns the plan with what is known of all points: what headers claim, or what is read now, if the first part reads all. Writes it down,
/// unless that is done.
///
/// # Errors
/// [`sys::Error::Io`] if it cannot be written; those of the phase that reads, and of [`curvature_of`];
/// [`crate::Error::TooFine`] if no mesh can hold the heights.
pub(crate) fn settled(run: &WholeRun, mut plan: Plan) -> Result<Plan> {
    if run.journal.figures_of::<()>(JobStep::Plan)?.is_some() {
        return Ok(plan);
    }
    error_bound(&plan)?;
    let parts = Parts::of(&plan);
    if parts.all().len() == 1 {
        let job = run.job(&plan, &parts);
        let read = read_for(&job, PartIndex::FIRST, 0)?;
        let (summary, bounds) = sum_up(&job, std::iter::once(&read))?;
        plan.claims = Some(Claims { bounds, max_rgb: summary.counts.max_rgb });
    }
    if let Some(claims) = plan.claims.filter(|_| plan.coarsening.measured) {
        // Tiles are written before the last part is read.
        PrecisionLimit::of(&plan.frame).check_heights(claims.bounds)?;
    }
    write_plan(run.journal, run.directory, plan)
}

/// Returns the plan with the curvature of the scene, and writes it down.
///
/// # Errors
/// [`sys::Error::Io`] if it cannot be written, and those of [`curvature_of`].
pub(crate) fn write_plan(journal: &Journal, directory: &JobDirectory, mut plan: Plan) -> Result<Plan> {
    if let Some(claims) = plan.claims {
        plan.curvature = curvature_of(&plan, claims.bounds)?;
    }
    journal.step(JobStep::Plan, || Ok::<_, crate::Error>(((), vec![plan.write(&directory.plan())?])))?;
    Ok(plan)
}

/// Prints which inputs are left out.
pub(crate) fn note_skipped(skipped: &[SkippedInput], progress: &JobProgress) {
    for bad in skipped {
        progress.note(&format!("left out: {}: {}", bad.file.display(), bad.why));
    }
}
