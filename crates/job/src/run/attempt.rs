//! Attempts at a job: each begins where the last run stopped, and ends with a clean directory or with steps to go on from. If the
//! finished mesh proves too fine for single precision, another attempt takes a coarser lattice.

use crate::durable::cleaning::remove_job;
use crate::durable::directory::JobDirectory;
use crate::durable::listing::{entries, exists};
use crate::durable::lock::Lock;
use crate::durable::obstacles::{check_nothing_in_the_way, check_results_are_ours};
use crate::options::{JobOptions, RunOptions};
use crate::plan::budget::workers;
use crate::plan::fingerprint::{Fingerprint, JobHeader};
use crate::plan::first_plan_file::has_first_plan;
use crate::plan::lattice_choice::LatticeCoarsening;
use crate::plan::make_plan::are_there_far_points;
use crate::preflight::check::require_memory_and_disk;
use crate::preflight::contour_estimate::ContourSample;
use crate::preflight::kept_points::KeptPoints;
use crate::preflight::stage_costs::stage_costs;
use crate::progress::clock::JobClock;
use crate::progress::stage::JobProgress;
use crate::report::change_counts::ChangeCounts;
use crate::report::job_report::Report;
use crate::run::damage::{damaged_by_tasks, is_damage};
use crate::run::earlier_run::{EarlierRun, PlanOrigin, place_results_of_finished_job, start};
use crate::run::finished::{InPlace, known_submission, replaced_terrain, results_in_place};
use crate::run::job::Process;
use crate::run::part_entries::PartEntries;
use crate::run::phases::do_phases;
use crate::run::phases::plan_phase::{find_plan, note_skipped};
use crate::run::update::changes::{end_without_changes, mark_placed};
use crate::run::update::mending::Mended;
use crate::run::whole_run::WholeRun;
use crate::{Error, Result};
use delaunay_gpu::triangulator::Triangulator;
use std::cell::RefCell;
use sys::ErrorKind;
use sys::threads::on_threads;

/// What the user must know where a lock keeps nobody out.
pub(crate) const NO_LOCKS: &str =
    "the file system of the output directory has no locks: make sure that no other process works there";

/// Give up after this many tenfold coarsenings: what is left is no terrain.
const MAX_COARSENINGS: u32 = 6;

/// What all attempts at a job have in common.
struct JobRequest<'a> {
    options: &'a JobOptions,
    run: RunOptions,
    triangulator: Triangulator,
    directory: JobDirectory,
    fingerprint: Fingerprint,
    /// Says which inputs seem to have changed since tasks planned the job.
    modified: Option<String>,
    clock: JobClock,
    /// Whether tasks have completed all phases by part: what is there is on the disk. Otherwise an interrupted run may have left something
    /// damaged.
    is_by_tasks: bool,
    /// The submission that started the job over; 0 if none did.
    submission: u64,
}

