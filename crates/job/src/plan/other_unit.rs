//! `[input] unit` must not contradict the coordinate reference system: coordinates would be taken as lengths that the system does not have,
//! and the terrain would be placed far from where it is.

use crs::{Crs, CrsChoice, Unit, same_length};
use points::Source;
use points::options::InputOptions;
use sys::{Error, Result, Warnings, of_inputs};

/// Checks that the unit of x and y that the user names is that of the system of every source.
///
/// # Errors
/// [`Error::Config`] names the first system in another unit.
pub(super) fn refuse_other_unit(sources: &[Source], options: &InputOptions) -> Result<()> {
    let of_file = |source: &Source| format!("{} is in", source.path.display());
    let is_named = |source: &&Source| source.own_crs().is_named();
    match &options.crs {
        CrsChoice::None => Ok(()),
        CrsChoice::Given { crs, .. } => {
            refuse_degrees_as_lengths(crs, sources, || "[input] crs is".into(), options)?;
            refuse(crs, || "[input] crs is".into(), options)
        }
        CrsChoice::First => {
            sources.iter().find(is_named).map_or(Ok(()), |source| refuse(source.own_crs(), || of_file(source), options))
        }
        CrsChoice::Auto => sources.iter().try_for_each(|source| match &options.missing_crs {
            // Columns that name a unit know it better.
            Some(missing) if !is_named(&source) && source.own_crs().metres_per_unit().is_none() => {
                refuse(&missing.crs, || "[input] missing_crs is".into(), options)
            }
            _ if is_named(&source) && !source.format.is_text() => {
                refuse_degrees_as_lengths(source.own_crs(), std::slice::from_ref(source), || of_file(source), options)?;
                refuse(source.own_crs(), || of_file(source), options)
            }
            _ => Ok(()),
        }),
    }
}

/// Fails if `crs` is in degrees, the user names a unit of length, and the coordinates of all `sources` may be degrees.
fn refuse_degrees_as_lengths(
    crs: &Crs,
    sources: &[Source],
    subject: impl Fn() -> String,
    options: &InputOptions,
) -> Result<()> {
    let is_length = options.unit.metres().is_some();
    if crs.horizontal != Unit::Degree || !is_length || !sources.iter().all(may_be_degrees) {
        return Ok(());
    }
    Err(Error::Config(format!(
        "{} {}, whose unit is the degree, but [input] unit is {}: leave unit out, and set to_crs = \"utm\" to transform the degrees. If \
         the \
         coordinates are lengths, set crs = \"none\" as well",
        subject(),
        crs.label(),
        options.unit.unit().name(),
    )))
}

fn may_be_degrees(source: &Source) -> bool {
    let corners = source.claimed_rectangle();
    corners.is_some_and(|corners| corners.iter().all(|[x, y]| x.abs() <= 360.0 && y.abs() <= 90.0))
}

/// Fails if `crs` has another unit of length than the one that the user names.
fn refuse(crs: &Crs, subject: impl Fn() -> String, options: &InputOptions) -> Result<()> {
    let unit = options.unit.unit();
    let is_other =
        crs.metres_per_unit().zip(unit.metres_per_unit()).is_some_and(|(own, chosen)| !same_length(own, chosen));
    if !is_other {
        return Ok(());
    }
    let metres = unit.metres_per_unit().unwrap_or(1.0);
    Err(Error::Config(format!(
        "{} {}, whose unit is the {}, but [input] unit is {}: leave unit out if the CRS is right. If the unit of the \
         coordinates is the {}, name a CRS in that unit with [input] crs: an EPSG code, or the well-known text of this one with UNIT[\"{}\",{metres}] as its last unit",
        subject(),
        crs.label(),
        crs.horizontal.name(),
        unit.name(),
        unit.name(),
        unit.name(),
    )))
}

/// Warns about sources whose records or columns give x, y or z another unit than the job takes, whose `[input] crs = "none"` leaves records
/// aside. `metres` are the lengths of the job's units of x and y, and of z.
pub(super) fn warn_of_dropped_units(
    sources: &[Source],
    options: &InputOptions,
    metres: [f64; 2],
    warnings: &mut Warnings,
) {
    if options.crs != CrsChoice::None {
        return;
    }
    let others: Vec<(&Source, String)> =
        sources.iter().filter_map(|source| Some((source, dropped_unit(source, metres)?))).collect();
    let Some((first, what)) = others.first() else { return };
    let name = |metres| Unit::from_metres(Some(metres)).name();
    let [plane, heights] = metres.map(name);
    let taken = if plane == heights { plane } else { format!("{plane}, and z in {heights}") };
    warnings.push(format!(
        "{}[input] crs = \"none\" ignores its unit ({what}): coordinates are taken to be in {taken}; fix: if the file is right, leave \
         [input] crs out, or set [input] unit",
        of_inputs(others.len(), sources.len(), &first.path)
    ));
}

/// Says which unit a source states, if it is not what the job takes.
fn dropped_unit(source: &Source, [plane, heights]: [f64; 2]) -> Option<String> {
    let crs = source.own_crs();
    if crs.horizontal == Unit::Degree && may_be_degrees(source) {
        return Some("degree for x and y".into());
    }
    let is_text = source.format.is_text();
    let other = |own: Option<f64>, taken: f64| own.filter(|own| !is_text && !same_length(*own, taken));
    let name = |metres| Unit::from_metres(Some(metres)).name();
    let of_false_record = || source.unit_of_false_record().and_then(|unit| unit.metres_per_unit());
    let of_plane =
        other(crs.metres_per_unit().or_else(of_false_record), plane).map(|own| format!("{} for x and y", name(own)));
    of_plane.or_else(|| other(crs.vertical, heights).map(|own| format!("{} for z", name(own))))
}
