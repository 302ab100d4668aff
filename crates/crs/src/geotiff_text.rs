//! The well-known text of a projected system that GeoTIFF keys define themselves, so that it is compared, placed and written like any
//! other.

use crate::codes::{text_of_code, text_of_datum};
use crate::geokeys::{GeoKeys, USER_DEFINED};
use crate::geotiff_esri as esri;
use crate::projection::Projection;
use crate::wkt::{GEOGRAPHIC, PROJECTED, WktNode, degrees, find};
use std::ops::RangeInclusive;

const GEOGRAPHIC_TYPE: u16 = 2048;
const GEOGRAPHIC_CITATION: u16 = 2049;
const DATUM: u16 = 2050;
const ELLIPSOID: u16 = 2056;
const GREATER_AXIS: u16 = 2057;
const LESSER_AXIS: u16 = 2058;
const INVERSE_FLATTENING: u16 = 2059;
const PRIME_MERIDIAN_CODE: u16 = 2051;
const PRIME_MERIDIAN: u16 = 2061;
/// The key of a projection that has a code.
pub(crate) const PROJECTION: u16 = 3074;
/// The key of the method of a projection that other keys define.
pub(crate) const METHOD: u16 = 3075;
const ANGULAR_UNIT: u16 = 2054;
const ANGULAR_UNIT_SIZE: u16 = 2055;

/// Ellipsoids by their EPSG codes: the greater half axis and the inverse flattening.
const ELLIPSOIDS: [(u16, f64, f64); 6] = [
    (7019, 6_378_137.0, 298.257_222_101),
    (7030, 6_378_137.0, 298.257_223_563),
    (7008, 6_378_206.4, 294.978_698_213_898),
    (7004, 6_377_397.155, 299.152_812_8),
    (7022, 6_378_388.0, 297.0),
    (7001, 6_377_563.396, 299.324_964_6),
];

/// The keys of a parameter, in the order in which they are looked for, and its name in well-known text.
type Parameter = (&'static [u16], &'static str);

const LONGITUDE: Parameter = (&[3080, 3084, 3088, 3095], "central_meridian");
const LATITUDE: Parameter = (&[3081, 3085, 3089], "latitude_of_origin");
const FIRST: Parameter = (&[3078], "standard_parallel_1");
const SECOND: Parameter = (&[3079], "standard_parallel_2");
const SCALE: Parameter = (&[3092, 3093], "scale_factor");
const EASTING: Parameter = (&[3082, 3086, 3090], "false_easting");
const NORTHING: Parameter = (&[3083, 3087, 3091], "false_northing");

/// A method: its number in GeoTIFF, its name in well-known text, and its parameters.
type Method = (u16, &'static str, &'static [Parameter]);

/// The methods by their numbers in GeoTIFF. No parameter of them has a name that is not here.
const METHODS: [Method; 7] = [
    (1, "Transverse_Mercator", &[LATITUDE, LONGITUDE, SCALE, EASTING, NORTHING]),
    (7, "Mercator_1SP", &[LATITUDE, LONGITUDE, SCALE, EASTING, NORTHING]),
    (8, "Lambert_Conformal_Conic_2SP", &[FIRST, SECOND, LATITUDE, LONGITUDE, EASTING, NORTHING]),
    (9, "Lambert_Conformal_Conic_1SP", &[LATITUDE, LONGITUDE, SCALE, EASTING, NORTHING]),
    (10, "Lambert_Azimuthal_Equal_Area", &[LATITUDE, LONGITUDE, EASTING, NORTHING]),
    (11, "Albers_Conic_Equal_Area", &[FIRST, SECOND, LATITUDE, LONGITUDE, EASTING, NORTHING]),
    (16, "Oblique_Stereographic", &[LATITUDE, LONGITUDE, SCALE, EASTING, NORTHING]),
];

/// The variant of Mercator's projection that is true to scale at a parallel. Both variants have one number.
const MERCATOR_2SP: Method = (7, "Mercator_2SP", &[FIRST, LATITUDE, LONGITUDE, SCALE, EASTING, NORTHING]);