/// Runs a job, or what an interrupted run left of it.
///
/// # Errors
/// See [`crate::run`].
pub(crate) fn run_until_it_fits(options: &JobOptions, run: RunOptions, is_by_tasks: bool) -> Result<Report> {
    let clock = JobClock::start();
    let directory = JobDirectory::new(&options.output.directory);
    check_nothing_in_the_way(&directory)?;
    let (mut lock, mut earlier) = (None, None);
    if !entries(directory.job())?.is_empty() {
        // Before anything else can fail: an earlier run may have been cut off while its results took their places.
        lock = Some(Lock::take(directory.job())?);
        earlier = EarlierRun::read(&directory, run)?;
        let has_journal = exists(&directory.journal())?;
        if !has_journal && options.updates && has_first_plan(&directory)? {
            let path = directory.journal();
            run.progress.note(&format!("{} is missing: everything is computed again", path.display()));
        } else if !has_journal
            && !run.restart
            && let InPlace::ThisJob(report) = results_in_place(&directory, options, run.submission)?
        {
            run.progress.note("the interrupted run had put all its results in place");
            on_threads(workers(options, 0)?, || remove_job(&directory))?;
            return Ok(*report);
        }
    }
    let submission = run.submission.max(known_submission(&directory)?);
    // Before the inputs, so that a job that must have a GPU fails at once if there is none.
    let memory = options.limits.memory.0;
    let triangulator = match is_by_tasks {
        // All is triangulated, and this machine may have no GPU.
        true => Triangulator::without_gpu(&options.triangulation),
        false => Triangulator::new(&options.triangulation, &options.gpu, memory)?,
    };
    let fingerprint = on_threads(workers(options, 0)?, || Fingerprint::of(options))?;
    let (fingerprint, modified) = match (is_by_tasks, &earlier) {
        (true, Some(earlier)) => earlier.as_planned(fingerprint)?,
        (true, None) => return Err(Error::TooEarly("the plan of the job is gone: submit the job again".into())),
        (false, _) => (fingerprint, None),
    };
    let job =
        JobRequest { options, run, triangulator, directory, fingerprint, modified, clock, is_by_tasks, submission };
    let known = earlier.as_ref().and_then(|earlier| earlier.coarsening(&job.fingerprint));
    let mut coarsening = known.unwrap_or_default();
    let mut has_looked = coarsening.far_points;
    loop {
        let error = match attempt(&job, coarsening, earlier.take(), lock.take()) {
            Ok(report) => return Ok(report),
            Err(error) => error,
        };
        // A few points that are mistakes must not cost all others their precision.
        if matches!(error, Error::OtherThanClaimed { is_bad_file: false } | Error::TooFine { .. }) && !has_looked {
            has_looked = true;
            coarsening.far_points = on_threads(workers(options, 0)?, || are_there_far_points(options, coarsening))?;
            if coarsening.far_points {
                run.progress.note("some points lie far from all others; starting again without them");
                continue;
            }
        }
        match error {
            Error::OtherThanClaimed { is_bad_file } if !coarsening.measured => {
                run.progress.note(match is_bad_file {
                    true => "a file is bad and will be left out; measuring all files and starting again",
                    false => "what was read contradicts the header of a file; measuring all files and starting again",
                });
                coarsening.measured = true;
            }
            // The work of many machines is not done again by one.
            Error::DamagedSteps if is_by_tasks => return Err(damaged_by_tasks(&job.directory)),
            Error::DamagedSteps => run.progress.note(match options.updates {
                true => "what the last run left is damaged; everything is computed again",
                false => "what the interrupted run left is damaged; starting over",
            }),
            // Only the finished mesh knows its longest triangle. To round in advance would often round for nothing.
            Error::TooFine { vertical, what } if may_coarsen(options, vertical) => {
                let (power, axes) = match vertical {
                    true => (&mut coarsening.vertical, "z"),
                    false => (&mut coarsening.horizontal, "x and y"),
                };
                if *power >= MAX_COARSENINGS {
                    return Err(Error::TooFine { vertical, what });
                }
                run.progress.note(&format!("{what}; starting again with a coarser step in {axes}"));
                *power += 1;
            }
            error => return Err(error),
        }
    }
}

/// Tells whether the lattice may become coarser, which it may not if the user has set its step.
pub(crate) fn may_coarsen(options: &JobOptions, vertical: bool) -> bool {
    let set = if vertical { options.input.resolution_z } else { options.input.resolution };
    set.step().is_none()
}

