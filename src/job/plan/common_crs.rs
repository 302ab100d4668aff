//! The CRS and the units that all inputs of a job have in common.

use crate::input::options::UnitChoice;
use crate::input::{ComparableCrs, Crs, CrsChoice, CrsKind, Source, Unit};
use crate::{Error, Result, Warnings};

/// Returns the CRS of all sources. What a source does not say, the others say for it; a warning says so.
///
/// # Errors
/// [`Error::Config`] if two sources differ, or cannot be compared, and the user does not say which CRS to take.
pub fn common_crs(sources: &[Source], choice: &CrsChoice, warnings: &mut Warnings) -> Result<Crs> {
    let crs = match choice {
        CrsChoice::Auto => return agreed(sources, warnings),
        CrsChoice::None => Crs::default(),
        CrsChoice::First => sources.iter().find(|s| s.crs.is_named()).map(|s| s.crs.clone()).unwrap_or_default(),
        CrsChoice::Given { crs, .. } => {
            crs.doubts().into_iter().for_each(|doubt| warnings.push(format!("[input] crs ({}): {doubt}", crs.label())));
            (**crs).clone()
        }
    };
    let overruled: Vec<(&Source, Vec<String>)> =
        sources.iter().map(|s| (s, crs.differences(&s.crs))).filter(|(_, found)| !found.is_empty()).collect();
    if let Some((first, differences)) = overruled.first() {
        warnings.push(format!(
            "[input] crs takes all inputs as {}, though {} of {} say otherwise, such as {}: {} differs in {}",
            crs.label(),
            overruled.len(),
            sources.len(),
            first.path.display(),
            first.crs.label(),
            differences.join(" and ")
        ));
    }
    Ok(crs)
}

/// Returns the CRS that all sources agree on.
fn agreed(sources: &[Source], warnings: &mut Warnings) -> Result<Crs> {
    let mut distinct: Vec<(&Source, ComparableCrs)> = Vec::new();
    for source in sources.iter().filter(|s| s.crs != Crs::default()) {
        if !distinct.iter().any(|(known, _)| known.crs == source.crs) {
            distinct.push((source, ComparableCrs::of(&source.crs)));
        }
    }
    refuse_differences(&distinct)?;
    // The most complete ones, whatever the order of the files.
    let is_placed = |crs: &Crs| (crs.wkt.is_some(), crs.epsg.is_some(), crs.name.is_some());
    let is_high = |crs: &Crs| (crs.vertical_system.is_some(), crs.vertical.is_some());
    let text = |crs: &Crs| (crs.label(), crs.wkt.clone());
    let place = distinct.iter().max_by_key(|(Source { crs, .. }, comparable)| {
        (comparable.datum_name().is_some(), is_placed(crs), is_high(crs), text(crs))
    });
    let height = distinct.iter().max_by_key(|(Source { crs, .. }, _)| (is_high(crs), is_placed(crs), text(crs)));
    let (Some((place, comparable)), Some((height, _))) = (place, height) else { return Ok(Crs::default()) };
    let mut crs = place.crs.clone();
    crs.vertical = crs.vertical.or(height.crs.vertical);
    crs.vertical_system = crs.vertical_system.or_else(|| height.crs.vertical_system.clone());
    if crs.horizontal == Unit::Unknown {
        let known = distinct.iter().map(|(s, _)| s.crs.horizontal).find(|unit| *unit != Unit::Unknown);
        crs.horizontal = known.unwrap_or_default();
    }
    warn_of_gaps(sources, &crs, warnings);
    if let Some(datum) = comparable.datum_name() {
        let lacks_datum = |crs: &Crs| distinct.iter().any(|(s, comparable)| s.crs == *crs && comparable.lacks_datum());
        warn_of_datums(sources.iter().filter(|s| lacks_datum(&s.crs)).collect(), sources.len(), datum, warnings);
    }
    Ok(crs)
}

/// Fails if any two of the sources differ. Two that differ may both agree with a third that says less, so every pair counts.
fn refuse_differences(distinct: &[(&Source, ComparableCrs)]) -> Result<()> {
    for (index, (own, crs)) in distinct.iter().enumerate() {
        for (other, others) in &distinct[index + 1..] {
            let differences = crs.differences(others);
            if !differences.is_empty() {
                return Err(two_systems(own, other, &differences));
            }
        }
    }
    Ok(())
}

