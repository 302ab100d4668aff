//! Has the points of all sources transformed into the one system that `[input] to_crs` names.

use crate::input::crs::choice::CrsChoice;
use crate::input::crs::system::{Crs, CrsKind};
use crate::input::crs::target::TargetCrs;
use crate::input::crs::transform::between::CrsTransform;
use crate::input::crs::transform::utm::{utm_zone, wgs84_zone};
use crate::input::crs::unit::Unit;
use crate::input::crs::vertical::VerticalSystem;
use crate::input::options::{InputOptions, UnitChoice};
use crate::input::source::Source;
use crate::input::source_transform::SourceTransform;
use crate::{Error, Result, Warnings};
use std::collections::HashSet;

/// The name of heights that count from the ellipsoid because their system of places has three axes.
const ELLIPSOIDAL: &str = "ellipsoidal height";

/// Gives files that name no CRS the one of `[input] missing_crs`. With `[input] to_crs`, has the points of all sources transformed
/// into that: the sources then look like files in that system. Those that are in it already keep their coordinates.
///
/// The outcome depends on the set of the sources and the options alone, so whoever does it again finds the same points.
///
/// # Errors
/// [`Error::Config`] if a source does not say what it is in, or there is no way to the system.
pub fn transform_sources(sources: &mut [Source], options: &InputOptions, warnings: &mut Warnings) -> Result<()> {
    sources.iter_mut().for_each(Source::forget_transform);
    if options.missing_crs.is_some() && options.crs != CrsChoice::Auto {
        return Err(Error::Config(
            "[input] missing_crs is for files that name no CRS, and crs says what all files are in: leave one of them out".into(),
        ));
    }
    let Some(target) = &options.to_crs else {
        if options.missing_crs.is_some() {
            for source in sources.iter_mut() {
                source.crs = said_or_missing(source, options);
            }
        }
        return Ok(());
    };
    let said = sources.iter().map(|source| said_crs(source, sources, options)).collect::<Result<Vec<Crs>>>()?;
    warn_of_overruled(sources, &said, options, warnings);
    warn_of_heights(sources, &said, warnings);
    let mut to = match target {
        TargetCrs::Named(named) => (*named.crs).clone(),
        TargetCrs::Utm => zone_of_middle(sources, &said, options)?,
    };
    require_map(&to)?;
    to.vertical_system = common_heights(sources, &said, &to)?;
    to.vertical = Some(common_unit_of_heights(&said, &to));
    let mut alike = Vec::new();
    for (source, from) in sources.iter_mut().zip(said) {
        alike.extend(transform(source, from, &to, options)?);
    }
    warn_of_datums(&alike, sources.len(), warnings);
    Ok(())
}

/// Has the points of one source transformed, if they are not in `to` already. Returns a sentence if two datums are taken for one.
fn transform(source: &mut Source, from: Crs, to: &Crs, options: &InputOptions) -> Result<Option<String>> {
    let plane = |crs: &Crs| Crs { vertical: None, vertical_system: None, ..crs.clone() };
    let is_moved = !plane(&from).same_as(&plane(to)) || from.horizontal != to.horizontal;
    let (own, wanted) = (from.metres_per_unit_of_height(), to.metres_per_unit_of_height());
    let heights = (own != wanted).then_some(own / wanted);
    let steps = [options.resolution.step(), options.resolution_z.step()];
    let own = source.own_coordinates();
    let transform = SourceTransform { own, from, to: to.clone(), datums: options.datums, is_moved, heights, steps };
    let way = transform.way().map_err(|why| Error::Config(format!("{}: {why}", source.path.display())))?;
    let alike = way.as_ref().and_then(CrsTransform::datums_taken_alike);
    let alike =
        alike.map(|names| format!("{}: [input] datums = \"close\" takes {names} for one", source.path.display()));
    source.set_transform(transform, to.clone());
    Ok(alike)
}

