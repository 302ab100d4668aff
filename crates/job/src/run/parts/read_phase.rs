//! Reading the inputs, each by the first part that needs it.

use crate::index::PartIndex;
use crate::mesh::precision_limit::PrecisionLimit;
use crate::partition::part_points::{PointsOfPart, ReadInputs, check_malformed, read_inputs};
use crate::partition::result::PointSummary;
use crate::plan::no_points::no_point_is_left;
use crate::records::JobStep;
use crate::run::part_entries::{entries_of_steps, is_whole, open_store, records_of};
use crate::run::parts::done::Done;
use crate::run::parts::part_journal::PartSession;
use crate::run::parts::parts_job::PartsJob;
use crate::{Error, Result};
use delaunay::geometry::Bounds;

/// Reads the inputs that `reader` is the first to need, unless that is done. Inputs before them had `malformed` records.
///
/// # Errors
/// Those of [`read_inputs`]; [`Error::InUse`] if another process has the folder.
pub(crate) fn read_for(job: &PartsJob, reader: PartIndex, malformed: u64) -> Result<ReadInputs> {
    let PartsJob { plan, parts, .. } = *job;
    let inputs = parts.new_inputs(reader);
    if inputs.is_empty() {
        return Ok(ReadInputs::default());
    }
    if let Some(done) = done(job, reader)? {
        return Ok(done.figures);
    }
    let directory = &job.directory.part(reader);
    let lock = directory.lock_within()?;
    // Another process may have done it since.
    if let Some(done) = done(job, reader)? {
        return Ok(done.figures);
    }
    let session = PartSession::begin(directory, lock, job.header(reader), Vec::new())?;
    let records = inputs.iter().map(|&input| plan.inputs[input].source.records).sum();
    let stage = job.progress.stage("read", records, "points");
    let (read, blocks) = read_inputs(plan, parts, job.directory, reader, malformed, job.syncs_points(), &stage)?;
    let record = blocks.save(&session.store, reader)?;
    Ok(session.finish(JobStep::Read(reader), read, vec![stage.finish()], vec![record])?)
}

fn done(job: &PartsJob, reader: PartIndex) -> sys::Result<Option<Done<ReadInputs>>> {
    let step = JobStep::Read(reader);
    Done::find(&entries_of_steps(&job.directory.part(reader), job.header(reader), |found| found == step)?, step)
}

/// Returns where the points of `part` are, which all of its readers must have found.
///
/// # Errors
/// [`Error::DamagedSteps`] if what a reader wrote down is damaged, [`sys::Error::Io`] if it cannot be read.
pub(crate) fn points_of<'a>(job: &PartsJob<'a>, part: PartIndex) -> Result<PointsOfPart<'a>> {
    let mut points = PointsOfPart::none(job.plan, job.parts, part);
    for reader in job.parts.readers_of(part) {
        let (step, directory) = (JobStep::Read(reader), job.directory.part(reader));
        let entries = entries_of_steps(&directory, job.header(reader), |found| found == step)?;
        let read = Done::find(&entries, step)?;
        let read: Done<ReadInputs> =
            read.ok_or_else(|| sys::Error::Broken(format!("the inputs of part {reader} were not read")))?;
        let store = open_store(&directory, &records_of(&entries))?;
        if job.checks && !entries.iter().all(|entry| is_whole(&directory, &store, entry)) {
            return Err(Error::DamagedSteps);
        }
        points.add(reader, &store, &read.figures)?;
    }
    if job.checks && !points.are_whole(&job.directory.part(part)) {
        return Err(Error::DamagedSteps);
    }
    Ok(points)
}

/// Sums up what all inputs held. Returns the sums and the box of the points.
///
/// # Errors
/// [`sys::Error::Input`] if too many records are malformed, [`Error::NoTerrain`] or [`sys::Error::Config`] if no point is left,
/// [`Error::TooFine`] if no mesh can hold the heights.
pub(crate) fn sum_up<'a>(
    job: &PartsJob,
    read: impl Iterator<Item = &'a ReadInputs> + Clone,
) -> Result<(PointSummary, Bounds<3>)> {
    check_malformed(job.plan, read.clone())?;
    let mut summary = PointSummary::default();
    read.for_each(|inputs| summary += inputs.summary.clone());
    let points = summary.bounds.ok_or_else(|| no_point_is_left(job.plan, &summary.counts))?;
    let bounds = job.plan.with_lines(points);
    PrecisionLimit::of(&job.plan.frame).check_heights(bounds)?;
    Ok((summary, bounds))
}
