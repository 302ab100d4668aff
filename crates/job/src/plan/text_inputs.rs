//! What the plan knows of texts, which are read once before it is made: rows that nobody wants, mistakes, degrees.

use crate::options::JobOptions;
use crate::plan::extent::Extent;
use crate::plan::height_range::HeightSample;
use crate::plan::job_plan::Plan;
use crs::{CrsChoice, CrsKind, Unit};
use points::options::{InputOptions, OnBadFile, UnitChoice};
use points::surface::Surface;
use points::surface_warnings::no_column_of_classes;
use points::{KeptReturns, OptionalFields, PointCounts, PointRules, RowChoice, Source, TextReading};
use rayon::prelude::*;
use sys::{Error, Result, interrupt};

/// Returns which rows of a text the job wants.
pub(crate) fn row_choice(options: &JobOptions) -> RowChoice {
    options.input.row_choice(wanted_fields(options))
}

/// Returns how the texts of a plan are read.
pub(crate) fn text_reading(plan: &Plan) -> TextReading {
    let sources = || plan.inputs.iter().map(|input| &input.source).filter(|source| source.format.is_text());
    let OptionalFields { rgb, intensity } = wanted_fields(&plan.options);
    TextReading {
        colors: rgb,
        intensity,
        outliers_left_out: sources().any(|source| source.outliers() > 0),
        even_among_few: sources().any(Source::has_frequent_outliers),
    }
}

/// Returns what the job wants of points besides place and class.
pub(crate) fn wanted_fields(options: &JobOptions) -> OptionalFields {
    let output = &options.output;
    OptionalFields { rgb: output.color.may_be_own(), intensity: output.attributes.intensity }
}

/// Fails if the columns of a text are longitude and latitude, unless the user states twice that they are lengths: with a map or no CRS, and
/// with a unit.
///
/// # Errors
/// [`Error::Config`] names the first such file.
pub(crate) fn refuse_degrees(sources: &[Source], options: &InputOptions) -> Result<()> {
    let is_in_degrees = |s: &&Source| s.format.is_text() && s.crs.horizontal == Unit::Degree;
    // What is said of longitude and latitude is refused elsewhere.
    let is_map = match &options.crs {
        CrsChoice::Given { crs, .. } => crs.kind == CrsKind::Projected,
        _ => options.missing_crs.as_ref().is_some_and(|missing| missing.crs.kind == CrsKind::Projected),
    };
    let is_silent = matches!(options.crs, CrsChoice::Auto | CrsChoice::First) && !is_map;
    let is_open = is_silent || is_map && options.unit == UnitChoice::Auto;
    match sources.iter().find(is_in_degrees) {
        Some(source) if is_open => Err(Error::Config(format!(
            "{}: its columns are named as degrees (x from {} to {}, y from {} to {}{}), {}; fix: [input] to_crs = \"utm\" with \
             missing_crs = \"EPSG:4326\" for longitude and latitude of WGS 84; [input] crs = \"none\" and unit, such as \"metre\", if \
             they are not degrees",
            source.path.display(),
            source.min[0],
            source.max[0],
            source.min[1],
            source.max[1],
            if is_exchanged(source) { "; longitude and latitude look exchanged" } else { "" },
            why_no_degrees(options)
        ))),
        _ => Ok(()),
    }
}

/// Says what speaks against a text in degrees.
fn why_no_degrees(options: &InputOptions) -> String {
    match options.unit {
        UnitChoice::Auto => "and a Delaunay triangulation in degrees is distorted".into(),
        unit => format!("but [input] unit is {}, which is not a unit of degrees", unit.unit().name()),
    }
}

/// Returns whether y is no latitude, and x is one.
fn is_exchanged(source: &Source) -> bool {
    let farthest = |axis: usize| source.min[axis].abs().max(source.max[axis].abs());
    farthest(1) > 90.0 && farthest(0) <= 90.0
}

