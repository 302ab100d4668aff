//! Points that lie so far from all others that they are mistakes, such as 0, 0, 0 among coordinates of a national grid: they are looked
//! for where they cost the others their precision.

use crate::options::JobOptions;
use crate::plan::extent::{Extent, SourceBox, to_float};
use crate::plan::lattice_choice::{LatticeRequest, fineness};
use crate::plan::point_survey::PointSurvey;
use crate::plan::rounded_box::{rounded, rounded_heights};
use crate::plan::text_inputs::row_choice;
use points::options::InputOptions;
use points::{FileFormat, Outliers, Source};
use rust_decimal::Decimal;
use sys::Result;
use tiles::frame::Frame;

/// Returns the box of the sources. If no lattice holds all of it at the precision of the inputs or to a millimetre, and some points lie so
/// far from all others that they are mistakes, these are left out, provided that this helps.
pub(crate) fn extent_without_outliers(
    sources: &mut [Source],
    options: &JobOptions,
    wish: &LatticeRequest,
) -> Result<Extent> {
    sources.iter_mut().for_each(Source::keep_outliers);
    let all = Extent::of(sources, &options.input, wish.metres[0])?;
    let before = fineness(sources, &all, wish);
    // The mesh knows better than headers.
    let has_proved_coarse = wish.coarsening.far_points;
    if before.is_meaningful() && !has_proved_coarse {
        return Ok(all);
    }
    let even_among_few = before.is_useless() || has_proved_coarse;
    if leave_out_outliers(sources, options, even_among_few, (!has_proved_coarse).then_some(&all))? {
        let rest = Extent::of(sources, &options.input, wish.metres[0])?;
        let helps = match has_proved_coarse {
            true => is_finer(sources, wish, [&rest, &with_outliers(sources, &all, &options.input)]),
            false => fineness(sources, &rest, wish).is_better_than(&before),
        };
        if helps {
            explain(sources, &rest);
            return Ok(rest);
        }
        sources.iter_mut().for_each(Source::keep_outliers);
    }
    Ok(all)
}

/// Leaves out the points that lie so far from all others that they are mistakes: all of them if they are rare in the job, or else those of
/// files in which they are rare. `even_among_few` tells whether one of a few points may be one; `claims` are the boxes of the sources, if
/// they can be believed. Returns whether there are any, or whether points lie elsewhere than is claimed.
fn leave_out_outliers(
    sources: &mut [Source],
    options: &JobOptions,
    even_among_few: bool,
    claims: Option<&Extent>,
) -> Result<bool> {
    let choice = row_choice(options);
    let (mut all, mut points) = (Outliers::default(), 0);
    for (index, source) in sources.iter_mut().enumerate() {
        all.add(match source.format {
            FileFormat::Text => source.leave_out_outliers(&choice)?,
            FileFormat::Las | FileFormat::Laz | FileFormat::Ept => {
                look_at(source, &options.input, claims.map(|extent| &extent.boxes[index]))?
            }
        });
        points += source.wanted_rows();
    }
    if !all.are_rare(points, even_among_few) {
        sources.iter_mut().filter(|source| source.has_frequent_outliers()).for_each(Source::keep_outliers);
    }
    Ok(sources.iter().any(|source| source.outliers() > 0 || source.measured().is_some()))
}

/// Looks where the points of a binary file lie, unless all that it claims is plausible. Returns its outliers.
fn look_at(source: &mut Source, options: &InputOptions, claim: Option<&Option<SourceBox>>) -> Result<Outliers> {
    let Some(survey) = PointSurvey::new(source, options) else { return Ok(Outliers::default()) };
    let Some(plausible) = survey.plausible_box()? else { return Ok(Outliers::default()) };
    if claim.is_some_and(|claim| claim.is_none_or(|claim| survey.holds_claim(&plausible, claim))) {
        return Ok(Outliers::default());
    }
    let measured = survey.measure(&plausible)?;
    let outliers = measured.outliers;
    source.set_measured(measured);
    Ok(outliers)
}

/// Returns the box of all points, mistakes included. `claimed` is the box of the sources before these were looked at.
fn with_outliers(sources: &[Source], claimed: &Extent, options: &InputOptions) -> Extent {
    let box_of = |(source, claim): (&Source, &Option<SourceBox>)| source.measured().map_or(*claim, |found| found.all);
    Extent::around(sources.iter().zip(&claimed.boxes).map(box_of).collect(), options)
}

