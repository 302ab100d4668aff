//! The job that the phase plan has left, as tasks find it.

use crate::durable::directory::JobDirectory;
use crate::durable::journal;
use crate::durable::listing::entries;
use crate::index::PartIndex;
use crate::options::JobOptions;
use crate::partition::parts::Parts;
use crate::plan::fingerprint::{Fingerprint, JobHeader, PLAN_AGAIN};
use crate::plan::input_identity::InputChange;
use crate::plan::inputs::input_paths;
use crate::plan::job_plan::Plan;
use crate::records::{JobStep, JournalEntry};
use crate::run::part_entries::{PartEntries, PartHeader};
use sys::{Error, Result};

/// A job of several parts that is planned.
pub(crate) struct PlannedJob {
    pub(crate) directory: JobDirectory,
    pub(crate) header: JobHeader,
    pub(crate) plan: Plan,
    pub(crate) parts: Parts,
    /// Whether all results are written, so that only their places are left to take.
    pub(crate) is_complete: bool,
}

impl PlannedJob {
    /// Opens the plan in the job directory; `None` if there is none of a job of several parts, or only one from before `submission`.
    ///
    /// # Errors
    /// [`Error::Config`] if the options have changed since; [`Error::Io`] or [`Error::Broken`] on the plan.
    pub(crate) fn open(directory: &JobDirectory, options: &JobOptions, submission: u64) -> Result<Option<PlannedJob>> {
        let Some((header, is_complete)) = planned(directory, submission)? else { return Ok(None) };
        if let Some(what) = header.fingerprint.changed_options(options)? {
            return Err(Error::Config(format!("{what}: changed since the job was planned; {PLAN_AGAIN}")));
        }
        let plan = Plan { options: options.clone(), ..Plan::read(&directory.plan())? };
        let parts = Parts::of(&plan);
        // One process does a small job.
        let has_tasks = parts.all().len() > 1;
        Ok(has_tasks.then(|| PlannedJob { directory: directory.clone(), header, parts, plan, is_complete }))
    }

    /// Returns the phases of `part`, or of the nodes above the parts, that are complete.
    ///
    /// # Errors
    /// [`Error::Io`] if its journal cannot be read.
    pub(crate) fn entries(&self, part: PartIndex) -> Result<PartEntries> {
        PartEntries::of(&self.directory, &self.parts, PartHeader { job: self.header.id, part })
    }

    /// Checks that the inputs of these numbers are those that were planned, and calls them what they are called by now.
    ///
    /// # Errors
    /// [`Error::Config`] if one has changed, [`Error::Io`] if one cannot be read.
    pub(crate) fn find_inputs(&mut self, inputs: impl Iterator<Item = usize>) -> Result<()> {
        let renamed = self.header.fingerprint.present_names(&input_paths(&self.plan.options.input)?);
        let renamed =
            renamed.ok_or_else(|| Error::Config(format!("[input] files names other files now; {PLAN_AGAIN}")))?;
        let known: Vec<_> = self.plan.inputs.iter().map(|input| input.source.path.clone()).collect();
        self.plan.rename_inputs(&renamed);
        for input in inputs {
            let now = &self.plan.inputs[input].source.path;
            let what = match self.header.change_of(&known[input], now)? {
                InputChange::Nothing => continue,
                InputChange::Content => format!("has changed since the job was planned; {PLAN_AGAIN}"),
                InputChange::Time => format!("was modified after the job was planned; {PLAN_AGAIN}"),
            };
            return Err(Error::Config(format!("{} {what}", now.display())));
        }
        Ok(())
    }
}

/// Tells whether the job with these `options` and this fingerprint is planned, after `submission`. One process may have begun a small job, which
/// has no tasks.
///
/// # Errors
/// [`Error::Io`] or [`Error::Broken`] on the plan or the journal.
pub(crate) fn is_planned(
    directory: &JobDirectory,
    options: &JobOptions,
    fingerprint: &Fingerprint,
    submission: u64,
) -> Result<bool> {
    let is_same = planned(directory, submission)?.is_some_and(|(header, _)| fingerprint.is_same_job(&header));
    Ok(is_same && PlannedJob::open(directory, options, submission)?.is_some())
}

/// Returns the header of the planned job of several parts in the job directory, and whether all its results are written. A plan from before
/// `submission` does not count.
///
/// # Errors
/// [`Error::Io`] if its journal cannot be read.
pub(crate) fn planned(directory: &JobDirectory, submission: u64) -> Result<Option<(JobHeader, bool)>> {
    // Other machines may have made the folders.
    directory.probe()?;
    entries(&directory.parts())?;
    let read = journal::read::<JobHeader, JournalEntry>(directory)?;
    let Some((Some(header), entries, _)) = read else { return Ok(None) };
    let is_planned = |step: JobStep| entries.iter().any(|entry| entry.step == step);
    let mut own = entries.iter().flat_map(|entry| &entry.files).filter(|file| !directory.is_result(&file.name));
    let is_planned_and_whole = header.submission >= submission
        && is_planned(JobStep::Plan)
        && own.try_fold(true, |all, file| Ok::<_, Error>(all && file.try_is_whole(directory)?))?;
    Ok(is_planned_and_whole.then(|| (header, is_planned(JobStep::Report))))
}