/// Fails if the user asks for classes, and a text has none: all of its points would be left out.
///
/// # Errors
/// [`Error::Config`] names the first such file, and [`crate::Error::NoTerrain`] if it is the ground that the user asks for.
pub(crate) fn refuse_missing_classes(sources: &[Source], options: &InputOptions) -> crate::Result<()> {
    // A point without a class counts as one of class 0.
    if !options.chooses_classes() || options.kept_classes()[0] {
        return Ok(());
    }
    let lacks_classes = |source: &&Source| source.format.is_text() && !source.has_class;
    match (sources.iter().find(lacks_classes), &options.classes) {
        // As for a LAS file without ground.
        (Some(source), _) if options.surface == Surface::Ground => {
            Err(crate::Error::NoTerrain(format!("{}: {}", source.path.display(), no_column_of_classes())))
        }
        (Some(source), classes) => Err(Error::Config(format!(
            "[input] classes = {:?}, but {} has no column of classes, so that none of its points would be left: let `classes` have 0 in \
             it to keep points without a class, name the column with `columns` under [input.csv], or leave the file out",
            classes.as_deref().unwrap_or_default(),
            source.path.display()
        ))
        .into()),
        (None, _) => Ok(()),
    }
}

/// Fails if the user asks for returns, and a text does not say which return its points are.
///
/// # Errors
/// [`Error::Config`] names the first such file.
pub(crate) fn refuse_missing_returns(sources: &[Source], options: &InputOptions) -> Result<()> {
    let columns = match options.kept_returns() {
        KeptReturns::All => return Ok(()),
        // The ground can be found without.
        KeptReturns::Last if options.finds_ground() => return Ok(()),
        KeptReturns::Last => "return_number and number_of_returns",
        KeptReturns::First | KeptReturns::Numbers(_) => "return_number",
    };
    match sources.iter().find(|source| source.format.is_text() && !source.has_returns) {
        Some(source) => Err(Error::Config(format!(
            "[input] surface or returns choose some returns, but {} has no returns: it needs {columns}; \
             name the columns with `columns` under [input.csv], leave the file out, or keep all returns",
            source.path.display()
        ))),
        None => Ok(()),
    }
}

/// Returns a warning about the row that lies farthest from the middle of its file, if it makes the lattice coarse: if it lies
/// three quarters as far out as the job is wide, or farther: the outermost row of an even area lies half as far out. Files that lie far apart do so
/// without such a row.
///
/// # Errors
/// [`Error::Io`] if a file cannot be read.
pub(crate) fn farthest_row(sources: &[Source], options: &JobOptions, extent: &Extent) -> Result<Option<String>> {
    let choice = row_choice(options);
    let mut farthest: Option<(f64, String)> = None;
    for source in sources {
        let row = source.farthest_row(&choice)?;
        farthest = row.into_iter().chain(farthest).max_by(|a, b| a.0.total_cmp(&b.0));
    }
    let size = extent.size(0).max(extent.size(1)).max(extent.size(2));
    Ok(farthest.filter(|(distance, _)| 4.0 * distance >= 3.0 * size).map(|(_, row)| {
        format!("the row farthest from the others is {row}; fix: remove it, or leave it out with [input] bounds, if it is a mistake")
    }))
}

/// Returns how many of `records` may be malformed.
pub fn allowed_malformed(fraction: f64, records: u64) -> u64 {
    (fraction * records as f64) as u64
}

/// Returns the error for a file with too many malformed records, where bad files are not left out. `others` are the malformed records of the
/// other files, as far as they are known.
pub fn stop_at<'a>(
    source: &Source,
    counts: &PointCounts,
    others: impl Iterator<Item = (&'a Source, u64)>,
    [malformed, records]: [u64; 2],
) -> Error {
    let what = too_many_malformed(counts, malformed, records) + &in_other_files(source, others);
    Error::input(
        &source.path,
        format!(
            "{what}; fix: copy or repair the file, leave it out with [input] on_bad_file = \"skip\", or raise [input] \
             max_malformed_fraction to read the rest"
        ),
    )
}

