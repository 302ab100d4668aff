//! The definition of a projected system as a PROJ.4 string, from its EPSG code or from its well-known text.

use crate::codes::proj4_of_code;
use crate::datum::Datum;
use crate::projection::Projection;
use crate::wkt::{BASE, DATUM, PROJECTED, WktNode, find};

/// Returns the definition of the system of this code, or else of this text; `None` if neither gives one.
pub(crate) fn definition(epsg: Option<u32>, wkt: Option<&str>) -> Option<String> {
    let of_code = epsg.and_then(proj4_of_code).filter(|definition| leads_to_wgs84(definition));
    of_code.map(str::to_string).or_else(|| of_text(wkt?))
}

/// Returns whether a definition says the way to WGS 84, or needs none because its ellipsoid is that of WGS 84 and all datums like it, or a
/// sphere. Without a shift, a datum on another ellipsoid is hundreds of metres off.
fn leads_to_wgs84(definition: &str) -> bool {
    let value = |key: &str| definition.split_whitespace().find_map(|word| word.strip_prefix(key)?.strip_prefix('='));
    let says_way = ["+towgs84", "+datum", "+nadgrids"].iter().any(|key| value(key).is_some());
    let is_sphere = value("+R").is_some() || value("+a").is_some() && value("+a") == value("+b");
    says_way || is_sphere || value("+ellps").is_some_and(|name| ["GRS80", "WGS84"].contains(&name))
}

fn of_text(text: &str) -> Option<String> {
    let system = find(text, &PROJECTED)?;
    // A projection with a parameter missing or unreadable is somewhere else.
    let projection = Projection::of(&system)?.proj4()?;
    Some(format!("{projection} {} +to_meter={} +no_defs", datum(&system)?, system.unit_metres()?))
}

/// Returns the ellipsoid and the shift to WGS 84. If the text gives no shift, the shift is zero for the datums that agree with
/// WGS 84 to a metre or two, such as NAD83 and ETRS89, and unknown for all others.
fn datum(system: &WktNode) -> Option<String> {
    let base = system.child(&BASE)?;
    let datum = base.child(&DATUM)?;
    let spheroid = datum.child(&["SPHEROID", "ELLIPSOID"])?;
    let (axis, flattening) = (spheroid.number(1)? * spheroid.unit_metres().unwrap_or(1.0), spheroid.number(2)?);
    let shift = match datum.child(&["TOWGS84"]) {
        Some(shift) => (0..7).map(|k| shift.number(k).unwrap_or(0.0).to_string()).collect::<Vec<_>>().join(","),
        None if Datum::of(base)?.is_close_to_wgs84() => "0,0,0".into(),
        None => return None,
    };
    let greenwich = base.child(&["PRIMEM", "PRIMEMERIDIAN"]).is_none_or(|meridian| meridian.number(1) == Some(0.0));
    let shape = if flattening > 0.0 { format!("+a={axis} +rf={flattening}") } else { format!("+a={axis} +b={axis}") };
    greenwich.then(|| format!("{shape} +towgs84={shift}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_code_gives_its_own_definition() {
        let definition = definition(Some(26915), None).unwrap();
        assert!(definition.contains("+proj=utm +zone=15"), "{definition}");
    }

    #[test]
    fn a_code_without_a_shift_of_its_datum_gives_none() {
        // Anguilla 1957 and Xian 1980.
        for code in [2000, 2334] {
            assert!(!proj4_of_code(code).unwrap().contains("towgs84"));
            assert_eq!(definition(Some(code), None), None, "EPSG:{code}");
        }
        // ITRF2000-like datums, a sphere, and a datum with a shift.
        for code in [6344, 2163, 31467] {
            assert!(definition(Some(code), None).is_some(), "EPSG:{code}");
        }
    }

    #[test]
    fn false_eastings_in_feet_are_converted_to_metres() {
        let text = r#"PROJCS["a",GEOGCS["GCS_North_American_1983_HARN",DATUM["d",SPHEROID["GRS 1980",6378137,298.25]],
            PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]],PROJECTION["Lambert_Conformal_Conic_2SP"],
            PARAMETER["standard_parallel_1",43],PARAMETER["standard_parallel_2",45.5],PARAMETER["latitude_of_origin",41.75],
            PARAMETER["central_meridian",-120.5],PARAMETER["false_easting",1000],PARAMETER["false_northing",0],
            UNIT["foot",0.3048]]"#;
        assert_eq!(
            definition(None, Some(text)).unwrap(),
            "+proj=lcc +lat_0=41.75 +lat_1=45.5 +lat_2=43 +lon_0=-120.5 +x_0=304.8 +y_0=0 +a=6378137 +rf=298.25 +towgs84=0,0,0 \
             +to_meter=0.3048 +no_defs"
        );
        // The shift of a datum that may be hundreds of metres off is not guessed.
        let other = text.replace("GCS_North_American_1983_HARN", "European 1950");
        assert_eq!(definition(None, Some(&other)), None);
    }
}