/// Warns about datums that are taken for one, by a sentence for each such source.
fn warn_of_datums(alike: &[String], count: usize, warnings: &mut Warnings) {
    if let Some(first) = alike.first() {
        let of = if count == 1 { String::new() } else { format!("{} of {count} inputs, such as ", alike.len()) };
        warnings.push(format!("{of}{first} datum; they may be a metre or two apart"));
    }
}

/// Returns what a source is in, as the user and the file say.
fn said_crs(source: &Source, all: &[Source], options: &InputOptions) -> Result<Crs> {
    let named = match &options.crs {
        CrsChoice::Auto => said_or_missing(source, options),
        CrsChoice::First => all.iter().find(|s| s.crs.is_named()).map(|s| s.crs.clone()).unwrap_or_default(),
        CrsChoice::Given { crs, .. } => (**crs).clone(),
        CrsChoice::None => {
            return Err(Error::Config(
                "[input] crs = \"none\" says that coordinates are a plane, and to_crs needs to know where they are: leave one out"
                    .into(),
            ));
        }
    };
    if !named.is_named() {
        return Err(Error::Config(format!(
            "{}: it names no CRS, and [input] to_crs needs to know what its coordinates are in: say with [input] missing_crs what the \
             files without a CRS are in, such as \"EPSG:4326\" for longitude and latitude of WGS 84, or with [input] crs what all \
             files are in",
            source.path.display()
        )));
    }
    let unit = match (options.unit, named.kind) {
        (UnitChoice::Auto, _) | (_, CrsKind::Geographic) => named.horizontal,
        (UnitChoice::Metre, _) => Unit::Metre,
        (UnitChoice::Foot, _) => Unit::Foot,
        (UnitChoice::UsFoot, _) => Unit::UsFoot,
    };
    let horizontal = if unit == Unit::Unknown { source.crs.horizontal } else { unit };
    Ok(Crs { horizontal, vertical: named.vertical.or(source.crs.vertical), ..named })
}

fn said_or_missing(source: &Source, options: &InputOptions) -> Crs {
    match &options.missing_crs {
        Some(missing) if !source.crs.is_named() => {
            // Columns that say a length know it better.
            let own = source.crs.horizontal;
            let is_length = missing.crs.kind == CrsKind::Projected && own.metres_per_unit().is_some();
            let horizontal = if is_length { own } else { missing.crs.horizontal };
            Crs { horizontal, vertical: missing.crs.vertical.or(source.crs.vertical), ..(*missing.crs).clone() }
        }
        _ => source.crs.clone(),
    }
}

/// Returns the unit of heights of the job: that of the system that the user names, or that of all sources, or that of the plane.
fn common_unit_of_heights(said: &[Crs], to: &Crs) -> f64 {
    let first = said.first().map(Crs::metres_per_unit_of_height);
    let common = first.filter(|first| said.iter().all(|crs| crs.metres_per_unit_of_height() == *first));
    to.vertical.or(common).or(to.metres_per_unit()).unwrap_or(1.0)
}

/// Returns the system of heights of the job: the one that the user names, or else the one that the sources say. Heights are not
/// transformed from one datum to another.
fn common_heights(sources: &[Source], said: &[Crs], to: &Crs) -> Result<Option<VerticalSystem>> {
    let mut common = to.vertical_system.clone().map(|system| ("[input] to_crs".to_string(), system));
    for (source, crs) in sources.iter().zip(said) {
        let Some(own) = heights_of(crs) else { continue };
        let path = source.path.display().to_string();
        match &common {
            Some((other, known)) => {
                if let Some(difference) = own.difference(known) {
                    return Err(Error::Config(format!(
                        "{path} and {other} differ in {difference}: the way from one to the other needs the grid of a geoid. [input] \
                         to_crs transforms x and y and the unit of heights, not their datum, and does not leave that out: transform the \
                         heights with `pdal translate` first, or run two jobs"
                    )));
                }
            }
            None => common = Some((path, own)),
        }
    }
    Ok(common.map(|(_, system)| system))
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
        "[input] to_crs ({}) is no map in a unit of length: name a projected CRS, such as \"EPSG:26915\", or \"utm\"",
        to.label()
    )))
}

