//! Coordinate reference systems as GeoTIFF keys.

use crate::input::crs::from_wkt::{self, from_epsg};
use crate::input::crs::geokeys::{GeoKeys, USER_DEFINED};
use crate::input::crs::geotiff_text;
use crate::input::crs::system::{Crs, CrsKind};
use crate::input::crs::unit::Unit;
use crate::input::crs::vertical::VerticalSystem;

const MODEL_TYPE: u16 = 1024;
const GEOGRAPHIC_TYPE: u16 = 2048;
const PROJECTED_TYPE: u16 = 3072;
const LINEAR_UNITS: u16 = 3076;
const LINEAR_UNIT_SIZE: u16 = 3077;
const VERTICAL_TYPE: u16 = 4096;
const VERTICAL_CITATION: u16 = 4097;
const VERTICAL_UNITS: u16 = 4099;
/// The citations of the projected, the geographic and any system.
const CITATIONS: [u16; 3] = [3073, 2049, 1026];

/// Returns the metres of the unit of x and y, if a key gives it.
fn linear_unit(keys: &GeoKeys) -> Option<f64> {
    match keys.code(LINEAR_UNITS)? {
        USER_DEFINED => keys.double(LINEAR_UNIT_SIZE).filter(|size| *size > 0.0),
        code => metres(code),
    }
}

/// Says what of the keys is there, but cannot be used.
pub(crate) fn doubts(keys: &GeoKeys) -> Vec<String> {
    let unit = keys.code(LINEAR_UNITS).filter(|_| linear_unit(keys).is_none()).map(|code| match code {
        USER_DEFINED => format!("GeoTIFF key {LINEAR_UNIT_SIZE}, the unit of x and y, is no length"),
        code => format!("GeoTIFF key {LINEAR_UNITS}, the unit of x and y, has the code {code}, which is not known"),
    });
    let height = keys.code(VERTICAL_UNITS).filter(|code| metres(*code).is_none());
    let height = height.map(|code| {
        format!("GeoTIFF key {VERTICAL_UNITS}, the unit of heights, has the code {code}, which is not known")
    });
    let is_defined = keys.code(PROJECTED_TYPE) == Some(USER_DEFINED);
    let projection = is_defined.then(|| geotiff_text::problem(keys)).flatten();
    let projection = projection.map(|what| format!("nobody can tell where its coordinates are: {what}"));
    unit.into_iter().chain(height).chain(projection).collect()
}

/// Returns the metres of a unit of length by its EPSG code.
fn metres(code: u16) -> Option<f64> {
    match code {
        9001 => Some(1.0),
        9002 => Some(Unit::FOOT),
        9003 => Some(Unit::US_FOOT),
        9036 => Some(1000.0),
        _ => None,
    }
}

/// Returns the system that the keys describe; `None` if they say nothing.
pub(crate) fn parse(keys: &GeoKeys) -> Option<Crs> {
    let model = keys.code(MODEL_TYPE);
    let projected = keys.code(PROJECTED_TYPE).filter(|_| !matches!(model, Some(2 | 3)));
    let code = projected.or_else(|| keys.code(GEOGRAPHIC_TYPE).filter(|_| model != Some(1)));
    let epsg = code.filter(|code| *code != USER_DEFINED).map(u32::from);
    let name = CITATIONS.iter().find_map(|key| keys.text(*key));
    let unit = linear_unit(keys);
    let of_code = epsg.and_then(from_epsg);
    let is_defined = projected == Some(USER_DEFINED);
    let defined = || from_wkt::parse(&geotiff_text::projected(keys, name.as_deref(), unit?)?);
    let known = of_code.or_else(|| defined().filter(|_| is_defined)).unwrap_or_default();
    let kind = kind(model, projected.is_some(), epsg.is_some(), known.kind);
    let horizontal = match unit {
        _ if kind == CrsKind::Geographic => Unit::Degree,
        Some(metres) => Unit::from_metres(Some(metres)),
        None if kind == CrsKind::Geocentric => Unit::Metre,
        None => known.horizontal,
    };
    let heights = VerticalSystem {
        epsg: keys.code(VERTICAL_TYPE).filter(|code| *code != USER_DEFINED).map(u32::from),
        name: keys.text(VERTICAL_CITATION),
        datum: None,
    };
    let unit_of_height = keys.code(VERTICAL_UNITS).and_then(metres).or_else(|| heights.metres_of_code());
    let crs = Crs {
        // If a key gives another unit than the code, the text of the code would be wrong.
        wkt: known.wkt.filter(|_| known.horizontal == horizontal),
        epsg,
        kind,
        horizontal,
        vertical: unit_of_height.or(known.vertical),
        vertical_system: Some(heights).filter(|system| *system != VerticalSystem::default()).or(known.vertical_system),
        name: known.name.or(name),
    };
    (crs != Crs::default()).then_some(crs)
}

