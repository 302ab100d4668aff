//! What all phases of a job of several parts know.

use crate::job::partition::parts::Parts;
use crate::job::plan::job_plan::Plan;
use crate::job::run::run_context::RunContext;

/// A job of several parts.
pub(crate) struct PartsJob<'a> {
    pub(crate) run: &'a RunContext<'a>,
    pub(crate) plan: &'a Plan,
    pub(crate) parts: &'a Parts,
}