/// Returns the UTM zone of the middle of the boxes of all sources.
fn zone_of_middle(sources: &[Source], said: &[Crs], options: &InputOptions) -> Result<Crs> {
    let mut places: Vec<[f64; 2]> = Vec::new();
    for (source, crs) in sources.iter().zip(said) {
        let way = CrsTransform::to_degrees(crs);
        let way = way.map_err(|why| Error::Config(format!("{}: {why}", source.path.display())))?;
        let Some([min, max]) = source.claimed_rectangle().filter(|_| source.records > 0) else { continue };
        let share = |i: usize, axis: usize| min[axis] + (max[axis] - min[axis]) * 0.5 * i as f64;
        places.extend((0..9).filter_map(|i| way.apply([share(i % 3, 0), share(i / 3, 1)])));
    }
    let middle = middle(&mut places).ok_or_else(|| {
        Error::Config(
            "[input] to_crs = \"utm\": no header says where the points lie; name the zone, such as \"EPSG:32615\""
                .into(),
        )
    })?;
    let mut known = HashSet::new();
    let distinct = said.iter().filter(|crs| known.insert(format!("{crs:?}")));
    let (mut codes, mut zone) = (HashSet::new(), None);
    for crs in distinct {
        let found = utm_zone(crs, middle, options.datums);
        let found = found.map_err(|why| Error::Config(format!("[input] to_crs = \"utm\": {why}")))?;
        codes.insert(found.epsg);
        zone = Some(found);
    }
    // Of several datums none comes first.
    let zone = if codes.len() > 1 { wgs84_zone(middle) } else { zone };
    zone.ok_or_else(|| Error::Config("[input] to_crs = \"utm\": there are no inputs".into()))
}

/// Returns the middle of the box of places in degrees. One that would be wider than half a turn lies across the date line.
fn middle(places: &mut [[f64; 2]]) -> Option<[f64; 2]> {
    let ends = |places: &[[f64; 2]], axis: usize| {
        let values = || places.iter().map(|place| place[axis]);
        [values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max)]
    };
    let [west, east] = ends(places, 0);
    if east - west > 180.0 {
        places.iter_mut().filter(|place| place[0] < 0.0).for_each(|place| place[0] += 360.0);
    }
    let middle = [0, 1].map(|axis| ends(places, axis)).map(|[low, high]| (low + high) / 2.0);
    (!places.is_empty()).then_some(middle)
}

/// Warns about sources that say something else than `[input] crs` does.
fn warn_of_overruled(sources: &[Source], said: &[Crs], options: &InputOptions, warnings: &mut Warnings) {
    if options.crs == CrsChoice::Auto {
        return;
    }
    let differences = |(source, crs): (&Source, &Crs)| crs.differences(&source.crs);
    let all = || sources.iter().zip(said);
    let others: Vec<_> = all().filter(|pair| !differences(*pair).is_empty()).collect();
    if let Some((first, crs)) = others.first() {
        warnings.push(format!(
            "[input] crs takes all inputs as {}, though {} of {} say otherwise, such as {}: {} differs in {}",
            crs.label(),
            others.len(),
            sources.len(),
            first.path.display(),
            if first.crs.is_named() { first.crs.label() } else { "it".to_string() },
            crs.differences(&first.crs).join(" and ")
        ));
    }
}

/// Warns about sources in degrees that do not say the unit of their heights.
fn warn_of_heights(sources: &[Source], said: &[Crs], warnings: &mut Warnings) {
    let is_silent = |crs: &Crs| crs.vertical.is_none() && crs.metres_per_unit().is_none();
    let silent: Vec<&Source> = sources.iter().zip(said).filter(|(_, crs)| is_silent(crs)).map(|pair| pair.0).collect();
    if let Some(first) = silent.first() {
        warnings.push(format!(
            "{} of {} inputs are in degrees and do not say the unit of their heights, such as {}: it is taken to be the metre (name a CRS \
             of heights to say otherwise, such as 6360 in \"EPSG:4269+6360\")",
            silent.len(),
            sources.len(),
            first.path.display()
        ));
    }
}
