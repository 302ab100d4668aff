//! Writing the plan down, with what must be known of all points before the first is triangulated.

use crate::Result;
use crate::durable::directory::JobDirectory;
use crate::index::PartIndex;
use crate::mesh::precision_limit::PrecisionLimit;
use crate::mesh::selection::error_bound;
use crate::options::JobOptions;
use crate::partition::parts::Parts;
use crate::plan::budget::workers;
use crate::plan::fingerprint::JobHeader;
use crate::plan::job_plan::{Claims, Plan, SkippedInput};
use crate::plan::make_plan::{make_plan, make_plan_on};
use crate::preflight::check::check_plan;
use crate::progress::stage::{JobProgress, ProgressOutput};
use crate::records::{JobStep, Journal};
use crate::run::earlier_run::{EarlierRun, PlanOrigin};
use crate::run::job::Job;
use crate::run::phases::read_phase::{read_for, sum_up};
use crate::run::whole_run::WholeRun;
use crate::tiles::curve::curvature_of;
use sys::threads::on_threads;

/// Returns the plan of the job with `header`, which an `earlier` run may have written, and whose it is. Its results can be made.
///
/// # Errors
/// Those of [`make_plan`] and [`check_plan`].
pub(crate) fn find_plan(
    directory: &JobDirectory,
    options: &JobOptions,
    header: &JobHeader,
    earlier: Option<&EarlierRun>,
    progress: ProgressOutput,
) -> Result<(Plan, PlanOrigin)> {
    let known = earlier.and_then(|earlier| earlier.plan(directory, header, options));
    let (plan, origin) = match known {
        Some(plan) => (plan, PlanOrigin::Kept),
        None => {
            let first = earlier.and_then(|earlier| earlier.first_plan(directory, header, progress));
            on_threads(workers(options, 0)?, || planned(options, header, first.as_ref(), progress))?
        }
    };
    check_plan(&plan)?;
    Ok((plan, origin))
}

/// Returns a new plan. That of an update keeps to the plan `first` of the first run.
fn planned(
    options: &JobOptions,
    header: &JobHeader,
    first: Option<&Plan>,
    progress: ProgressOutput,
) -> Result<(Plan, PlanOrigin)> {
    if let Some(first) = first {
        let plan = make_plan_on(Some(&first.lattice), options, header.coarsening)?;
        match plan.laid_out_as(first) {
            Ok(plan) => return Ok((plan.with_keys(&header.fingerprint)?, PlanOrigin::Update)),
            Err(why) => progress.note(&format!("everything is computed again: {why}")),
        }
    }
    let mut plan = make_plan(options, header.coarsening)?;
    if options.updates {
        plan = plan.with_keys(&header.fingerprint)?;
        plan.claims = plan.claims.map(Claims::with_room);
    }
    Ok((plan, PlanOrigin::New))
}

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
        let job = Job::new(run.process, &plan, &parts);
        read_for(&job, PartIndex::FIRST, 0)?;
        let (summary, bounds) = sum_up(&job)?;
        plan.claims = Some(Claims { bounds, max_rgb: summary.counts.max_rgb });
    }
    if let Some(claims) = plan.claims.filter(|_| plan.coarsening.measured) {
        // Tiles are written before the last part is read.
        PrecisionLimit::of(&plan.frame).check_heights(claims.bounds)?;
    }
    write_plan(run.journal, run.process.directory, plan)
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
