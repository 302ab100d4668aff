//! What the inputs really hold, where their headers do not tell: one proved wrong, or bad files are to be left out.

use crate::options::JobOptions;
use crate::plan::job_plan::Claims;
use crate::plan::suspect_heights::unannounced_nodata;
use crate::plan::text_inputs::{allowed_malformed, too_many_malformed};
use delaunay::geometry::Bounds;
use lattice::Lattice;
use points::options::OnBadFile;
use points::{Point, PointCounts, PointRules, Source};
use rayon::prelude::*;
use sys::{Result, interrupt};

/// The box and the counts of the points of an input.
type Measured = (Option<Bounds<3>>, PointCounts);

/// Returns the lattice box of the points of each source, and what they tell of all points; nothing without a point. A source without points
/// has the first corner of `extent`.
///
/// # Errors
/// [`crate::Error::BadInputs`] names all bad sources if they are to be left out; [`sys::Error::Io`] if one cannot be read.
pub(crate) fn measured_claims(
    sources: &[Source],
    rules: &[PointRules],
    lattice: &Lattice,
    options: &JobOptions,
    extent: Bounds<2>,
) -> crate::Result<(Vec<Bounds<2>>, Option<Claims>)> {
    let (mut boxes, mut all, mut max_rgb, mut bad) = (Vec::with_capacity(sources.len()), None, 0, Vec::new());
    for (source, rules) in sources.iter().zip(rules) {
        let (bounds, counts) = measure(source, rules)?;
        if options.input.on_bad_file == OnBadFile::Skip {
            let why = bad_input(source, &counts, bounds, lattice, options);
            bad.extend(why.map(|why| (source.path.clone(), why)));
        }
        let first = Bounds { min: extent.min, max: extent.min };
        boxes.push(bounds.map_or(first, |Bounds { min, max }| Bounds { min: [min[0], min[1]], max: [max[0], max[1]] }));
        all = union(all, bounds);
        max_rgb = max_rgb.max(counts.max_rgb);
    }
    match bad.is_empty() {
        true => Ok((boxes, all.map(|bounds| Claims { bounds, max_rgb }))),
        false => Err(crate::Error::BadInputs(bad)),
    }
}

/// Tells what is wrong with an input of which `counts` and `bounds` were read, if anything is. Each is judged by itself, so the others have no
/// say in it.
pub(crate) fn bad_input(
    source: &Source,
    counts: &PointCounts,
    bounds: Option<Bounds<3>>,
    lattice: &Lattice,
    options: &JobOptions,
) -> Option<String> {
    let (malformed, records) = (counts.malformed, source.records);
    let allowed = allowed_malformed(options.input.max_malformed_fraction.0, records);
    // Where bad files stop the job, the records of all files together decide.
    let has_too_many = options.input.on_bad_file == OnBadFile::Skip && malformed > allowed;
    let too_many = || has_too_many.then(|| too_many_malformed(counts, malformed, records));
    unannounced_nodata(source, bounds, lattice, options).or_else(too_many)
}

/// Decodes a source, and all of it if its index proves wrong.
fn measure(source: &Source, rules: &PointRules) -> Result<Measured> {
    let (bounds, counts) = pass(source, rules, false)?;
    if counts.misplaced == 0 || counts.not_decoded == 0 {
        return Ok((bounds, counts));
    }
    let (more, rest) = pass(source, rules, true)?;
    Ok(sum((bounds, counts), (more, rest)))
}

/// Decodes all chunks of a source: what bounds leave in, or what an index leaves out.
fn pass(source: &Source, rules: &PointRules, left_out: bool) -> Result<Measured> {
    let _ahead = source.read_ahead(rules.bounds.as_ref(), left_out)?;
    let measure_chunk = |chunk: usize| {
        interrupt::check()?;
        let mut bounds = None;
        let mut see = |points: &[Point]| {
            let found = Bounds::of_points(points.iter().map(|point| point.corner()));
            bounds = union(bounds, found);
            Ok(())
        };
        let counts = match left_out {
            false => source.decode(chunk, rules, &mut see),
            true => source.decode_left_out(chunk, rules, &mut see),
        };
        Ok((bounds, counts?))
    };
    let chunks = (0..source.chunks()).into_par_iter().with_max_len(1);
    // The reduction keeps the order of the chunks.
    chunks.map(measure_chunk).try_reduce(Measured::default, |a, b| Ok(sum(a, b)))
}

fn sum((bounds, mut counts): Measured, (more, others): Measured) -> Measured {
    counts += others;
    (union(bounds, more), counts)
}

fn union(a: Option<Bounds<3>>, b: Option<Bounds<3>>) -> Option<Bounds<3>> {
    a.into_iter().chain(b).reduce(Bounds::union)
}
