//! What the plan knows of texts, which are read once before it is made: rows that nobody wants, mistakes, degrees.

use crate::input::options::{InputOptions, OnBadFile, UnitChoice};
use crate::input::{CrsChoice, FileFormat, PointCounts, PointRules, RowChoice, Source, TextReading, Unit};
use crate::job::options::JobOptions;
use crate::job::plan::job_plan::Plan;
use crate::output::options::ColorChoice;
use crate::{Error, Result, interrupt};
use rayon::prelude::*;

/// Returns which rows of a text the job wants.
pub(crate) fn row_choice(options: &JobOptions) -> RowChoice {
    options.input.row_choice(wants_colors(options))
}

/// Returns how the texts of a plan are read.
pub(crate) fn text_reading(plan: &Plan) -> TextReading {
    let sources = || plan.inputs.iter().map(|input| &input.source);
    TextReading {
        colors: wants_colors(&plan.options),
        outliers_left_out: sources().any(|source| source.outliers() > 0),
        even_among_few: sources().any(Source::has_outlier_among_few),
    }
}

/// Returns whether the job wants the points' own colours.
pub(crate) fn wants_colors(options: &JobOptions) -> bool {
    matches!(options.output.color, ColorChoice::Auto | ColorChoice::Rgb)
}

/// Fails if the columns of a text are longitude and latitude, unless the user says that they are not.
///
/// # Errors
/// [`Error::Config`] names the first such file.
pub(crate) fn refuse_degrees(sources: &[Source], options: &InputOptions) -> Result<()> {
    let is_in_degrees = |s: &&Source| s.format == FileFormat::Text && s.crs.horizontal == Unit::Degree;
    let is_open = options.unit == UnitChoice::Auto && matches!(options.crs, CrsChoice::Auto | CrsChoice::First);
    match sources.iter().find(is_in_degrees) {
        Some(source) if is_open => Err(Error::Config(format!(
            "{}: its columns are named as degrees and hold them (x from {} to {}, y from {} to {}), and a Delaunay triangulation in \
             degrees is distorted: transform the points to a projected CRS first, for example with `cs2cs` or `pdal translate`; if \
             they are no degrees, set [input] unit, for example to \"metre\", or [input] crs",
            source.path.display(),
            source.min[0],
            source.max[0],
            source.min[1],
            source.max[1]
        ))),
        _ => Ok(()),
    }
}

/// Returns how many of `records` may be malformed.
pub(crate) fn allowed_malformed(fraction: f64, records: u64) -> u64 {
    (fraction * records as f64) as u64
}

/// Returns the error for a file with too many malformed records, where bad files are not left out.
pub(crate) fn stop_at(source: &Source, counts: &PointCounts, malformed: u64, records: u64) -> Error {
    let what = too_many_malformed(counts, malformed, records);
    Error::input(
        &source.path,
        format!(
            "{what}. Repair the file, leave it out (on_bad_file = \"skip\"), or raise max_malformed_fraction to read the rest"
        ),
    )
}

/// Returns a sentence about a file with too many malformed records.
pub(crate) fn too_many_malformed(counts: &PointCounts, malformed: u64, records: u64) -> String {
    let examples = counts.examples.join("; ");
    format!(
        "{malformed} of {records} records are malformed, more than [input] max_malformed_fraction allows: {examples}"
    )
}

/// Checks the number of malformed rows, which is known of texts, so that `check` says what the job would say.
///
/// # Errors
/// [`Error::Input`] names the first file with too many.
pub(crate) fn check_malformed_rows(sources: &[Source], rules: &[PointRules], options: &JobOptions) -> Result<()> {
    let input = &options.input;
    let fraction = input.max_malformed_fraction.0;
    let is_text = |source: &&Source| source.format == FileFormat::Text;
    let rows = |source: &Source| (source.known_malformed(), source.records);
    let all = sources.iter().map(rows).fold((0, 0), |(bad, records), more| (bad + more.0, records + more.1));
    for (source, rules) in
        sources.iter().zip(rules).filter(|(source, _)| is_text(source) && source.known_malformed() > 0)
    {
        let (malformed, records) = if input.on_bad_file == OnBadFile::Skip { rows(source) } else { all };
        if malformed > allowed_malformed(fraction, records) {
            let counts = count(source, rules)?;
            return Err(match input.on_bad_file {
                OnBadFile::Stop => stop_at(source, &counts, malformed, records),
                OnBadFile::Skip => Error::input(&source.path, too_many_malformed(&counts, malformed, records)),
            });
        }
    }
    Ok(())
}

/// Decodes a source for its counts.
fn count(source: &Source, rules: &PointRules) -> Result<PointCounts> {
    let count_chunk = |chunk| {
        interrupt::check()?;
        source.decode(chunk, rules, &mut |_| Ok(()))
    };
    let add = |mut a: PointCounts, b: PointCounts| {
        a += b;
        a
    };
    // The reduction keeps the order of the chunks.
    (0..source.chunks()).into_par_iter().map(count_chunk).try_reduce(PointCounts::default, |a, b| Ok(add(a, b)))
}
