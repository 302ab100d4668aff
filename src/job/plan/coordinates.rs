//! The CRS and the units that all inputs of a job have in common.

use crate::input::Source;
use crate::input::options::UnitChoice;
use crate::input::{Crs, Unit};
use crate::{Error, Result, Warnings};

/// Returns the CRS of all sources. A source without one agrees with any.
///
/// # Errors
/// [`Error::Config`] if two sources differ.
pub fn common_crs(sources: &[Source]) -> Result<Crs> {
    let known = |s: &&Source| s.crs != Crs::default();
    let Some(first) = sources.iter().find(known) else { return Ok(Crs::default()) };
    for other in sources.iter().filter(known) {
        if !first.crs.same_as(&other.crs) {
            let name = |s: &Source| s.crs.name.clone().unwrap_or_else(|| "an unnamed CRS".into());
            return Err(Error::Config(format!(
                "{} is in {}, but {} is in {}: one job takes one CRS, so transform one of them first or run two jobs",
                first.path.display(),
                name(first),
                other.path.display(),
                name(other),
            )));
        }
    }
    Ok(first.crs.clone())
}

/// Returns the name of the unit of x and y and its length in metres.
///
/// # Errors
/// [`Error::Config`] if the coordinates are in degrees.
pub fn horizontal_unit(choice: UnitChoice, crs: &Crs, warnings: &mut Warnings) -> Result<(&'static str, f64)> {
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
                "no input says the unit of its coordinates: they are taken as metres (set [input] unit to say otherwise)",
            );
            Ok((key_of(Unit::Metre), 1.0))
        }
        _ => Err(Error::Config(format!(
            "the coordinates are in degrees ({}), and a Delaunay triangulation in degrees is distorted: transform the points to a \
             projected CRS first, for example with `pdal translate --writers.las.scale_x=0.01 --writers.las.scale_y=0.01 in.laz \
             out.laz reprojection --filters.reprojection.out_srs=EPSG:...`; if the CRS record is wrong, set [input] unit = \
             \"metre\"",
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
