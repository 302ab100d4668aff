//! Coordinates that count from the middle of the earth: their z is no height, and there is no terrain of them before they are transformed.

use crate::plan::common_crs::TRANSFORM;
use crs::{Crs, CrsChoice, CrsKind};
use points::Source;
use points::options::InputOptions;
use sys::{Error, Result, Warnings, of_inputs};

/// Checks that no source is in a geocentric system, as its record or the user states.
///
/// # Errors
/// [`Error::Config`] names the first such file, or the option.
pub(crate) fn refuse_geocentric(sources: &[Source], options: &InputOptions) -> Result<()> {
    let is_geocentric = |crs: &Crs| crs.kind == CrsKind::Geocentric;
    let is_named = |source: &&Source| source.own_crs().is_named();
    let of_record = match &options.crs {
        CrsChoice::None => None,
        CrsChoice::Given { crs, .. } if is_geocentric(crs) => {
            return Err(said_by_user("crs", crs, sources.iter(), "name that one, or \"none\" for a plane"));
        }
        CrsChoice::Given { .. } => None,
        CrsChoice::First => sources.iter().find(is_named).filter(|source| is_geocentric(source.own_crs())),
        CrsChoice::Auto => sources.iter().find(|source| is_geocentric(source.own_crs())),
    };
    if let Some(source) = of_record {
        return Err(Error::Config(format!(
            "{}: the coordinates are geocentric ({}): their origin is the centre of the earth, and z is not a height. {TRANSFORM}; if \
             the CRS record is wrong, set [input] crs to the right one, or \"none\" for a plane",
            source.path.display(),
            source.own_crs().label()
        )));
    }
    let missing = options.missing_crs.as_ref().map(|missing| &*missing.crs).filter(|crs| is_geocentric(crs));
    let mut nameless = sources.iter().filter(|source| !is_named(source)).peekable();
    match missing {
        Some(crs) if options.crs == CrsChoice::Auto && nameless.peek().is_some() => {
            Err(said_by_user("missing_crs", crs, nameless, "name that one"))
        }
        _ => Ok(()),
    }
}

/// Returns the error for a geocentric system that the user names for `sources` with an option.
fn said_by_user<'a>(key: &str, crs: &Crs, sources: impl Iterator<Item = &'a Source>, other: &str) -> Error {
    let label = crs.label();
    let mut elsewhere = sources.filter(|source| !source.may_be_geocentric());
    Error::Config(match elsewhere.next() {
        Some(source) => format!(
            "[input] {key} is {label}, which is geocentric, but the points of {} do not lie on the surface of the earth (x from {} to {}, y \
             from {} to {}, z from {} to {}). If they are in another CRS than [input] {key}, {other}",
            source.path.display(),
            source.min[0],
            source.max[0],
            source.min[1],
            source.max[1],
            source.min[2],
            source.max[2],
        ),
        None => format!(
            "the coordinates are geocentric ([input] {key} is {label}): their origin is the centre of the earth, and z is not a height. \
             {TRANSFORM}; if the files are in another CRS than [input] {key}, {other}"
        ),
    })
}

/// Warns about sources without a map whose coordinates can only be geocentric. Those with a map lie outside of its area.
pub(crate) fn warn_of_geocentric(sources: &[Source], options: &InputOptions, warnings: &mut Warnings) {
    if options.crs == CrsChoice::None {
        return;
    }
    let found: Vec<&Source> = sources.iter().filter(|source| source.looks_geocentric()).collect();
    if let Some(first) = found.first() {
        warnings.push(format!(
            "{}its coordinates (around {:.0}, {:.0}, {:.0}) look geocentric, so z is not a height; fix: {TRANSFORM}; [input] crs = \
             \"none\" if x and y are a plane",
            of_inputs(found.len(), sources.len(), &first.path),
            first.min[0],
            first.min[1],
            first.min[2]
        ));
    }
}

/// Warns about sources without a CRS whose x and y look like longitude and latitude. Of texts, the reader of their columns does.
pub(crate) fn warn_of_degrees(sources: &[Source], options: &InputOptions, warnings: &mut Warnings) {
    if options.crs != CrsChoice::Auto || options.missing_crs.is_some() {
        return;
    }
    let is_meant =
        |source: &&Source| !source.format.is_text() && !source.own_crs().is_named() && source.looks_like_degrees();
    let found: Vec<&Source> = sources.iter().filter(is_meant).collect();
    if let Some(first) = found.first() {
        warnings.push(format!(
            "{}its x ({} to {}) and y ({} to {}) look like longitude and latitude, but are treated as lengths; fix: [input] crs = \
             \"EPSG:4326\" and [input] to_crs = \"utm\" for degrees, [input] crs = \"none\" for a plane",
            of_inputs(found.len(), sources.len(), &first.path),
            first.min[0],
            first.max[0],
            first.min[1],
            first.max[1]
        ));
    }
}
