//! The phase plan.

use crate::durable::directory::JobDirectory;
use crate::durable::listing::exists;
use crate::durable::lock::Lock;
use crate::durable::obstacles::{check_nothing_in_the_way, check_results_are_ours};
use crate::options::{JobOptions, RunOptions};
use crate::partition::parts::Parts;
use crate::plan::budget::workers;
use crate::plan::fingerprint::{Fingerprint, JobHeader};
use crate::preflight::check::require_memory_and_disk;
use crate::preflight::contour_estimate::ContourSample;
use crate::progress::clock::JobClock;
use crate::progress::stage::JobProgress;
use crate::run::earlier_run::{EarlierRun, PlanOrigin, start};
use crate::run::finished::known_submission;
use crate::run::phases::plan_phase::{find_plan, note_skipped, write_plan};
use crate::run::planned_job::is_planned;
use crate::run::single_process;
use std::time::SystemTime;
use sys::threads::on_threads;

/// Plans the job, unless that is done. Returns what there is to say.
///
/// # Errors
/// Those of the plan; [`crate::Error::InUse`] if another process works in the job directory.
pub(crate) fn plan(options: &JobOptions, run: RunOptions) -> crate::Result<Option<String>> {
    let directory = &JobDirectory::new(&options.output.directory);
    let begun = SystemTime::now();
    check_nothing_in_the_way(directory)?;
    let fingerprint = on_threads(workers(options, 0)?, || Fingerprint::of(options))?;
    // Nobody starts it over meanwhile.
    let lock = if exists(&directory.journal())? { Some(Lock::share(directory.job())?) } else { None };
    if lock.is_some() && is_planned(directory, options, &fingerprint, run.submission)? {
        return Ok(Some("the job is planned already".into()));
    }
    drop(lock);
    check_results_are_ours(directory, options.output.page)?;
    let _lock = Lock::take(directory.job())?;
    let mut earlier = EarlierRun::read(directory, run)?;
    if let Some(what) = earlier.as_ref().and_then(|earlier| modified_inputs(earlier, &fingerprint)) {
        run.progress.note(&format!("changed since the interrupted run: {what}; starting over"));
        earlier = None;
    }
    let coarsening = earlier.as_ref().and_then(|earlier| earlier.coarsening(&fingerprint)).unwrap_or_default();
    let submission = run.submission.max(known_submission(directory)?);
    let header = JobHeader { fingerprint, coarsening, id: 0, submission, begun: Some(begun) };
    let (plan, origin) = find_plan(directory, options, &header, earlier.as_ref(), run.progress)?;
    note_skipped(&plan.skipped, &JobProgress::new(run.progress, JobClock::start(), Vec::new()));
    let threads = workers(options, plan.records)?;
    if !run.force {
        on_threads(threads, || require_memory_and_disk(&plan, threads, ContourSample::of(&plan)?.as_ref()))?;
    }
    if Parts::of(&plan).all().len() == 1 {
        single_process::leave_note(directory, submission)?;
        return Ok(Some(format!(
            "the job has only {} points, which is one part; {}",
            plan.records,
            single_process::SENTENCE
        )));
    }
    single_process::remove_notes(directory)?;
    on_threads(threads, || {
        let (journal, ..) = start(directory, &header, earlier, origin, false, run.progress)?;
        if origin != PlanOrigin::Kept {
            write_plan(&journal, directory, plan)?;
        }
        Ok(None)
    })
}

/// Returns the inputs that seem to have been modified since the same job was planned. Two changes within a second leave the same time in
/// the fingerprint, and yet tasks refuse what was modified after the plan.
fn modified_inputs(earlier: &EarlierRun, now: &Fingerprint) -> Option<String> {
    let is_same = now.since_planned(&earlier.header.fingerprint).is_none();
    now.modified_since(&earlier.header).filter(|_| is_same)
}
