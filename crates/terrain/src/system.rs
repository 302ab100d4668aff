//! The CRS and the units of a written terrain, and whether two terrains have the same.

use crs::{Crs, Sameness, Unit, VerticalSystem, from_wkt};
use serde::Deserialize;
use sys::{Error, Result, Warnings};
use tiles::frame::Extras;

/// The CRS and the units of a terrain.
#[derive(Clone, Debug, PartialEq)]
pub struct TerrainSystem {
    /// The CRS. Its units are always known: a job takes coordinates without a unit as metres.
    pub crs: Crs,
    /// The metres in a unit of x and y, and in one of heights.
    pub metres: [f64; 2],
}

/// What is needed of `georeference.json`.
#[derive(Default, Deserialize)]
struct GeoreferenceFacts {
    epsg: Option<u32>,
    globe: Option<GlobeFacts>,
}

#[derive(Deserialize)]
struct GlobeFacts {
    vertical_datum: Option<String>,
}

impl TerrainSystem {
    /// Returns what the tiles say, and the text of `georeference.json` if there is one.
    pub(crate) fn new(extras: &Extras, georeference: Option<&[u8]>) -> TerrainSystem {
        let facts: GeoreferenceFacts =
            georeference.and_then(|text| serde_json::from_slice(text).ok()).unwrap_or_default();
        let said = extras.crs.as_deref().and_then(from_wkt::parse).unwrap_or_default();
        let datum = facts.globe.and_then(|globe| globe.vertical_datum);
        let code = |name: &str| name.strip_prefix("EPSG:")?.parse().ok();
        let by_name = || {
            datum.map(|name| match code(&name) {
                Some(code) => VerticalSystem { epsg: Some(code), ..VerticalSystem::default() },
                None => VerticalSystem { name: Some(name), ..VerticalSystem::default() },
            })
        };
        let crs = Crs {
            epsg: said.epsg.or(facts.epsg),
            horizontal: Unit::from_metres(Some(extras.metres_per_unit)),
            vertical: Unit::from_metres(Some(extras.metres_per_unit_z)).metres_per_unit(),
            vertical_system: said.vertical_system.clone().or_else(by_name),
            ..said
        };
        TerrainSystem { crs, metres: [extras.metres_per_unit, extras.metres_per_unit_z] }
    }

    /// Returns the names of the units of x and y and of heights.
    pub fn units(&self) -> [String; 2] {
        self.metres.map(|metres| Unit::from_metres(Some(metres)).name())
    }

    /// Returns the name of the CRS; `None` if it is unknown.
    pub fn name(&self) -> Option<String> {
        self.crs.is_named().then(|| self.crs.label())
    }
}

/// Warns where one of two terrains, which are called by the `names`, says more of its coordinates than the other.
///
/// # Errors
/// [`Error::Config`] if their CRSs, units or systems of heights differ.
pub fn same_system(
    [first, second]: [&TerrainSystem; 2],
    [first_name, second_name]: [&str; 2],
    warnings: &mut Warnings,
) -> Result<()> {
    let label = |system: &TerrainSystem| {
        let [unit, unit_z] = system.units();
        let units = if unit == unit_z { unit } else { format!("{unit}, heights in {unit_z}") };
        format!("{} ({units})", system.name().unwrap_or_else(|| "an unknown CRS".into()))
    };
    let refuse = |differences: &str| {
        let [own, other] = [first, second].map(label);
        Err(Error::Config(format!(
            "{first_name} is in {own}, but {second_name} is in {other}. They differ in {differences}. Two terrains are compared in one CRS: \
             run one of the jobs again with [input] to_crs, or with [input] crs if the CRS of its files is wrong"
        )))
    };
    let differences = first.crs.differences(&second.crs);
    if !differences.is_empty() {
        return refuse(&differences.join(" and "));
    }
    match (first.name(), second.name()) {
        (Some(own), None) => warnings.push(unknown(second_name, "CRS", &own)),
        (None, Some(other)) => warnings.push(unknown(first_name, "CRS", &other)),
        (None, None) => {}
        (Some(_), Some(_)) => match first.crs.sameness(&second.crs) {
            Sameness::Known => {}
            Sameness::Assumed => warnings.push(format!(
                "a datum is unknown: {} are assumed to be the same, though two datums may be hundreds of metres apart",
                first.crs.names_of_datums(&second.crs)
            )),
            Sameness::Refuted(why) => return refuse(&why),
        },
    }
    let heights = |system: &TerrainSystem| system.crs.vertical_system.as_ref().map(VerticalSystem::label);
    match (heights(first), heights(second)) {
        (Some(own), None) => warnings.push(unknown(second_name, "vertical datum", &own)),
        (None, Some(other)) => warnings.push(unknown(first_name, "vertical datum", &other)),
        _ => {}
    }
    Ok(())
}

fn unknown(name: &str, what: &str, other: &str) -> String {
    format!("the {what} of {name} is unknown: {other} assumed, as for the other terrain")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn system(code: Option<u32>, heights: Option<u32>, metres: [f64; 2]) -> TerrainSystem {
        let wkt = code.map(|code| from_wkt::from_epsg(code).unwrap().wkt.unwrap());
        let extras = Extras {
            offset: [0.0; 3],
            resolution: 0.01,
            resolution_z: 0.01,
            metres_per_unit: metres[0],
            metres_per_unit_z: metres[1],
            crs: wkt,
            curvature: None,
        };
        let name = match heights {
            Some(5703) => "\"NAVD88 height\"",
            Some(_) => "\"EGM96 height\"",
            None => "null",
        };
        let georeference = format!("{{\"epsg\": null, \"globe\": {{\"vertical_datum\": {name}}}}}");
        TerrainSystem::new(&extras, Some(georeference.as_bytes()))
    }

    fn compare(first: &TerrainSystem, second: &TerrainSystem) -> Result<Vec<String>> {
        let mut warnings = Warnings::default();
        same_system([first, second], ["a", "b"], &mut warnings)?;
        Ok(warnings.iter().map(str::to_owned).collect())
    }

    #[test]
    fn systems_and_units_are_compared() {
        let utm = system(Some(26915), Some(5703), [1.0; 2]);
        assert_eq!(compare(&utm, &utm).unwrap(), [""; 0]);
        for (other, word) in [
            (system(Some(26916), Some(5703), [1.0; 2]), "EPSG:26916"),
            (system(Some(26915), Some(5703), [1.0, 0.3048]), "unit of height"),
            (system(None, None, [0.3048; 2]), "unit of x and y"),
            (system(Some(26915), Some(5773), [1.0; 2]), "NAVD88"),
        ] {
            let error = compare(&utm, &other).unwrap_err();
            assert!(error.kind() == sys::ErrorKind::Usage && error.to_string().contains(word), "{error}");
        }
        for (other, words) in [
            (system(None, Some(5703), [1.0; 2]), &["the CRS of b is unknown"][..]),
            (system(Some(26915), None, [1.0; 2]), &["the vertical datum of b is unknown"]),
            (system(None, None, [1.0; 2]), &["CRS of b", "vertical datum of b"]),
        ] {
            let warnings = compare(&utm, &other).unwrap();
            assert_eq!(warnings.len(), words.len(), "{warnings:?}");
            assert!(warnings.iter().zip(words).all(|(warning, word)| warning.contains(word)), "{warnings:?}");
        }
        let plane = system(None, None, [1.0; 2]);
        assert_eq!(compare(&plane, &plane).unwrap(), [""; 0]);
    }
}