fn attempt(
    job: &JobRequest,
    coarsening: LatticeCoarsening,
    earlier: Option<EarlierRun>,
    lock: Option<Lock>,
) -> Result<Report> {
    let JobRequest { options, run, ref directory, clock, is_by_tasks, .. } = *job;
    let header =
        JobHeader { fingerprint: job.fingerprint.clone(), coarsening, id: 0, submission: job.submission, begun: None };
    let stage = JobProgress::new(run.progress, clock, Vec::new()).stage("plan", 1, "job");
    let (mut plan, origin) = find_plan(directory, options, &header, earlier.as_ref(), run.progress)?;
    plan.warnings.extend(job.modified.clone());
    stage.advance(1);
    let planned = stage.finish();
    let threads = workers(options, plan.records)?;
    let contours = on_threads(threads, || ContourSample::of(&plan))?;
    let contours_of_all = contours.as_ref().map(|sample| sample.estimate(KeptPoints::by_headers(&plan)));
    let progress = &JobProgress::new(run.progress, clock, stage_costs(&plan, contours_of_all.as_ref()));
    note_skipped(&plan.skipped, progress);
    contours_of_all.and_then(|contours| contours.warning(&plan)).iter().for_each(|warning| progress.note(warning));
    plan.ground_cells.and_then(|cells| cells.warning(options)).iter().for_each(|warning| progress.note(warning));
    plan.terrain_crowd.and_then(|crowd| crowd.warning(options)).iter().for_each(|warning| progress.note(warning));
    let is_update = origin == PlanOrigin::Update;
    if !run.force && !is_by_tasks && !is_update {
        on_threads(threads, || require_memory_and_disk(&plan, threads, contours.as_ref()))?;
    }
    check_results_are_ours(directory, options.output.page)?;
    let mut earlier = earlier;
    let lock_of_job = match lock {
        Some(lock) => lock,
        None => {
            let lock = Lock::take(directory.job())?;
            // Another process may have begun the job, and stopped, since this one looked.
            earlier = EarlierRun::read(directory, run)?;
            lock
        }
    };
    if !lock_of_job.is_real() {
        progress.note(NO_LOCKS);
    }
    // Tasks have worked since the plan, and this process only ends it.
    let begun = earlier.as_ref().filter(|_| is_by_tasks).and_then(|earlier| earlier.header.begun);
    let complete = earlier.as_ref().map(|earlier| earlier.complete_report(directory, &header)).transpose()?;
    if let Some(report) = complete.flatten() {
        if options.updates {
            let mended = earlier.as_ref().and_then(|earlier| earlier.mended.as_ref());
            if end_without_changes(directory)? || mended.is_some_and(|mended| mended.is_interrupted) {
                progress.note("the interrupted run had written all its results");
                return Ok(report);
            }
            progress.note(match mended.is_some_and(Mended::has_put_back) {
                true => "nothing else has changed since the last run",
                false => "nothing has changed since the last run",
            });
            return Ok(Report { update: Some(ChangeCounts::default()), ..report });
        }
        progress.note("the last run had written all its results");
        on_threads(threads, || remove_job(directory))?;
        return Ok(report);
    }
    if !is_by_tasks && !options.updates {
        replaced_terrain(directory, options, &job.fingerprint)?.iter().for_each(|note| progress.note(note));
    }
    job.triangulator.prepare(plan.records, threads);
    let keeps_mesh = plan.keeps_mesh();
    on_threads(threads, || {
        let (journal, JobHeader { id, .. }, resumed) =
            start(directory, &header, earlier, origin, is_by_tasks, run.progress)?;
        // That tasks or an earlier run have done phases is nothing to tell.
        let told = if is_by_tasks || is_update { 0 } else { resumed };
        let process = Process {
            triangulator: &job.triangulator,
            directory,
            progress,
            threads,
            clock,
            id,
            checks_points: told > 0 || options.updates,
            is_task: false,
        };
        let whole_run = WholeRun {
            process,
            journal: &journal,
            begun,
            identity: job.fingerprint.identity(options, job.submission)?,
            resumed: told,
            stages: RefCell::new(vec![planned]),
        };
        // What tasks left was not compared with its hashes, and a disk may fail meanwhile.
        let outcome = do_phases(&whole_run, plan).map_err(|error| match error {
            error if resumed > 0 && is_damage(&error, directory) => Error::DamagedSteps,
            error => error,
        });
        // If the journals cannot be read now, something may be kept.
        let count = |parts: Vec<PartEntries>| parts.iter().map(|part| part.entries.len() as u64).sum();
        let of_parts = || PartEntries::of_all(directory, id).map_or(1, count);
        let phases = journal.complete() + if outcome.is_err() { of_parts() } else { 0 };
        drop(journal);
        job.end(outcome, phases, keeps_mesh, is_update)
    })
}

impl JobRequest<'_> {
    /// Ends an attempt after which so many `phases` are complete. Puts the results in place, or keeps the complete phases if the job can go on
    /// from them. Removes everything else, but never the work of tasks after an error, nor what an update needs.
    fn end(&self, outcome: Result<Report>, phases: u64, keeps_mesh: bool, is_update: bool) -> Result<Report> {
        let JobRequest { options: JobOptions { updates, .. }, directory, is_by_tasks, .. } = self;
        let outcome = outcome.and_then(|report| match place_results_of_finished_job(directory, *updates) {
            Err(sys::Error::Io { source, .. }) if *is_by_tasks && source.kind() == std::io::ErrorKind::NotFound => {
                Err(Error::DamagedSteps)
            }
            placed => Ok(placed.map(|()| report)?),
        });
        match outcome {
            Ok(report) if *updates && has_first_plan(directory)? => {
                let results = directory.waiting_results();
                directory.keep_results(&results.iter().map(|path| directory.name(path)).collect())?;
                mark_placed(directory)?;
                Ok(report)
            }
            Err(why) if *is_by_tasks && !may_go_on(&why) => Err(why),
            // With a corrected configuration a job that has freed its mesh may start over, so nothing is promised.
            Err(why @ Error::System(sys::Error::Config(_))) if phases > 0 && !keeps_mesh => Err(why),
            Err(why) if may_go_on(&why) && phases > 0 => {
                Err(Error::Resumable { why: Box::new(why), phases, job: directory.job().into() })
            }
            Err(why) if is_update && !is_to_be_tried_again(&why) => Err(why),
            outcome => {
                let cleaned = remove_job(directory);
                // The first error is the one to report.
                outcome.and_then(|report| Ok(cleaned.map(|()| report)?))
            }
        }
    }
}

/// Tells whether the next attempt begins anew.
fn is_to_be_tried_again(why: &Error) -> bool {
    matches!(why, Error::OtherThanClaimed { .. } | Error::DamagedSteps | Error::TooFine { .. })
}

/// Tells whether another run can make use of the complete phases: with the same options, or with others for how tiles look.
fn may_go_on(why: &Error) -> bool {
    match why {
        // The next attempt measures the inputs and starts over.
        Error::OtherThanClaimed { .. } => false,
        Error::System(sys::Error::Config(_) | sys::Error::Io { .. }) => true,
        _ => why.kind() == ErrorKind::Retry,
    }
}
