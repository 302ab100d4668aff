//! Whether a job is finished, which its report tells: it takes its place last, and an old one goes first. So wherever a report is, the
//! results are whole, also while what only the steps needed is being removed, and after that.

use crate::durable::cleaning::remove_job;
use crate::durable::directory::JobDirectory;
use crate::durable::journal;
use crate::durable::listing::{entries, exists, read_if_there};
use crate::durable::lock::Lock;
use crate::options::JobOptions;
use crate::plan::budget::workers;
use crate::plan::fingerprint::{Fingerprint, JobHeader};
use crate::progress::number_text::grouped;
use crate::records::{JobStep, JournalEntry};
use crate::report::job_report::Report;
use crate::run::planned_job::planned;
use crate::run::single_process;
use serde::de::IgnoredAny;
use std::io::ErrorKind;
use sys::terminal::name;
use sys::threads::on_threads;
use sys::{Error, Result};
use tiles::checksums::seal;

/// What a job finds in the place of its results.
pub(crate) enum InPlace {
    /// Nothing that says whose they are, or the job is under way again.
    Nothing,
    /// The results of a job with other options or inputs, of another version of the program, or from before a submission that starts the
    /// job over.
    OtherJob,
    /// Its own results. It is finished.
    ThisJob(Box<Report>),
}

/// Returns what the job with these `options` finds in the place of its results. What was done before `submission` does not count.
/// Tasks may be doing the job again. The inputs are read only where all else says that the job is finished.
///
/// # Errors
/// [`Error::Io`] if the report or an input cannot be read, [`Error::Config`] if there are no inputs.
pub(crate) fn results_in_place(directory: &JobDirectory, options: &JobOptions, submission: u64) -> Result<InPlace> {
    if exists(&directory.output().report())? || single_process::is_noted(directory, 0)? {
        return Ok(InPlace::Nothing);
    }
    let Some(text) = read_if_there(&directory.results().report())? else { return Ok(InPlace::Nothing) };
    let is_sealed = seal(&text).is_some_and(|(own, found)| own == found);
    // A report of another version may have other fields.
    let report = serde_json::from_slice::<Report>(&text).ok().filter(|_| is_sealed);
    let Some(report) = report else { return Ok(InPlace::OtherJob) };
    let of_options = Fingerprint::of_options(options)?;
    if report.options_fingerprint != Some(of_options) || report.submission < submission {
        return Ok(InPlace::OtherJob);
    }
    if let Some((header, false)) = planned(directory, 0)?
        && header.fingerprint.changed_options(options)?.is_none()
    {
        return Ok(InPlace::Nothing);
    }
    let is_same = match on_threads(workers(options, 0)?, || Fingerprint::of(options)) {
        Ok(now) => report.job_fingerprint == Some(now.of_job(of_options)),
        // Who has moved the inputs away since has not undone the job.
        Err(why) if are_inputs_gone(&why) => true,
        Err(why) => return Err(why),
    };
    Ok(if is_same { InPlace::ThisJob(report.into()) } else { InPlace::OtherJob })
}

/// Says which earlier terrain the job with these `options` and the fingerprint `now` will replace; `None` if there is none, or that of the same
/// job.
///
/// # Errors
/// [`Error::Io`] if the report in place cannot be read, [`Error::Broken`] if the options have no fingerprint.
pub(crate) fn replaced_terrain(
    directory: &JobDirectory,
    options: &JobOptions,
    now: &Fingerprint,
) -> Result<Option<String>> {
    let Some(text) = read_if_there(&directory.results().report())? else { return Ok(None) };
    let of_options = Fingerprint::of_options(options)?;
    let report = serde_json::from_slice::<Report>(&text).ok();
    let what = match &report {
        None => "of another version of the program",
        Some(report) if report.options_fingerprint != Some(of_options) => "with other options",
        Some(report) if report.job_fingerprint != Some(now.of_job(of_options)) => "of other or changed inputs",
        Some(_) => return Ok(None),
    };
    let size = report.map_or(String::new(), |report| format!(" ({} triangles)", grouped(report.triangles)));
    let output = name(&options.output.directory);
    Ok(Some(format!("note: {output} has a terrain {what}{size}: this job replaces it")))
}

fn are_inputs_gone(why: &Error) -> bool {
    match why {
        Error::Config(_) => true,
        Error::Io { source, .. } => source.kind() == ErrorKind::NotFound,
        _ => false,
    }
}

/// Returns the latest submission that the journal, a note or a report in place tells of; 0 without one. What is done after it keeps its number,
/// so that its late tasks find that the job is done.
///
/// # Errors
/// [`Error::Io`] if the job directory or the report cannot be read.
pub(crate) fn known_submission(directory: &JobDirectory) -> Result<u64> {
    let text = read_if_there(&directory.results().report())?;
    let report = text.and_then(|text| serde_json::from_slice::<Report>(&text).ok());
    let header = journal::read::<JobHeader, IgnoredAny>(directory)?.and_then(|(header, ..)| header);
    let known = [report.map_or(0, |report| report.submission), header.map_or(0, |header| header.submission)];
    Ok(known.into_iter().fold(single_process::submission(directory)?, u64::max))
}

/// Tells whether the job directory holds nothing but the rest of a finished job: neither a note nor the journal of a job that has not
/// written its report.
///
/// # Errors
/// [`Error::Io`] if it cannot be read.
pub(crate) fn is_rest(directory: &JobDirectory) -> Result<bool> {
    if entries(directory.job())?.is_empty() {
        return Ok(false);
    }
    let journal = journal::read::<JobHeader, JournalEntry>(directory)?;
    let is_over = journal.is_none_or(|(_, entries, _)| entries.iter().any(|entry| entry.step == JobStep::Report));
    Ok(!single_process::is_noted(directory, 0)? && is_over)
}

/// Ends the removal of the rest of a finished job, if one is there.
///
/// # Errors
/// [`crate::Error::InUse`] if another process works in the job directory, [`Error::Io`] if a file cannot be removed.
pub(crate) fn remove_rest(directory: &JobDirectory, threads: usize) -> crate::Result<()> {
    if !is_rest(directory)? {
        return Ok(());
    }
    let _lock = Lock::take(directory.job())?;
    // Another process may have begun a job meanwhile.
    if is_rest(directory)? {
        on_threads(threads, || remove_job(directory))?;
    }
    Ok(())
}
