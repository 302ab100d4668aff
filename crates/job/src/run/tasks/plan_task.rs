//! The phase plan.

use crate::durable::directory::JobDirectory;
use crate::durable::obstacles::{check_nothing_in_the_way, check_results_are_ours};
use crate::options::{JobOptions, RunOptions};
use crate::partition::parts::Parts;
use crate::plan::budget::workers;
use crate::plan::fingerprint::{Fingerprint, JobHeader};
use crate::plan::make_plan::make_plan;
use crate::preflight::check::require_memory_and_disk;
use crate::preflight::input_places::check_inputs_are_no_results;
use crate::progress::clock::JobClock;
use crate::progress::stage::JobProgress;
use crate::publish::height_offset_check::check_height_offset;
use crate::publish::raster::check::check_raster;
use crate::run::attempt::{coarsening_of, read_earlier};
use crate::run::finished::known_submission;
use crate::run::parts::write_plan;
use crate::run::read_step::note_skipped;
use crate::run::resume::EarlierRun;
use crate::run::resume_parts::start_parts;
use crate::run::single_process::SingleProcess;
use crate::run::tasks::planned_job::planned;
use std::time::SystemTime;
use sys::threads::on_threads;
use sys::{Error, disk};

/// Plans the job, unless that is done. Returns what there is to say.
///
/// # Errors
/// Those of the plan; [`crate::Error::InUse`] if another process works in the job directory.
pub(crate) fn plan(options: &JobOptions, run: RunOptions) -> crate::Result<Option<String>> {
    let directory = &JobDirectory::new(&options.output.directory);
    let begun = SystemTime::now();
    check_nothing_in_the_way(directory)?;
    let fingerprint = on_threads(workers(options, 0)?, || Fingerprint::of(options))?;
    if is_planned(directory, &fingerprint, run.submission)? {
        return Ok(Some("the job is planned already".into()));
    }
    check_results_are_ours(directory, options.output.page)?;
    let _lock = directory.lock()?;
    let mut earlier = read_earlier(directory, run)?;
    if let Some(earlier) = earlier.as_mut()
        && let Some(what) = modified_inputs(earlier, &fingerprint)
    {
        run.progress.note(&format!("changed since the interrupted run: {what}; starting over"));
        earlier.forget();
    }
    let coarsening = coarsening_of(directory, earlier.as_ref(), &fingerprint)?;
    let submission = run.submission.max(known_submission(directory)?);
    let header = JobHeader { fingerprint, coarsening, id: 0, submission, begun: Some(begun) };
    let known = earlier.as_ref().and_then(|earlier| earlier.plan(directory, &header, options));
    let plan = match known {
        Some(plan) => plan,
        None => on_threads(workers(options, 0)?, || make_plan(options, coarsening).map(Parts::cut_or_whole))?,
    };
    check_inputs_are_no_results(&plan)?;
    check_height_offset(&plan)?;
    check_raster(&plan)?;
    note_skipped(&plan.skipped, &JobProgress::new(run.progress, JobClock::start(), Vec::new()));
    plan.freed_steps().iter().for_each(|what| run.progress.note(what));
    let threads = workers(options, plan.records)?;
    if !run.force {
        on_threads(threads, || require_memory_and_disk(&plan, threads))?;
    }
    if plan.is_one_part() {
        SingleProcess::AsPlanned.note(directory, submission)?;
        return Ok(Some(format!(
            "the job has only {} points, which is one part; {}",
            plan.records,
            SingleProcess::SENTENCE
        )));
    }
    SingleProcess::forget(directory)?;
    on_threads(threads, || {
        let start = start_parts(directory, &header, earlier, run.progress)?;
        write_plan(&start.journal, directory, plan)?;
        start.journal.commit()?;
        start.journal.close();
        Ok(None)
    })
}

/// Returns the inputs that seem to have been modified since the same job was planned. Two changes within a second leave the same time in
/// the fingerprint, and yet tasks refuse what was modified after the plan.
fn modified_inputs(earlier: &EarlierRun, now: &Fingerprint) -> Option<String> {
    let planned = earlier.header.as_ref().filter(|planned| now.since_planned(&planned.fingerprint).is_none())?;
    now.modified_since(planned)
}

/// Tells whether the job with this fingerprint is planned. Nobody starts it over meanwhile.
fn is_planned(directory: &JobDirectory, fingerprint: &Fingerprint, submission: u64) -> crate::Result<bool> {
    let journal = directory.journal();
    if !disk::exists(&journal).map_err(Error::io("read", &journal))? {
        return Ok(false);
    }
    let _lock = directory.share_lock()?;
    let known = planned(directory, submission)?;
    Ok(known.is_some_and(|(header, _)| fingerprint.is_same_job(&header)))
}
