//! The projected system of a job, from which its terrain can be placed on the globe.

use crs::{Crs, GlobeWay};
use tiles::tiles3d::globe::GlobeSystem;

/// Returns the system of `crs`, with coordinates in units of `metres`, and its way to the globe.
///
/// # Errors
/// A sentence if it leads to no longitude and latitude that this program computes.
pub(crate) fn globe_system(crs: &Crs, metres: f64) -> Result<GlobeSystem, String> {
    let definition = definition(crs)?;
    let way = GlobeWay::of(crs, &definition, metres)?;
    Ok(GlobeSystem { definition: with_unit(&definition, metres), way: Box::new(move |place| way.geographic(place)) })
}

/// Returns the way of `crs`, with coordinates in units of `metres`, to the globe and back.
///
/// # Errors
/// As [`globe_system`].
pub(crate) fn globe_way(crs: &Crs, metres: f64) -> Result<GlobeWay, String> {
    GlobeWay::of(crs, &definition(crs)?, metres)
}

/// Returns the definition of `crs` in the form of PROJ.4.
fn definition(crs: &Crs) -> Result<String, String> {
    crs.proj4_definition().ok_or_else(|| match &crs.name {
        Some(name) => format!("{name} has no definition that gdt-batch can transform to longitude and latitude"),
        None => "no input names its coordinate system".to_string(),
    })
}

/// Returns the system of `definition` with coordinates in units of `metres`. A file may say another unit than the code that it names.
fn with_unit(definition: &str, metres: f64) -> String {
    let is_unit = |word: &&str| word.starts_with("+units=") || word.starts_with("+to_meter=");
    let (units, others): (Vec<&str>, Vec<&str>) = definition.split_whitespace().partition(is_unit);
    let is_same = |unit: &&str| match unit.split_once('=') {
        Some(("+units", "m")) => metres == 1.0,
        Some(("+units", "ft")) => metres == 0.3048,
        Some(("+units", "us-ft")) => metres == 1200.0 / 3937.0,
        Some((_, value)) => value.parse().is_ok_and(|value: f64| (value - metres).abs() <= 1e-12 * metres),
        None => false,
    };
    let is_metre = units.is_empty() && metres == 1.0;
    if is_metre || (!units.is_empty() && units.iter().all(is_same)) {
        return definition.to_string();
    }
    format!("{} +to_meter={metres}", others.join(" "))
}
