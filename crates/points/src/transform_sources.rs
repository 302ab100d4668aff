//! Has the points of all sources transformed into the one system that `[input] to_crs` names.

use crate::middle_zone::zone_of_middle;
use crate::options::{InputOptions, UnitChoice};
use crate::source::Source;
use crate::source_transform::SourceTransform;
use crate::stated_crs::{no_way, stated_crs, stated_or_missing};
use crate::transform_warnings::{
    warn_of_coarse_degrees, warn_of_date_line, warn_of_datums, warn_of_heights, warn_of_lengths, warn_of_overruled,
    warn_of_scale,
};
use crs::choice::CrsChoice;
use crs::datum::Sameness;
use crs::system::{Crs, CrsKind};
use crs::target::TargetCrs;
use crs::transform::between::{CrsTransform, DatumNote};
use crs::unit::{Unit, same_length};
use crs::vertical::VerticalSystem;
use sys::{Error, Result, Warnings};

/// The name of heights that count from the ellipsoid because their system of places has three axes.
const ELLIPSOIDAL: &str = "ellipsoidal height";

/// Gives files that name no CRS the one of `[input] missing_crs`, and those that state no unit of heights the one of `[input] height_unit`. With `[input] to_crs`, has the points of all sources transformed
/// into that: the sources then look like files in that system. Those that are in it already keep their coordinates.
///
/// The outcome depends on the set of the sources and the options alone, so whoever does it again finds the same points.
///
/// # Errors
/// [`Error::Config`] if a source does not say what it is in, or there is no way to the system.
pub fn transform_sources(sources: &mut [Source], options: &InputOptions, warnings: &mut Warnings) -> Result<()> {
    sources.iter_mut().for_each(Source::forget_transform);
    take_height_unit(sources, options)?;
    if options.missing_crs.is_some() && options.crs != CrsChoice::Auto {
        return Err(Error::Config(
            "[input] missing_crs is for files that name no CRS, and crs sets that of all files: leave one of them out"
                .into(),
        ));
    }
    let Some(target) = &options.to_crs else {
        for source in sources.iter_mut().filter(|_| options.missing_crs.is_some()) {
            source.crs = stated_or_missing(source, options)?;
        }
        take_units_of_false_records(sources, options);
        return Ok(());
    };
    let said = sources.iter().map(|source| stated_crs(source, sources, options)).collect::<Result<Vec<Crs>>>()?;
    refuse_impossible_latitudes(sources, &said)?;
    warn_of_overruled(sources, &said, options, warnings);
    warn_of_lengths(sources, &said, options, warnings);
    warn_of_heights(sources, &said, warnings);
    warn_of_coarse_degrees(sources, &said, warnings);
    let mut to = match target {
        TargetCrs::Named(named) => (*named.crs).clone(),
        TargetCrs::Utm => zone_of_middle(sources, &said, options)?,
    };
    require_map(&to)?;
    warn_of_date_line(sources, &said, &to, warnings);
    to.vertical_system = common_heights(sources, &said, &to, warnings)?;
    to.vertical = Some(common_unit_of_heights(&said, &to));
    let notes = sources.iter_mut().zip(said).map(|(source, from)| transform(source, from, &to, options));
    let notes = notes.collect::<Result<Vec<DatumNote>>>()?;
    warn_of_datums(sources, &notes, warnings);
    warn_of_scale(sources, &to, warnings);
    Ok(())
}

/// Takes the unit of heights that the user states. A CRS that the user states overrides those of the files, and so does this unit then.
///
/// # Errors
/// [`Error::Config`] if the CRS, or the columns of a text, have heights in another unit.
fn take_height_unit(sources: &mut [Source], options: &InputOptions) -> Result<()> {
    let Some(chosen) = options.height_unit.metres() else { return Ok(()) };
    let refuse = |subject: String, own: f64| match same_length(own, chosen) {
        true => Ok(()),
        false => Err(Error::Config(format!(
            "{subject} has heights in {}, but [input] height_unit is {}: leave height_unit out if the CRS is right; otherwise set [input] crs to \
             a CRS without heights",
            Unit::from_metres(Some(own)).name(),
            options.height_unit.unit().name()
        ))),
    };
    let overrides = match &options.crs {
        CrsChoice::Given { crs, .. } => {
            crs.vertical.map_or(Ok(()), |own| refuse(format!("[input] crs ({})", crs.label()), own))?;
            true
        }
        CrsChoice::None => true,
        CrsChoice::First | CrsChoice::Auto => false,
    };
    for source in sources {
        match source.crs.vertical {
            Some(own) if !overrides => refuse(source.path.display().to_string(), own)?,
            _ => source.crs.vertical = Some(chosen),
        }
    }
    Ok(())
}

/// Takes the units that false records state, where neither the user nor any file states another.
fn take_units_of_false_records(sources: &mut [Source], options: &InputOptions) {
    let is_unit_open = match &options.crs {
        CrsChoice::None => false,
        CrsChoice::Given { crs, .. } => crs.horizontal == Unit::Unknown,
        CrsChoice::First | CrsChoice::Auto => true,
    };
    let is_silent = |source: &Source| source.crs.horizontal == Unit::Unknown;
    if is_unit_open && options.unit == UnitChoice::Auto && sources.iter().all(is_silent) {
        sources.iter_mut().for_each(|source| source.crs.horizontal = source.unit_of_false_record().unwrap_or_default());
    }
}

