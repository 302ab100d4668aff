//! How far a job is.

use crate::durable::directory::JobDirectory;
use crate::options::JobOptions;
use crate::phase::Phase;
use crate::records::JobStep;
use crate::report::job_report::SlowestPart;
use crate::report::job_status::{JobState, JobStatus, PhaseStatus};
use crate::run::finished::{InPlace, results_in_place};
use crate::run::meshed_part::MeshedPart;
use crate::run::planned_job::PlannedJob;
use crate::run::single_process;
use crate::run::tasks::missing::JobProgressByPart;
use sys::Result;

/// Returns how far the job is.
///
/// # Errors
/// [`sys::Error::Io`] or [`sys::Error::Broken`] on the job directory, [`sys::Error::Config`] if the options have changed since it was
/// planned.
pub(crate) fn status(options: &JobOptions, tasks: Option<u32>) -> Result<JobStatus> {
    let directory = JobDirectory::new(&options.output.directory);
    let output = options.output.directory.clone();
    let simple = |state| JobStatus { output: output.clone(), state, phases: Vec::new(), slowest_part: None };
    if single_process::is_noted(&directory, 0)? {
        return Ok(simple(JobState::LeftToPublish));
    }
    let without_plan = match results_in_place(&directory, options, 0)? {
        InPlace::ThisJob(_) => return Ok(simple(JobState::Done)),
        InPlace::OtherJob => JobState::OtherResults,
        InPlace::Nothing => JobState::NotPlanned,
    };
    let Some(job) = PlannedJob::open(&directory, options, 0)? else { return Ok(simple(without_plan)) };
    let progress = JobProgressByPart::of(&job)?;
    let phases = Phase::of_job(options.leaves_points_out()).map(|phase| phase_status(&progress, phase, tasks));
    let phases = phases.collect::<Result<_>>()?;
    Ok(JobStatus { phases, slowest_part: slowest(&progress)?, ..simple(JobState::UnderWay) })
}

fn phase_status(progress: &JobProgressByPart, phase: Phase, tasks: Option<u32>) -> Result<PhaseStatus> {
    let missing_tasks = tasks.map(|tasks| progress.missing_tasks(phase, tasks)).transpose()?;
    if !phase.is_by_part() {
        let done = u64::from(progress.is_done(phase)?);
        return Ok(PhaseStatus { phase, done, of: 1, missing_parts: Vec::new(), missing_tasks });
    }
    let missing_parts: Vec<u32> = progress.missing(phase, 1)?.into_iter().map(|(part, _)| part.0).collect();
    let of = progress.parts_of(phase);
    Ok(PhaseStatus { phase, done: of - missing_parts.len() as u64, of, missing_parts, missing_tasks })
}

fn slowest(progress: &JobProgressByPart) -> Result<Option<SlowestPart>> {
    let mut slowest: Option<SlowestPart> = None;
    for (part, entries) in &progress.parts {
        let (seconds, mesh) = (entries.seconds()?, entries.known::<MeshedPart>(JobStep::Mesh)?);
        if seconds > 0.0 && slowest.is_none_or(|slowest| slowest.seconds <= seconds) {
            let points = mesh.map_or_else(|| progress.job.parts.expected_points(*part), |mesh| mesh.points);
            slowest = Some(SlowestPart { part: part.get() as u64, seconds, points });
        }
    }
    Ok(slowest)
}