/// Returns a remark about the malformed records of other files than `source`; empty if there are none.
fn in_other_files<'a>(source: &Source, others: impl Iterator<Item = (&'a Source, u64)>) -> String {
    let bad: Vec<(&Source, u64)> = others.filter(|(other, count)| *count > 0 && other.path != source.path).collect();
    let Some((first, _)) = bad.first() else { return String::new() };
    let records: u64 = bad.iter().map(|(_, count)| count).sum();
    let files = match bad.len() {
        1 => String::new(),
        2 => " and 1 other file".into(),
        count => format!(" and {} other files", count.saturating_sub(1)),
    };
    format!("; {records} more in {}{files}", first.path.display())
}

/// Returns a sentence about a file with too many malformed records.
pub(crate) fn too_many_malformed(counts: &PointCounts, malformed: u64, records: u64) -> String {
    let examples = counts.examples.join("; ");
    format!(
        "{malformed} of {records} records are malformed, more than [input] max_malformed_fraction allows: {examples}"
    )
}

/// Checks the number of malformed records, as far as it is known of texts, and of other files with outliers, so that `check` says what the
/// job would say.
///
/// # Errors
/// [`Error::Input`] names the first file with too many.
pub(crate) fn check_malformed_rows(sources: &[Source], rules: &[PointRules], options: &JobOptions) -> Result<()> {
    let input = &options.input;
    let fraction = input.max_malformed_fraction.0;
    let is_known = |source: &&Source| source.format.is_text() || source.outliers() > 0;
    let rows = |source: &Source| (source.known_malformed(), source.records);
    let all = sources.iter().map(rows).fold((0, 0), |(bad, records), more| (bad + more.0, records + more.1));
    for (source, rules) in
        sources.iter().zip(rules).filter(|(source, _)| is_known(source) && source.known_malformed() > 0)
    {
        let (malformed, records) = if input.on_bad_file == OnBadFile::Skip { rows(source) } else { all };
        if malformed > allowed_malformed(fraction, records) {
            let counts = count(source, rules)?;
            return Err(match input.on_bad_file {
                OnBadFile::Stop => {
                    let others = sources.iter().filter(is_known).map(|source| (source, source.known_malformed()));
                    stop_at(source, &counts, others, [malformed, records])
                }
                OnBadFile::Skip => Error::input(&source.path, too_many_malformed(&counts, malformed, records)),
            });
        }
    }
    Ok(())
}

/// Fails if a sample has more malformed records than the whole job may have, so that `check` ends as the job does.
///
/// # Errors
/// [`Error::Input`] names the first file with such records.
pub(crate) fn check_malformed_sample(sources: &[Source], sample: &HeightSample, options: &InputOptions) -> Result<()> {
    let records = sources.iter().map(|source| source.records).sum();
    let malformed = sample.counts.malformed;
    if options.on_bad_file == OnBadFile::Skip
        || malformed <= allowed_malformed(options.max_malformed_fraction.0, records)
    {
        return Ok(());
    }
    let counts = |source: &Source| sample.by_file.get(&source.path).map(|file| &file.counts);
    let is_bad = |counts: &&PointCounts| counts.malformed > 0;
    let first = sources.iter().find_map(|source| Some((source, counts(source).filter(is_bad)?)));
    let others = sources.iter().filter_map(|source| Some((source, counts(source)?.malformed)));
    first.map_or(Ok(()), |(source, counts)| Err(stop_at(source, counts, others, [malformed, records])))
}

/// Decodes a source for its counts.
///
/// # Errors
/// Those of [`Source::decode`], and [`Error::Interrupted`].
pub fn count(source: &Source, rules: &PointRules) -> Result<PointCounts> {
    let count_chunk = |chunk| {
        interrupt::check()?;
        source.decode(chunk, rules, &mut |_| Ok(()))
    };
    let add = |mut a: PointCounts, b: PointCounts| {
        a += b;
        a
    };
    let _ahead = source.read_ahead(rules.bounds.as_ref(), false)?;
    // The reduction keeps the order of the chunks.
    (0..source.chunks()).into_par_iter().map(count_chunk).try_reduce(PointCounts::default, |a, b| Ok(add(a, b)))
}
