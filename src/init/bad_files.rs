//! What lets a job run though some of its files are bad: leaving them out, or reading what is there of them.

use crate::init::draft::{Draft, NeededLine};
use job::plan::inputs::input_paths;
use job::plan::text_inputs::allowed_malformed;
use points::Source;
use rayon::prelude::*;
use sys::{Error, Result};

/// The step of fractions that are written.
const STEP: f64 = 1e-4;

/// The most bad files that a sentence names.
const MOST_NAMED: usize = 3;

/// Records that cannot be read.
pub(crate) struct Damage {
    pub(crate) malformed: u64,
    pub(crate) records: u64,
    /// What the job would say.
    pub(crate) error: Error,
}

/// Returns the lines that let the other files, or the rest of damaged ones, be read; `None` if there is nothing to read, or if the draft
/// has such lines already.
///
/// # Errors
/// [`Error::Io`] if a file cannot be read, which may be sound.
pub(crate) fn lines_for_bad_files(draft: &Draft) -> Result<Option<Vec<NeededLine>>> {
    if draft.sets("on_bad_file") || draft.sets("max_malformed_fraction") {
        return Ok(None);
    }
    let options = draft.options()?;
    let paths = input_paths(&options.input)?;
    let opened: Vec<Result<Source>> = paths.par_iter().map(|path| points::open(path, &options.input.csv)).collect();
    let (mut good, mut bad) = (Vec::new(), Vec::new());
    for source in opened {
        match source {
            Ok(source) if source.records > 0 && source.known_malformed() >= source.records => {
                bad.push(format!("{}: none of its {} points is there", source.path.display(), source.records));
            }
            Ok(source) => good.push(source),
            Err(error @ Error::Input { .. }) => bad.push(error.to_string()),
            Err(error) => return Err(error),
        }
    }
    if good.is_empty() {
        return Ok(None);
    }
    let skip = (!bad.is_empty()).then(|| skipping(&bad));
    let lines: Vec<NeededLine> = skip.into_iter().chain(allowing(&good, !bad.is_empty())).collect();
    Ok((!lines.is_empty()).then_some(lines))
}

/// Returns the line that leaves the bad files out.
fn skipping(bad: &[String]) -> NeededLine {
    let more = match bad.len().saturating_sub(MOST_NAMED) {
        0 => String::new(),
        more => format!("; and {more} more"),
    };
    let named = bad.iter().take(MOST_NAMED).cloned().collect::<Vec<_>>().join("; ");
    let why = format!("This line leaves out bad files: {named}{more}. Repair them, and remove it.");
    NeededLine::of_input("on_bad_file", "skip", &why)
}

/// Returns the line that allows for the records that are known to be damaged or missing. With `each`, the fraction counts for each file,
/// else for all together.
fn allowing(sources: &[Source], each: bool) -> Option<NeededLine> {
    let damaged = |source: &Source| (source.known_malformed(), source.records);
    let all = sources.iter().map(damaged).fold((0, 0), |all, of| (all.0 + of.0, all.1 + of.1));
    let first = sources.iter().find(|source| source.known_malformed() > 0)?;
    let fraction = match each {
        true => sources.iter().map(damaged).map(|(bad, of)| fraction(bad, of)).fold(0.0, f64::max),
        false => fraction(all.0, all.1),
    };
    let why = format!(
        "{} of {} points are damaged or missing, as in {}. So the job stops. Copy the file again, or let the job \
         read the rest: remove the #.",
        all.0,
        all.1,
        first.path.display()
    );
    Some(NeededLine::of_input("max_malformed_fraction", fraction, &why))
}

/// Returns the line that allows for damage that only reading shows; `None` if nothing else is there, or if the draft allows for some.
pub(crate) fn line_for_damage(draft: &Draft, damage: &Damage) -> Option<NeededLine> {
    let Damage { malformed, records, error } = damage;
    if malformed >= records || draft.sets("max_malformed_fraction") {
        return None;
    }
    let file = match error {
        Error::Input { path, .. } => format!(", most of them in {}", path.display()),
        _ => String::new(),
    };
    let why = format!(
        "{malformed} of {records} points cannot be read{file}. So the job stops. Copy the file again, or let the job read the rest: remove \
         the #."
    );
    Some(NeededLine::of_input("max_malformed_fraction", fraction(*malformed, *records), &why))
}

/// Returns the line that allows for `malformed` of `records` records, as the job stops with `error`; `None` if nothing else is there.
pub(crate) fn line_for_malformed(draft: &Draft, [malformed, records]: [u64; 2], error: &Error) -> Option<NeededLine> {
    if malformed >= records || draft.sets("max_malformed_fraction") {
        return None;
    }
    let why = format!("The job stops: {error}. To leave such points out, remove the #.");
    Some(NeededLine::of_input("max_malformed_fraction", fraction(malformed, records), &why))
}

/// Returns the least fraction of few digits that allows `bad` of `all` records.
fn fraction(bad: u64, all: u64) -> f64 {
    // The number that these digits stand for.
    let written = |steps: f64| format!("{:.4}", (steps * STEP).min(1.0)).parse().unwrap_or(1.0);
    let steps = (bad as f64 / all.max(1) as f64 / STEP).ceil();
    let least = written(steps);
    if allowed_malformed(least, all) >= bad { least } else { written(steps + 1.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fraction_allows_what_is_bad_and_little_more() {
        for (bad, all) in [
            (1, 1065),
            (3, 10_000),
            (29_031, 73_403),
            (1, 3),
            (999, 1000),
            (7, 7),
            (1, 1 << 39),
            (123_456_789, 987_654_321),
        ] {
            let written = NeededLine::of_input("k", fraction(bad, all), "").value;
            let read: f64 = written.parse().unwrap();
            let allowed = allowed_malformed(read, all);
            assert!(written.len() <= 6, "{written}");
            assert!((bad..=bad + all / 5000 + 1).contains(&allowed), "{bad} of {all}: {written} allows {allowed}");
        }
    }
}