/// Warns about the sources `without` a datum, where others say one.
fn warn_of_datums(without: Vec<&Source>, count: usize, datum: &str, warnings: &mut Warnings) {
    if let Some(first) = without.first() {
        warnings.push(format!(
            "{} of {count} inputs do not say their datum, such as {}: it is taken to be {datum}, as in the others",
            without.len(),
            first.path.display()
        ));
    }
}

fn two_systems(own: &Source, other: &Source, differences: &[String]) -> Error {
    Error::Config(format!(
        "{} is in {}, but {} is in {}. They differ in {}. One job takes one CRS: transform one of them first, or run two jobs. If a \
         record is wrong, say with [input] crs what all files are in, such as \"EPSG:26915\", or \"first\" for what the first file \
         says",
        own.path.display(),
        own.crs.label(),
        other.path.display(),
        other.crs.label(),
        differences.join(" and ")
    ))
}

/// Warns about sources that say less than `crs`, which the others say.
fn warn_of_gaps(sources: &[Source], crs: &Crs, warnings: &mut Warnings) {
    let count = sources.len();
    let nameless: Vec<&Source> = sources.iter().filter(|s| !s.crs.is_named()).collect();
    if let (true, Some(first)) = (crs.is_named(), nameless.first()) {
        warnings.push(format!(
            "{} of {count} inputs name no CRS, such as {}: they are taken to be in {}, as the others are",
            nameless.len(),
            first.path.display(),
            crs.label()
        ));
    }
    // Without a unit of height, heights are in the unit of x and y.
    let Some(metres) = crs.vertical.filter(|metres| crs.metres_per_unit() != Some(*metres)) else { return };
    let silent: Vec<&Source> = sources.iter().filter(|s| s.crs.vertical.is_none()).collect();
    if let Some(first) = silent.first() {
        warnings.push(format!(
            "{} of {count} inputs do not say the unit of their heights, such as {}: it is taken to be {}, as in the others",
            silent.len(),
            first.path.display(),
            Unit::from_metres(Some(metres)).name()
        ));
    }
}

/// What to do about coordinates that are not on a map.
const TRANSFORM: &str = "Transform the points to a projected CRS first, for example with `pdal translate \
    --writers.las.scale_x=0.01 --writers.las.scale_y=0.01 in.laz out.laz reprojection --filters.reprojection.out_srs=EPSG:...`";

/// Returns the name of the unit of x and y and its length in metres.
///
/// # Errors
/// [`Error::Config`] if the coordinates are in degrees or count from the middle of the earth.
pub fn horizontal_unit(
    choice: UnitChoice,
    chosen: &CrsChoice,
    crs: &Crs,
    warnings: &mut Warnings,
) -> Result<(&'static str, f64)> {
    // What the user says is no record of a file.
    let what_to_do = match chosen {
        CrsChoice::Given { .. } => "if the files are in another CRS than [input] crs says, name that one",
        _ => "if the CRS record is wrong, say with [input] crs what the files are in",
    };
    if crs.kind == CrsKind::Geocentric {
        return Err(Error::Config(format!(
            "the coordinates are geocentric ({}): they count from the middle of the earth, and z is no height. {TRANSFORM}; \
             {what_to_do}, or \"none\" for a plane",
            crs.label()
        )));
    }
    let unit = match choice {
        UnitChoice::Auto => crs.horizontal,
        UnitChoice::Metre => Unit::Metre,
        UnitChoice::Foot => Unit::Foot,
        UnitChoice::UsFoot => Unit::UsFoot,
    };
    if let Some(metres) = unit.metres_per_unit() {
        return Ok((key_of(unit), metres));
    }
    match unit {
        Unit::Unknown => {
            warnings.push(
                "no input says a unit of length for its coordinates: they are taken as metres (set [input] unit to say otherwise)",
            );
            Ok((key_of(Unit::Metre), 1.0))
        }
        _ => Err(Error::Config(format!(
            "the coordinates are in degrees ({}), and a Delaunay triangulation in degrees is distorted. {TRANSFORM}; \
             {what_to_do}, or set [input] unit = \"metre\"",
            crs.name.as_deref().unwrap_or("geographic CRS"),
        ))),
    }
}

/// Returns the name that the configuration and the report use for a unit.
fn key_of(unit: Unit) -> &'static str {
    match unit {
        Unit::Metre => "metre",
        Unit::Foot => "foot",
        Unit::UsFoot => "us-foot",
        Unit::Degree | Unit::Unknown | Unit::Other(_) => "other",
    }
}