/// Tells whether the first of two extents allows finer steps than the second.
pub(crate) fn is_finer(sources: &[Source], wish: &LatticeRequest, [a, b]: [&Extent; 2]) -> bool {
    let [a, b] = [a, b].map(|extent| coarsenings(sources, wish, extent));
    (0..2).any(|axes| a[axes] < b[axes])
}

/// Returns a warning about the file that lies farthest from the one with the most points, if that is three quarters of the width of all or more.
pub(crate) fn farthest_file(sources: &[Source], extent: &Extent) -> Option<String> {
    let placed = || sources.iter().zip(&extent.boxes).filter_map(|(source, claim)| Some((source, (*claim)?)));
    let middle = |[min, max]: SourceBox| [0, 1].map(|axis| (min[axis] + max[axis]) / 2.0);
    // Of files with as many points the first by name, whatever their order.
    let more = |a: &Source, b: &Source| a.records.cmp(&b.records).then(b.path.cmp(&a.path));
    let (_, main) = placed().max_by(|(a, _), (b, _)| more(a, b))?;
    let distance = |claim: SourceBox| {
        let ([x, y], [a, b]) = (middle(claim), middle(main));
        (x - a).abs().max((y - b).abs())
    };
    let (source, found) = placed().max_by(|(_, a), (_, b)| distance(*a).total_cmp(&distance(*b)))?;
    let size = extent.size(0).max(extent.size(1));
    let [x, y] = [0, 1].map(|axis| rounded([found[0][axis], found[1][axis]]));
    (4.0 * distance(found) >= 3.0 * size).then(|| {
        format!(
            "the file farthest from the others is {} (x {} to {}, y {} to {}); fix: leave it out of [input] files, or its points with \
             [input] bounds, if it is a mistake",
            source.path.display(),
            x[0],
            x[1],
            y[0],
            y[1]
        )
    })
}

/// The most powers of ten that are tried.
const MOST_POWERS: u32 = 28;

/// Returns by how many powers of ten steps must be coarser than those of the inputs so that glTF holds a triangle across all of `extent`:
/// in x and y, and in z.
fn coarsenings(sources: &[Source], wish: &LatticeRequest, extent: &Extent) -> [u32; 2] {
    let finest = |axis: usize| sources.iter().map(|source| source.axes[axis].scale).min().unwrap_or(Decimal::ONE);
    let steps = [finest(0).min(finest(1)), finest(2)].map(to_float);
    let sizes = [extent.size(0).max(extent.size(1)), extent.size(2)];
    [0, 1].map(|axes| {
        let step = |power: u32| steps[axes] * wish.metres[axes] * 10f64.powi(power as i32);
        let holds = |power: &u32| sizes[axes] * wish.metres[axes] < Frame::longest_at(step(*power));
        (0..MOST_POWERS).find(holds).unwrap_or(MOST_POWERS)
    })
}

/// Has the message about the first outlier of every file tell where the `rest` lies, and what to do.
fn explain(sources: &mut [Source], rest: &Extent) {
    let [x, y, z] = [0, 1, 2].map(|axis| rounded([rest.min[axis], rest.max[axis]]));
    for source in sources.iter_mut().filter(|source| source.outliers() > 0) {
        let is_beside = is_beside(source.box_with_outliers(), rest);
        let bounds = match is_beside {
            true => format!("[input] bounds = [{}, {}, {}, {}] or ", x[0], y[0], x[1], y[1]),
            false => {
                let heights = [rest.min[2], rest.max[2]].map(|height| height / source.factor_of_heights());
                let [low, high] = rounded_heights(heights);
                format!("[input] heights = [{low}, {high}] or ")
            }
        };
        let points = if source.format.is_text() { "rows" } else { "points" };
        // The message shows a row as the file has it.
        let place = match source.transformed_from() {
            Some(_) if source.format.is_text() => format!("in {}, ", source.crs.label()),
            _ => String::new(),
        };
        source.set_remedy(&format!(
            " ({place}x from {} to {}, y from {} to {}, z from {} to {}), and no lattice holds both at full precision: leave such {points} out with \
             {bounds}max_malformed_fraction, or set resolution or resolution_z so coarse that they fit",
            x[0], x[1], y[0], y[1], z[0], z[1]
        ));
    }
}

/// Tells whether a box reaches beyond the `rest` in x or y, so that bounds leave something of it out. One that is no place of the map does.
fn is_beside(all: Option<SourceBox>, rest: &Extent) -> bool {
    let [x, y] = [0, 1].map(|axis| rest.size(axis));
    let margin = x.max(y) / 2.0;
    all.is_none_or(|[min, max]| (0..2).any(|k| min[k] < rest.min[k] - margin || max[k] > rest.max[k] + margin))
}