/// Has the points of one source transformed, if they are not in `to` already. Returns what is done about the datums.
fn transform(source: &mut Source, from: Crs, to: &Crs, options: &InputOptions) -> Result<DatumNote> {
    let sameness = from.sameness(to);
    let is_moved = matches!(sameness, Sameness::Refuted(_)) || from.horizontal != to.horizontal;
    let (unit, wanted) = (from.metres_per_unit_of_height(), to.metres_per_unit_of_height());
    let heights = (!same_length(unit, wanted)).then_some(unit / wanted);
    let steps = [options.resolution.step(), options.resolution_z.step()];
    let own = source.own_coordinates();
    let transform = SourceTransform { own, from, to: to.clone(), datums: options.datums, is_moved, heights, steps };
    let way = transform.way().map_err(|why| no_way(source, &why))?;
    let note = match way {
        Some(way) => way.datums().clone(),
        None if sameness == Sameness::Assumed => DatumNote::Assumed(transform.from.names_of_datums(to)),
        None => DatumNote::Same,
    };
    source.set_transform(transform, to.clone());
    Ok(note)
}

/// Fails if no row of a text has a latitude that there is: most often, longitude and latitude are exchanged. Every row of a text has been
/// looked at, so its box is no mere claim.
fn refuse_impossible_latitudes(sources: &[Source], said: &[Crs]) -> Result<()> {
    let is_impossible = |source: &Source, crs: &Crs| {
        let is_of_degrees = source.format.is_text() && source.records > 0 && crs.kind == CrsKind::Geographic;
        let ends = [source.min[1], source.max[1]];
        let has_place = |way: &CrsTransform| ends.iter().any(|latitude| way.apply([0.0, *latitude]).is_some());
        let is_one_side = ends[0].signum() == ends[1].signum();
        is_of_degrees && is_one_side && CrsTransform::to_degrees(crs).is_ok_and(|way| !has_place(&way))
    };
    let mut all = sources.iter().zip(said);
    match all.find(|(source, crs)| is_impossible(source, crs)) {
        Some((source, crs)) => Err(Error::Config(format!(
            "{}: y is from {} to {}, but latitudes of {} end at 90 degrees: if x and y are exchanged, name the columns `lat` and \
             `lon`, or set `columns` under [input.csv]; if they are not degrees, name another CRS",
            source.path.display(),
            source.min[1],
            source.max[1],
            crs.label()
        ))),
        None => Ok(()),
    }
}

/// Returns the unit of heights of the job: that of the system that the user names, or that of all sources, or that of the plane.
fn common_unit_of_heights(said: &[Crs], to: &Crs) -> f64 {
    let unit = Crs::metres_per_unit_of_height;
    let common = said.first().map(unit).filter(|first| said.iter().all(|crs| same_length(unit(crs), *first)));
    to.vertical.or(common).or(to.metres_per_unit()).unwrap_or(1.0)
}

/// Returns the system of heights of the job: the one that the user names, or else the one that the sources say. Heights are not
/// transformed from one datum to another. Warns about sources that do not say theirs.
fn common_heights(
    sources: &[Source],
    said: &[Crs],
    to: &Crs,
    warnings: &mut Warnings,
) -> Result<Option<VerticalSystem>> {
    let mut common = to.vertical_system.clone().map(|system| ("[input] to_crs".to_string(), system));
    let mut silent: Vec<&Source> = Vec::new();
    for (source, crs) in sources.iter().zip(said) {
        let Some(own) = heights_of(crs) else {
            silent.push(source);
            continue;
        };
        let path = source.path.display().to_string();
        match &common {
            Some((other, known)) => refuse_other_heights(&path, &own, other, known)?,
            None => common = Some((path, own)),
        }
    }
    if let (Some((other, known)), Some(first)) = (&common, silent.first()) {
        warnings.push(format!(
            "{} of {} inputs have no vertical datum, such as {}: {} assumed, as in {other}; fix: [input] crs with a vertical part, if \
             that is wrong",
            silent.len(),
            sources.len(),
            first.path.display(),
            known.label()
        ));
    }
    Ok(common.map(|(_, system)| system))
}

/// Fails if the heights of two inputs, or of an input and the system that the user names, do not count from the same.
fn refuse_other_heights(path: &str, own: &VerticalSystem, other: &str, known: &VerticalSystem) -> Result<()> {
    if let Some(difference) = own.difference_in_datum(known) {
        return Err(Error::Config(format!(
            "{path} and {other} differ in {difference}: converting between them needs a geoid grid. [input] to_crs transforms x, y and \
             the unit of heights, but not their datum: transform the heights with `pdal translate` \
             first, or run two jobs"
        )));
    }
    match own.difference_in_direction(known) {
        Some(difference) => Err(Error::Config(format!(
            "{path} and {other} differ in {difference}: z has the other sign. [input] to_crs does not invert it: do that first, for \
             example \
             with `pdal translate in.laz out.laz assign --filters.assign.value=\"Z = -1 * Z\" --writers.las.forward=all`, and name the CRS \
             of heights, not of depths, with [input] crs"
        ))),
        None => Ok(()),
    }
}

/// Returns the system of the heights of `crs`, which may be a third axis of its system of places.
fn heights_of(crs: &Crs) -> Option<VerticalSystem> {
    let ellipsoidal =
        || VerticalSystem { name: Some(ELLIPSOIDAL.into()), ellipsoidal: true, ..VerticalSystem::default() };
    crs.vertical_system.clone().or_else(|| crs.has_ellipsoidal_heights().then(ellipsoidal))
}

/// Checks that a mesh can be made in a system.
fn require_map(to: &Crs) -> Result<()> {
    if to.kind == CrsKind::Projected && to.metres_per_unit().is_some() {
        return Ok(());
    }
    Err(Error::Config(format!(
        "[input] to_crs ({}) is not a map in a unit of length: name a projected CRS, such as \"EPSG:26915\", or \"utm\"",
        to.label()
    )))
}
