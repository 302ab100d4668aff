//! What the coordinates of a source are in, as its file and the user say.

use crate::options::{InputOptions, UnitChoice};
use crate::source::Source;
use crs::choice::CrsChoice;
use crs::system::{Crs, CrsKind};
use crs::unit::Unit;
use sys::{Error, Result, ShownWarning};

/// Returns what a source of a job that transforms points is in.
///
/// # Errors
/// [`Error::Config`] if neither the file nor the user says it, or if they contradict each other.
pub(crate) fn stated_crs(source: &Source, all: &[Source], options: &InputOptions) -> Result<Crs> {
    let named = match &options.crs {
        CrsChoice::Auto => stated_or_missing(source, options)?,
        CrsChoice::First => all.iter().find(|s| s.crs.is_named()).map(|s| s.crs.clone()).unwrap_or_default(),
        CrsChoice::Given { crs, .. } => (**crs).clone(),
        CrsChoice::None => {
            return Err(Error::Config(
                "[input] crs = \"none\" makes the coordinates a plane, but to_crs needs their CRS: leave one out"
                    .into(),
            ));
        }
    };
    if !named.is_named() {
        return Err(Error::Config(format!(
            "{}: it names no CRS{}, and [input] to_crs needs one; fix: [input] missing_crs for the files without a CRS, such as \
             \"EPSG:4326\" for longitude and latitude of WGS 84, or [input] crs for all files",
            source.path.display(),
            found_in(source)
        )));
    }
    refuse_map_of_degrees(source, &named, options)?;
    let unit = match (options.unit, named.kind) {
        (UnitChoice::Auto, _) | (_, CrsKind::Geographic) => named.horizontal,
        (UnitChoice::Metre, _) => Unit::Metre,
        (UnitChoice::Foot, _) => Unit::Foot,
        (UnitChoice::UsFoot, _) => Unit::UsFoot,
    };
    let horizontal = if unit == Unit::Unknown { source.crs.horizontal } else { unit };
    Ok(Crs { horizontal, vertical: named.vertical.or(source.crs.vertical), ..named })
}

/// Returns what the source says, or if it names no CRS, what `[input] missing_crs` says.
///
/// # Errors
/// [`Error::Config`] if the columns of a text are degrees, and that is a map.
pub(crate) fn stated_or_missing(source: &Source, options: &InputOptions) -> Result<Crs> {
    let Some(missing) = options.missing_crs.as_ref().filter(|_| !source.crs.is_named()) else {
        return Ok(source.crs.clone());
    };
    refuse_map_of_degrees(source, &missing.crs, options)?;
    // Columns that say a length know it better.
    let own = source.crs.horizontal;
    let is_length = missing.crs.kind == CrsKind::Projected && own.metres_per_unit().is_some();
    let horizontal = if is_length { own } else { missing.crs.horizontal };
    Ok(Crs { horizontal, vertical: missing.crs.vertical.or(source.crs.vertical), ..(*missing.crs).clone() })
}

/// Fails if the columns of a text are longitude and latitude, and `named` is a map. `[input] unit` says that they are no degrees.
fn refuse_map_of_degrees(source: &Source, named: &Crs, options: &InputOptions) -> Result<()> {
    let has_degrees = !source.crs.is_named() && source.crs.horizontal == Unit::Degree;
    if !has_degrees || named.kind != CrsKind::Projected || options.unit != UnitChoice::Auto {
        return Ok(());
    }
    Err(Error::Config(format!(
        "{}: its columns are named as degrees (x from {} to {}, y from {} to {}), but {} is a map, whose coordinates are \
         lengths: name the CRS of the degrees, such as missing_crs = \"EPSG:4326\" for longitude and latitude of WGS 84, together with \
         to_crs; if they are not degrees, set [input] unit, for example to \"metre\"",
        source.path.display(),
        source.min[0],
        source.max[0],
        source.min[1],
        source.max[1],
        named.label()
    )))
}

/// Returns what is wrong with the record of a system in the file, as a part of a sentence; nothing if nothing is.
fn found_in(source: &Source) -> String {
    const WORDS: [&str; 2] = ["coordinate system", "variable length records"];
    let is_meant = |warning: &str| WORDS.iter().any(|word| warning.contains(word));
    // The remedies are others here.
    let all = source.warnings.iter().map(|warning| ShownWarning(warning).what());
    let of_system: Vec<&str> = all.filter(|warning| is_meant(warning)).collect();
    if of_system.is_empty() { String::new() } else { format!(" that can be read ({})", of_system.join("; ")) }
}

/// Returns the error for a source that cannot be transformed, for the reason `why`.
pub(crate) fn no_way(source: &Source, why: &str) -> Error {
    let found = found_in(source);
    let is_said = found.is_empty() || found.contains(why);
    let found = if is_said { String::new() } else { format!(". The file has no CRS{found}") };
    Error::Config(format!(
        "{}: {why}{found}. Other programs transform more: `pdal translate in.laz out.laz reprojection \
         --filters.reprojection.out_srs=EPSG:...` does that first. If the CRS of the file is wrong, set [input] crs to that of all files",
        source.path.display()
    ))
}
