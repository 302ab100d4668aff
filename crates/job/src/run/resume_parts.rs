//! Going on with an interrupted job of several parts, and with one of its parts.

use crate::durable::atomic_file::{create_folder, remove_file};
use crate::durable::directory::JobDirectory;
use crate::partition::result::Partition;
use crate::plan::fingerprint::{JobChange, JobHeader};
use crate::progress::stage::{JobProgress, ProgressOutput};
use crate::records::{JobStep, Journal, JournalEntry};
use crate::run::part_entries::{forget_levels, open_store, records_of};
use crate::run::resume::{EarlierRun, KeptSteps, ResumeReview, RunStart};
use crate::run::single_process::SingleProcess;
use std::time::SystemTime;
use sys::Result;
use tiles::options::MaxEdge;

/// Begins a run of a job of several parts, as [`crate::run::resume::start`] does of others. What is in the folders of its parts stays if the job is the same.
///
/// # Errors
/// [`sys::Error::Io`] on the job directory.
pub(crate) fn start_parts<'a>(
    directory: &'a JobDirectory,
    header: &JobHeader,
    earlier: Option<EarlierRun>,
    progress: ProgressOutput,
) -> Result<RunStart<'a>> {
    let same = earlier.and_then(|earlier| same_job_of_parts(header, earlier, progress));
    let (entries, header, resumed) = match same {
        Some((old, entries, of_parts)) => {
            if header.fingerprint.memory != old.fingerprint.memory {
                forget_levels(directory)?;
            }
            let steps = entries.len() as u64 + of_parts;
            if steps > 0 {
                progress.note(&format!("going on with an interrupted run: {steps} steps are done"));
            }
            // Only a plan that stays calls the inputs what they were called.
            let fingerprint = match entries.is_empty() {
                true => header.fingerprint.clone(),
                false => header.fingerprint.with_names_of(&old.fingerprint),
            };
            (entries, JobHeader { fingerprint, id: old.id, begun: old.begun, ..*header }, of_parts)
        }
        None => {
            remove_file(&directory.journal())?;
            directory.clear_parts()?;
            directory.clear(&SingleProcess::notes(directory)?)?;
            (
                Vec::new(),
                JobHeader { id: new_id(), begun: header.begun.or(Some(SystemTime::now())), ..header.clone() },
                0,
            )
        }
    };
    create_folder(&directory.output().tiles())?;
    let records = records_of(&entries);
    let store = open_store(directory, &records)?;
    let journal = Journal::begin(directory, &header, entries)?;
    Ok(RunStart { store, journal, partition: None, job_id: header.id, resumed })
}

/// Returns the header of an earlier run of the same job, its entry that stays (the plan), and the number of steps of its parts.
fn same_job_of_parts(
    header: &JobHeader,
    earlier: EarlierRun,
    progress: ProgressOutput,
) -> Option<(JobHeader, Vec<JournalEntry>, u64)> {
    let EarlierRun { header: old, mut entries, of_parts, .. } = earlier;
    let old = old.filter(|old| old.coarsening == header.coarsening && old.id != 0)?;
    match header.fingerprint.since(&old.fingerprint) {
        JobChange::Nothing => {}
        JobChange::Raster(what) => {
            progress.note(&format!("changed since the interrupted run: {what}; the tiles stay"));
        }
        JobChange::Style(what) | JobChange::Mesh(what) => {
            progress.note(&format!("changed since the interrupted run: {what}; starting over"));
            return None;
        }
    }
    entries.retain(|entry| entry.step == JobStep::Plan);
    Some((old, entries, of_parts.count))
}

/// Returns a number that no other run has.
fn new_id() -> u64 {
    let time = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    let nanoseconds = time.map_or(0, |time| time.as_nanos() as u64);
    (nanoseconds ^ u64::from(std::process::id()) << 40).max(1)
}

/// Returns the entries of a part, whose folder is locked, that stay, and its partition if that does.
///
/// # Errors
/// [`sys::Error::Io`] on its folder.
pub(crate) fn resume_part(
    directory: &JobDirectory,
    entries: Vec<JournalEntry>,
    max_edge: MaxEdge,
    progress: &JobProgress,
) -> Result<(Vec<JournalEntry>, Option<Partition>)> {
    // What the part read is for other parts too.
    let (mut kept, entries): (Vec<_>, Vec<_>) =
        entries.into_iter().partition(|entry| matches!(entry.step, JobStep::Read(_)));
    let review = match entries.is_empty() {
        true => None,
        false => {
            let stage = progress.stage("check", entries.len() as u64, "steps");
            let review = ResumeReview::of(directory, entries, max_edge == MaxEdge::Auto, &stage)?;
            stage.finish();
            review
        }
    };
    let KeptSteps { entries, mut files, partition, .. } = review.map(ResumeReview::into_kept).unwrap_or_default();
    kept.extend(entries);
    if !kept.is_empty() {
        files.extend(directory.store().iter().map(|path| directory.name(path)));
    }
    directory.clear_own(&files)?;
    Ok((kept, partition))
}