/// Returns the text of the system that the keys define, with x and y in a unit of so many `metres`; `None` if they do not say all of
/// it.
pub(crate) fn projected(keys: &GeoKeys, name: Option<&str>, metres: f64) -> Option<String> {
    let base = base(keys)?;
    // A text has its angles in the unit of its geographic system.
    let unit = WktNode::parse_all(&base)?.first().map_or(1.0, |base| degrees(base.unit()));
    let written = || written_out(keys, unit).filter(|_| problem(keys).is_none());
    let projection = zone(keys, metres, unit).or_else(written)?;
    let name = quoted(name.unwrap_or_default());
    Some(format!(r#"PROJCS["{name}",{base},{projection},UNIT["{}",{metres}]]"#, unit_name(metres)))
}

/// Returns the keys that say where the places of a system are, to compare two whose projection cannot be read. The units of x and y are
/// compared elsewhere.
pub(crate) fn definition(keys: &GeoKeys) -> Vec<String> {
    const OF_DATUM: RangeInclusive<u16> = 2048..=2062;
    const OF_PROJECTION: RangeInclusive<u16> = 3074..=3096;
    const LINEAR: [&str; 4] = ["2052=", "2053=", "3076=", "3077="];
    let all = keys.numbers(OF_DATUM).into_iter().chain(keys.numbers(OF_PROJECTION));
    all.filter(|value| !LINEAR.iter().any(|key| value.starts_with(key)))
        .map(|value| format!("GeoTIFF key {value}"))
        .collect()
}

/// Returns the degrees of the unit of angles; `None` for one that is not known.
fn angle(keys: &GeoKeys) -> Option<f64> {
    match keys.code(ANGULAR_UNIT) {
        None | Some(9102 | 9122) => Some(1.0),
        Some(9101) => Some(1f64.to_degrees()),
        Some(9105 | 9106) => Some(0.9),
        Some(USER_DEFINED) => keys.double(ANGULAR_UNIT_SIZE).filter(|size| *size > 0.0).map(f64::to_degrees),
        Some(_) => None,
    }
}

fn unit_name(metres: f64) -> &'static str {
    if metres == 1.0 { "metre" } else { "unit" }
}

fn quoted(name: &str) -> String {
    name.replace('"', "'")
}

/// Returns a zone of the universal transverse Mercator: 160zz north of the equator and 161zz south of it.
fn zone(keys: &GeoKeys, metres: f64, unit: f64) -> Option<String> {
    let code = keys.code(PROJECTION)?;
    let (zone, northing) = match code {
        16_001..=16_060 => (code - 16_000, 0.0),
        16_101..=16_160 => (code - 16_100, 1e7 / metres),
        _ => return None,
    };
    let (meridian, easting) = (f64::from(6 * i32::from(zone) - 183) / unit, 5e5 / metres);
    Some(format!(
        r#"PROJECTION["Transverse_Mercator"],PARAMETER["latitude_of_origin",0],PARAMETER["central_meridian",{meridian}],PARAMETER["scale_factor",0.9996],PARAMETER["false_easting",{easting}],PARAMETER["false_northing",{northing}]"#
    ))
}

/// Returns the projection that the keys write out, with its angles in a unit of so many degrees.
fn written_out(keys: &GeoKeys, unit: f64) -> Option<String> {
    let (_, name, parameters) = method(keys)?;
    let angle = angle(keys)? / unit;
    let mut text = format!(r#"PROJECTION["{name}"]"#);
    for (candidates, name) in *parameters {
        let is_angle = [LONGITUDE.1, LATITUDE.1, FIRST.1, SECOND.1].contains(name);
        let factor = if is_angle { angle } else { 1.0 };
        if let Some(value) = candidates.iter().find_map(|key| keys.double(*key)).map(|value| value * factor) {
            text.push_str(&format!(r#",PARAMETER["{name}",{value}]"#));
        }
    }
    Some(text)
}

fn method(keys: &GeoKeys) -> Option<&'static Method> {
    let method = keys.code(METHOD)?;
    if method == MERCATOR_2SP.0 && FIRST.0.iter().any(|key| keys.has(*key)) {
        return Some(&MERCATOR_2SP);
    }
    METHODS.iter().find(|(number, ..)| *number == method)
}

/// Says what keeps the projection that the keys define from being known: a code or a method that is not in the list, or a key that is
/// not there or cannot be read. Anything else in its place would be a guess.
pub(crate) fn problem(keys: &GeoKeys) -> Option<String> {
    if zone(keys, 1.0, 1.0).is_some() {
        return None;
    }
    let unknown = |key: u16, what: &str| {
        let code = keys.code(key)?;
        Some(format!("GeoTIFF key {key}, {what}, has the code {code}, which is not known"))
    };
    let Some((_, _, parameters)) = method(keys) else {
        let of_method = || unknown(METHOD, "the method of its projection");
        let of_code = keys.code(PROJECTION).filter(|code| *code != USER_DEFINED);
        return of_code.and_then(|_| unknown(PROJECTION, "its projection")).or_else(of_method);
    };
    if angle(keys).is_none() {
        return unknown(ANGULAR_UNIT, "the unit of its angles");
    }
    let of_parameters = parameters.iter().flat_map(|(candidates, _)| candidates.iter());
    let of_base = [GREATER_AXIS, LESSER_AXIS, INVERSE_FLATTENING, PRIME_MERIDIAN];
    if let Some(key) = of_parameters.chain(&of_base).find(|key| keys.lacks_double(**key)) {
        return Some(format!("GeoTIFF key {key} has no number that can be read"));
    }
    let system = find(&format!(r#"PROJCS["",{}]"#, written_out(keys, 1.0)?), &PROJECTED)?;
    Projection::read(&system)?.err()
}

/// Returns the text of the system of longitude and latitude that the keys define, with its angles in degrees; `None` if they do not say all
/// of it, or have another unit.
pub(crate) fn geographic(keys: &GeoKeys) -> Option<String> {
    base(keys).filter(|_| angle(keys) == Some(1.0))
}

/// Says what keeps longitude and latitude from being known, if the keys give them in another unit than the text of their code does.
pub(crate) fn problem_of_angles(keys: &GeoKeys, of_code: Option<&str>) -> Option<String> {
    let code = keys.code(ANGULAR_UNIT)?;
    let known = of_code.and_then(|text| find(text, &GEOGRAPHIC));
    let wanted = known.map_or(1.0, |system| degrees(system.unit()));
    let is_same = angle(keys).is_some_and(|angle| (angle - wanted).abs() < 1e-9);
    (!is_same).then(|| {
        format!("GeoTIFF key {ANGULAR_UNIT}, the unit of longitude and latitude, has the code {code}, not that of its system")
    })
}

/// Returns the geographic system: that of the code, that of the datum's code, or one with the ellipsoid that the keys give.
fn base(keys: &GeoKeys) -> Option<String> {
    let code = keys.code(GEOGRAPHIC_TYPE).filter(|code| *code != USER_DEFINED);
    let is_base = |text: &&str| text.starts_with("GEOGCS[");
    let of_code = code.and_then(|code| text_of_code(code.into())).filter(is_base);
    let of_datum = || keys.code(DATUM).filter(|code| *code != USER_DEFINED).and_then(|code| text_of_datum(code.into()));
    if let Some(text) = of_code.or_else(of_datum) {
        return Some(text.to_string());
    }
    const GREENWICH: u16 = 8901;
    let is_elsewhere = keys.code(PRIME_MERIDIAN_CODE).is_some_and(|code| code != GREENWICH);
    let meridian = keys.double(PRIME_MERIDIAN).or_else(|| (!is_elsewhere).then_some(0.0))?;
    let (greater, inverse) = ellipsoid(keys)?;
    // Key 2061 is in the unit of angles.
    let meridian = meridian * angle(keys)?;
    let citation = keys.text(GEOGRAPHIC_CITATION).unwrap_or_else(|| "unknown".into());
    let name = quoted(esri::part(&citation, "GCS Name").unwrap_or(&citation));
    let datum = quoted(esri::part(&citation, "Datum").unwrap_or(&name));
    Some(format!(
        r#"GEOGCS["{name}",DATUM["{datum}",SPHEROID["unknown",{greater},{inverse}]],PRIMEM["unknown",{meridian}],UNIT["degree",0.0174532925199433]]"#
    ))
}

/// Returns the greater half axis and the inverse flattening.
fn ellipsoid(keys: &GeoKeys) -> Option<(f64, f64)> {
    if let Some(greater) = keys.double(GREATER_AXIS) {
        let flattened = |lesser: f64| if lesser < greater { greater / (greater - lesser) } else { 0.0 };
        let inverse = keys.double(INVERSE_FLATTENING).or_else(|| keys.double(LESSER_AXIS).map(flattened))?;
        return Some((greater, inverse));
    }
    let code = keys.code(ELLIPSOID)?;
    ELLIPSOIDS.iter().find(|(known, ..)| *known == code).map(|(_, greater, inverse)| (*greater, *inverse))
}