/// Returns the kind that the keys say, or else that of the code.
fn kind(model: Option<u16>, is_projected: bool, has_code: bool, known: CrsKind) -> CrsKind {
    match model {
        Some(3) => CrsKind::Geocentric,
        _ if known != CrsKind::Unknown => known,
        _ if is_projected => CrsKind::Projected,
        Some(2) => CrsKind::Geographic,
        None if has_code => CrsKind::Geographic,
        _ => CrsKind::Unknown,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::crs::geokeys::{DOUBLES, TEXTS};

    fn records(keys: &[[u16; 4]], doubles: &[f64]) -> GeoKeys {
        let mut all = vec![[1, 1, 0, keys.len() as u16]];
        all.extend(keys);
        GeoKeys {
            directory: all.iter().flatten().flat_map(|number| number.to_le_bytes()).collect(),
            doubles: doubles.iter().flat_map(|number| number.to_le_bytes()).collect(),
            texts: b"My grid|".to_vec(),
        }
    }

    #[test]
    fn a_code_gives_unit_and_text() {
        let crs = parse(&records(&[[1024, 0, 1, 1], [3072, 0, 1, 2949]], &[])).unwrap();
        assert_eq!((crs.epsg, crs.horizontal), (Some(2949), Unit::Metre));
        assert!(crs.wkt.unwrap().contains("MTM zone 7"));
    }

    #[test]
    fn a_unit_key_wins_over_the_code() {
        let crs = parse(&records(&[[1024, 0, 1, 1], [3072, 0, 1, 32104], [3076, 0, 1, 9003], [4099, 0, 1, 9003]], &[]))
            .unwrap();
        assert_eq!((crs.horizontal, crs.vertical), (Unit::UsFoot, Some(Unit::US_FOOT)));
        assert_eq!(crs.wkt, None);
    }

    #[test]
    fn user_defined_units_and_names_are_read() {
        let keys = [
            [1024, 0, 1, 1],
            [1026, TEXTS, 8, 0],
            [3072, 0, 1, USER_DEFINED],
            [3076, 0, 1, USER_DEFINED],
            [3077, DOUBLES, 1, 0],
        ];
        let crs = parse(&records(&keys, &[0.201168])).unwrap();
        assert_eq!((crs.horizontal, crs.name.as_deref()), (Unit::Other(0.201168), Some("My grid")));
    }

    #[test]
    fn geographic_systems_are_in_degrees_and_damaged_keys_are_no_system() {
        assert_eq!(parse(&records(&[[1024, 0, 1, 2], [2048, 0, 1, 4326]], &[])).unwrap().horizontal, Unit::Degree);
        assert_eq!(parse(&records(&[[3076, DOUBLES, 9, 9], [1026, TEXTS, 9, 9000]], &[])), None);
        let cut = GeoKeys { directory: vec![1, 0, 1], doubles: Vec::new(), texts: Vec::new() };
        assert_eq!(parse(&cut), None);
    }

    /// A transverse Mercator projection. The doubles are the longitude and latitude of the origin, the false easting and the scale; the
    /// false northing is the latitude once more.
    const PARAMETERS: [[u16; 4]; 7] = [
        [3074, 0, 1, USER_DEFINED],
        [3075, 0, 1, 1],
        [3080, DOUBLES, 1, 0],
        [3081, DOUBLES, 1, 1],
        [3082, DOUBLES, 1, 2],
        [3083, DOUBLES, 1, 1],
        [3092, DOUBLES, 1, 3],
    ];

    /// NAD83 / UTM zone 15N, but for what `changes` says otherwise.
    fn user_defined(changes: &[[u16; 4]], doubles: &[f64]) -> Crs {
        let mut keys: Vec<[u16; 4]> = vec![
            [1024, 0, 1, 1],
            [2048, 0, 1, 4269],
            [3072, 0, 1, USER_DEFINED],
            [3074, 0, 1, 16015],
            [3076, 0, 1, 9001],
        ];
        for change in changes {
            keys.retain(|key| key[0] != change[0]);
            keys.push(*change);
        }
        parse(&records(&keys, doubles)).unwrap()
    }

    #[test]
    fn user_defined_keys_are_compared_with_codes_by_what_they_say() {
        let [utm, nad27, zone_16] = [26915, 26715, 26916].map(|code| from_epsg(code).unwrap());
        let own = user_defined(&[], &[]);
        assert_eq!(own.differences(&utm), [""; 0]);
        assert_eq!(own.differences(&nad27), ["the datum (NAD83, NAD27)"]);
        assert_eq!(own.differences(&zone_16), ["the longitude of the origin (-93, -87)"]);
        assert!(own.proj4_definition().unwrap().contains("+proj=tmerc"));
        assert_eq!(user_defined(&PARAMETERS, &[-93.0, 0.0, 500_000.0, 0.9996]).differences(&utm), [""; 0]);
        assert_eq!(user_defined(&PARAMETERS, &[-93.0, 0.0, 500_000.0, 0.9999]).differences(&utm).len(), 1);
        // Keys that do not say the projection leave it in doubt.
        assert_eq!(user_defined(&[[3074, 0, 1, 10_101], [3073, TEXTS, 8, 0]], &[]).differences(&utm).len(), 1);
    }

    #[test]
    fn a_parameter_that_is_missing_or_unreadable_leaves_the_projection_unknown() {
        let geographic = [[1024, 0, 1, 1], [2048, 0, 1, 4269], [3072, 0, 1, USER_DEFINED], [3076, 0, 1, 9001]];
        let all: Vec<[u16; 4]> = geographic.into_iter().chain(PARAMETERS).collect();
        let doubles = [-93.0, 0.0, 500_000.0, 0.9996, f64::NAN];
        let doubts = |changed: u16, entry: Option<[u16; 4]>| {
            let keys: Vec<[u16; 4]> = all.iter().filter(|key| key[0] != changed).copied().chain(entry).collect();
            let keys = records(&keys, &doubles);
            let (crs, doubts) = (parse(&keys).unwrap(), doubts(&keys));
            assert_eq!(crs.proj4_definition().is_some(), doubts.is_empty(), "{changed}: {doubts:?}");
            assert_eq!(crs.kind, CrsKind::Projected);
            doubts.concat()
        };
        assert_eq!(doubts(0, None), "");
        assert!(doubts(3080, None).ends_with("it does not give the longitude of the origin"));
        assert!(doubts(3081, None).ends_with("it does not give the latitude of the origin"));
        // GeoTIFF, like well-known text, has a value for these.
        for key in [3082, 3083, 3092] {
            assert_eq!(doubts(key, None), "", "{key}");
        }
        for key in [3080, 3081, 3082, 3083, 3092, 2061] {
            for entry in [[key, DOUBLES, 1, 4], [key, DOUBLES, 1, 90], [key, 0, 1, 7]] {
                assert!(doubts(key, Some(entry)).ends_with(&format!("key {key} has no number that can be read")));
            }
        }
        for entry in [[3076, 0, 1, 9999], [3076, 0, 1, USER_DEFINED]] {
            assert!(doubts(3076, Some(entry)).contains("the unit of x and y"));
        }
    }

    #[test]
    fn geocentric_systems_are_known_by_the_model_and_by_the_code() {
        for keys in [&[[1024, 0, 1, 3], [2048, 0, 1, 4326]][..], &[[1024, 0, 1, 3]], &[[2048, 0, 1, 4978]]] {
            assert_eq!(parse(&records(keys, &[])).unwrap().kind, CrsKind::Geocentric, "{keys:?}");
        }
    }

    #[test]
    fn the_datum_of_heights_is_read() {
        let crs = parse(&records(&[[3072, 0, 1, 25832], [4096, 0, 1, 5941], [4099, 0, 1, 9001]], &[])).unwrap();
        assert_eq!(crs.differences(&from_epsg(5972).unwrap()), [""; 0]);
        let other = parse(&records(&[[3072, 0, 1, 25832], [4096, 0, 1, 5776], [4099, 0, 1, 9001]], &[])).unwrap();
        assert_eq!(crs.differences(&other), ["the datum of heights (EPSG:5941, EPSG:5776)"]);
    }
}
