//! Reading the inputs, each by the first part that needs it.

use crate::index::PartIndex;
use crate::mesh::precision_limit::PrecisionLimit;
use crate::partition::part_points::{PointsOfPart, ReadInputs, check_malformed, read_inputs};
use crate::partition::result::PointSummary;
use crate::plan::area_hint::stretch_of_read;
use crate::plan::no_points::no_point_is_left;
use crate::records::JobStep;
use crate::run::folder::once;
use crate::run::job::Job;
use crate::{Error, Result};
use delaunay::geometry::Bounds;

/// Reads the inputs that `reader` is the first to need, unless that is done. Inputs before them had `malformed` records.
///
/// # Errors
/// Those of [`read_inputs`]; [`Error::InUse`] if another process has the folder.
pub(crate) fn read_for(job: &Job, reader: PartIndex, malformed: u64) -> Result<ReadInputs> {
    let Job { plan, parts, .. } = *job;
    let inputs = parts.new_inputs(reader);
    if inputs.is_empty() {
        if plan.options.updates && job.entries(reader)?.has(JobStep::Read) {
            job.forget_from(reader, JobStep::Read)?;
        }
        return Ok(ReadInputs::default());
    }
    once(job, reader, JobStep::Read, plan.key_of_inputs(inputs), |folder| {
        let records = inputs.iter().map(|&input| plan.inputs[input].source.records).sum();
        let stage = job.progress.stage("read", records, "points");
        let (read, blocks) = read_inputs(plan, parts, job.directory, reader, malformed, job.syncs(), &stage)?;
        blocks.save(&folder.store, reader)?;
        Ok(folder.record(JobStep::Read, read, vec![stage.finish()])?)
    })
}

/// Returns where the points of `part` are, which all of its readers must have found.
///
/// # Errors
/// [`Error::DamagedSteps`] if points are damaged, [`sys::Error::Io`] if what a reader wrote down cannot be read.
pub(crate) fn points_of<'a>(job: &Job<'a>, part: PartIndex) -> Result<PointsOfPart<'a>> {
    checked(job, part, listed_points_of(job, part)?)
}

/// Returns these points of `part`, unless they are damaged.
pub(super) fn checked<'a>(job: &Job, part: PartIndex, points: PointsOfPart<'a>) -> Result<PointsOfPart<'a>> {
    match job.checks_points && !points.are_whole(&job.folder(part))? {
        true => Err(Error::DamagedSteps),
        false => Ok(points),
    }
}

/// As [`points_of`], whether the points are damaged or not.
///
/// # Errors
/// [`sys::Error::Io`] if what a reader wrote down cannot be read.
pub(crate) fn listed_points_of<'a>(job: &Job<'a>, part: PartIndex) -> Result<PointsOfPart<'a>> {
    let mut points = PointsOfPart::none(job.plan, job.parts, part);
    for reader in job.parts.readers_of(part) {
        let entries = job.entries(reader)?;
        points.add(reader, &entries.store()?, &entries.figures(JobStep::Read)?)?;
    }
    Ok(points)
}

/// Sums up what all inputs held that are read. Returns the sums and the box of the points.
///
/// # Errors
/// [`sys::Error::Io`] if a journal cannot be read, [`sys::Error::Input`] if too many records are malformed, [`Error::NoTerrain`] or [`sys::Error::Config`] if no point is left,
/// [`Error::TooFine`] if no mesh can hold the heights.
pub(crate) fn sum_up(job: &Job) -> Result<(PointSummary, Bounds<3>)> {
    let read = job.parts.all().map(|part| job.entries(part)?.known(JobStep::Read));
    let mut read: Vec<ReadInputs> = read.filter_map(sys::Result::transpose).collect::<sys::Result<_>>()?;
    for inputs in &mut read {
        inputs.renumber_inputs(job.parts);
        inputs.rename_inputs(job.plan);
    }
    check_malformed(job.plan, read.iter())?;
    let mut summary = PointSummary::default();
    read.into_iter().for_each(|inputs| summary += inputs.summary);
    let points = summary.bounds.ok_or_else(|| no_point_is_left(job.plan, &summary.counts))?;
    let bounds = job.plan.with_lines(points);
    PrecisionLimit::of(&job.plan.frame).check_heights(bounds)?;
    summary.counts.notes.extend(stretch_of_read(job.plan, bounds)?);
    Ok((summary, bounds))
}
