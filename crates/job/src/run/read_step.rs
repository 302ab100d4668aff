//! Running step 2, or taking over what an earlier run read.

use crate::partition::read::read_points;
use crate::partition::result::Partition;
use crate::plan::area_hint::stretch_of_read;
use crate::plan::job_plan::{Plan, SkippedInput};
use crate::plan::make_plan::replan_without;
use crate::progress::stage::JobProgress;
use crate::records::{JobStep, StepOutput};
use crate::run::run_context::RunContext;

/// Reads the points, unless an earlier run did.
///
/// An input that proves bad only now is left out as if nobody had named it: if the job would have another lattice or other breaklines
/// without it, everything is read again. So the plan may change.
///
/// # Errors
/// Those of [`read_points`] and [`replan_without`].
pub(crate) fn read(run: &RunContext, mut plan: Plan, earlier: Option<Partition>) -> crate::Result<(Plan, Partition)> {
    if let Some(partition) = earlier {
        return take_over(run, plan, partition);
    }
    loop {
        let stage = run.progress.stage("read", plan.records, "points");
        let mut partition = read_points(&plan, run.directory, &stage)?;
        let stats = stage.finish();
        let mut is_read = true;
        if !partition.skipped.is_empty() {
            note_skipped(&partition.skipped, run.progress);
            let again = replan_without(plan.clone(), &partition.skipped)?;
            is_read = again.reads_like(&plan);
            plan = again;
        }
        if is_read {
            run.add_stage(stats);
            if let Some(bounds) = partition.summary.bounds {
                partition.summary.counts.notes.extend(stretch_of_read(&plan, bounds)?);
            }
            partition.skipped.clone_from(&plan.skipped);
            let files = vec![plan.write(&run.directory.plan())?];
            let output = StepOutput { files, ..StepOutput::new((), vec![partition.save(run.store)?]) };
            run.journal.record(JobStep::Partition, output)?;
            return Ok((plan, partition));
        }
    }
}

fn take_over(run: &RunContext, mut plan: Plan, partition: Partition) -> crate::Result<(Plan, Partition)> {
    let stage = run.progress.stage("read", plan.records, "points");
    if partition.skipped != plan.skipped {
        plan = replan_without(plan, &partition.skipped)?;
    }
    stage.take_over(partition.summary.counts.read);
    run.add_stage(stage.finish());
    Ok((plan, partition))
}

/// Prints which inputs are left out.
pub(crate) fn note_skipped(skipped: &[SkippedInput], progress: &JobProgress) {
    for bad in skipped {
        progress.note(&format!("left out: {}: {}", bad.file.display(), bad.why));
    }
}
