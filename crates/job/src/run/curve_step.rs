//! Finding out how the scene of a job of one part follows the curve of the earth.

use crate::plan::job_plan::Plan;
use crate::records::{JobStep, StepOutput};
use crate::run::run_context::RunContext;
use crate::tiles::curve::{curvature_of, may_be_bent};
use delaunay::geometry::Bounds;
use sys::Result;

/// Returns the plan with the curvature of the scene of points within `bounds`: what an earlier run with the same style found, or what this
/// machine finds. Whoever goes on with the job takes it from the journal, so all tiles have the same.
///
/// # Errors
/// Those of [`curvature_of`], and of the journal.
pub(crate) fn with_curvature(run: &RunContext, plan: Plan, bounds: Bounds<3>) -> Result<Plan> {
    if !may_be_bent(&plan) {
        return Ok(plan);
    }
    let find = || Ok(StepOutput::new(curvature_of(&plan, bounds)?, Vec::new()));
    let curvature = run.journal.step(JobStep::Curve, find)?;
    Ok(Plan { curvature, ..plan })
}
