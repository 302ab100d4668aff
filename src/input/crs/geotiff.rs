//! Coordinate reference systems as GeoTIFF keys.

use crate::input::crs::codes::text_of_code;
use crate::input::crs::from_wkt::{self, from_epsg};
use crate::input::crs::geokeys::{GeoKeys, USER_DEFINED};
use crate::input::crs::geotiff_esri as esri;
use crate::input::crs::geotiff_text::{self, METHOD, PROJECTION};
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
    let known = parse(keys);
    let is_unknown = known.as_ref().is_some_and(|crs| crs.form().is_none());
    let is_geographic = known.is_some_and(|crs| crs.kind == CrsKind::Geographic);
    let of_code = || keys.code(GEOGRAPHIC_TYPE).and_then(|code| text_of_code(code.into()));
    let problem = match projected(keys) {
        Some(USER_DEFINED) => geotiff_text::problem(keys),
        None if is_geographic => geotiff_text::problem_of_angles(keys, of_code()).or_else(|| {
            let code = keys.code(GEOGRAPHIC_TYPE).filter(|code| *code != USER_DEFINED);
            Some(code.map_or_else(|| "the GeoTIFF keys do not say its datum".into(), not_in_list))
        }),
        code => code.map(not_in_list),
    };
    let projection = problem.filter(|_| is_unknown);
    let projection = projection.map(|what| format!("nobody can tell where its coordinates are: {what}"));
    unit.into_iter().chain(height).chain(projection).chain(other_unit(keys)).collect()
}

/// Says that a key gives another unit of x and y than the code of the system has.
fn other_unit(keys: &GeoKeys) -> Option<String> {
    let code = projected(keys).filter(|code| *code != USER_DEFINED)?;
    let (own, of_code) = (Unit::from_metres(linear_unit(keys)), from_epsg(code.into())?.horizontal);
    (own != Unit::Unknown && own != of_code).then(|| {
        format!(
            "GeoTIFF key {LINEAR_UNITS}, the unit of x and y, says {}, and EPSG:{code} has them in {}: that of the key is used",
            own.name(),
            of_code.name()
        )
    })
}

fn not_in_list(code: u16) -> String {
    format!("EPSG:{code} is not in the list of known codes")
}

/// Returns the code of the projected system. Some writers leave it out where other keys define the projection.
fn projected(keys: &GeoKeys) -> Option<u16> {
    let model = keys.code(MODEL_TYPE);
    let is_defined = || model == Some(1) && [PROJECTION, METHOD].iter().any(|key| keys.code(*key).is_some());
    let code = keys.code(PROJECTED_TYPE).or_else(|| is_defined().then_some(USER_DEFINED));
    code.filter(|_| !matches!(model, Some(2 | 3)))
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
    let projected = projected(keys);
    let code = projected.or_else(|| keys.code(GEOGRAPHIC_TYPE).filter(|_| model != Some(1)));
    let epsg = code.filter(|code| *code != USER_DEFINED).map(u32::from);
    let name = CITATIONS.iter().filter_map(|key| keys.text(*key)).find_map(|text| esri::title(&text));
    let unit = linear_unit(keys);
    let of_code = epsg.and_then(from_epsg);
    if let Some(crs) = in_other_angles(keys, &of_code, name.clone()) {
        return Some(crs);
    }
    let is_defined = projected == Some(USER_DEFINED);
    let defined = || from_wkt::parse(&geotiff_text::projected(keys, name.as_deref(), unit?)?);
    // ESRI's programs write their text into a citation.
    let written = || CITATIONS.iter().filter_map(|key| keys.text(*key)).find_map(|text| esri::system(&text));
    let written = || written().filter(|crs| projected.is_some() == (crs.kind == CrsKind::Projected));
    let geographic = || from_wkt::parse(&geotiff_text::geographic(keys)?).filter(|_| is_geographic(keys));
    let known = of_code.or_else(written).or_else(|| defined().filter(|_| is_defined)).or_else(geographic);
    let known = known.unwrap_or_default();
    let kind = kind(model, projected.is_some(), epsg.is_some(), known.kind);
    let horizontal = match unit {
        _ if kind == CrsKind::Geographic => Unit::Degree,
        Some(metres) => Unit::from_metres(Some(metres)),
        None if kind == CrsKind::Geocentric => Unit::Metre,
        None => known.horizontal,
    };
    let heights = VerticalSystem {
        epsg: keys.code(VERTICAL_TYPE).filter(|code| *code != USER_DEFINED).map(u32::from),
        name: keys.text(VERTICAL_CITATION).and_then(|text| esri::title(&text)),
        ..VerticalSystem::default()
    };
    let unit_of_height = keys.code(VERTICAL_UNITS).and_then(metres).or_else(|| heights.metres_of_code());
    let mut crs = Crs {
        // If a key gives another unit than the code, the text of the code would be wrong.
        wkt: known.wkt.filter(|_| known.horizontal == horizontal),
        epsg,
        kind,
        horizontal,
        vertical: unit_of_height.or(known.vertical),
        vertical_system: Some(heights).filter(|system| *system != VerticalSystem::default()).or(known.vertical_system),
        name: known.name.or(name),
        unread_keys: Vec::new(),
    };
    if is_defined && crs.form().is_none() {
        crs.unread_keys = geotiff_text::definition(keys);
    }
    (crs != Crs::default()).then_some(crs)
}

/// Returns whether the keys say that places are longitudes and latitudes.
fn is_geographic(keys: &GeoKeys) -> bool {
    keys.code(MODEL_TYPE) == Some(2)
}

/// Returns a system of longitude and latitude in radians, grads or another angle than the text of its code has. Nothing here reads such
/// coordinates, so it has no text and no code by which they would count as degrees.
fn in_other_angles(keys: &GeoKeys, of_code: &Option<Crs>, name: Option<String>) -> Option<Crs> {
    let known = of_code.as_ref();
    let is_geographic = known.map_or(is_geographic(keys), |crs| crs.kind == CrsKind::Geographic);
    let text = known.and_then(|crs| crs.wkt.as_deref());
    geotiff_text::problem_of_angles(keys, text).filter(|_| is_geographic)?;
    Some(Crs {
        kind: CrsKind::Geographic,
        horizontal: Unit::Degree,
        name: known.and_then(|crs| crs.name.clone()).or(name),
        unread_keys: geotiff_text::definition(keys),
        ..Crs::default()
    })
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
        let told =
            |unit: u16| doubts(&records(&[[1024, 0, 1, 1], [3072, 0, 1, 32104], [3076, 0, 1, unit]], &[])).concat();
        assert!(told(9003).contains("says US survey foot, and EPSG:32104 has them in metre"), "{}", told(9003));
        assert_eq!(told(9001), "");
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
    fn longitudes_in_another_angle_than_their_code_has_are_not_read() {
        for (code, unit) in [(4326, 9101), (4326, 9105), (4326, 9107), (4807, 9102), (32767, 9101)] {
            let keys = records(&[[1024, 0, 1, 2], [2048, 0, 1, code], [2054, 0, 1, unit], [2056, 0, 1, 7030]], &[]);
            let crs = parse(&keys).unwrap();
            assert!(
                crs.form().is_none() && crs.is_named() && crs.kind == CrsKind::Geographic,
                "{code} {unit}: {crs:?}"
            );
            assert!(
                doubts(&keys)[0]
                    .contains(&format!("key 2054, the unit of longitude and latitude, has the code {unit}"))
            );
        }
        for (code, unit) in [(4326, 9102), (4326, 9122), (4807, 9105)] {
            let keys = records(&[[1024, 0, 1, 2], [2048, 0, 1, code], [2054, 0, 1, unit]], &[]);
            assert!(parse(&keys).unwrap().form().is_some() && doubts(&keys).is_empty(), "{code} {unit}");
        }
    }

    #[test]
    fn longitude_and_latitude_may_be_defined_by_keys() {
        let keys =
            [[1024, 0, 1, 2], [2048, 0, 1, USER_DEFINED], [2049, TEXTS, 6, 0], [2054, 0, 1, 9102], [2056, 0, 1, 7030]];
        let mut keys = records(&keys, &[]);
        keys.texts = b"WGS 84|".to_vec();
        assert_eq!(parse(&keys).unwrap().differences(&from_epsg(4326).unwrap()), [""; 0]);
        assert!(doubts(&keys).is_empty());
        // Without an ellipsoid, nobody can tell.
        let keys = records(&[[1024, 0, 1, 2], [2048, 0, 1, USER_DEFINED]], &[]);
        assert!(doubts(&keys)[0].contains("do not say its datum"));
    }

    #[test]
    fn mercators_projection_may_be_true_to_scale_at_a_parallel() {
        let method = [[3074, 0, 1, USER_DEFINED], [3075, 0, 1, 7], [3080, DOUBLES, 1, 0], [3078, DOUBLES, 1, 1]];
        let parallel = user_defined(&method, &[51.0, 42.0]);
        // Pulkovo 1942 / Caspian Sea Mercator has the same parallel.
        let known = from_epsg(3388).unwrap();
        assert!(parallel.differences(&known).iter().all(|what| !what.contains("scale")), "{parallel:?}");
        let both = [&method[..], &[[3092, DOUBLES, 1, 2]]].concat();
        let one = user_defined(&both, &[51.0, 42.0, 1.0]);
        assert!(one.form().is_some() && one.differences(&parallel).is_empty());
        assert!(user_defined(&both, &[51.0, 42.0, 0.5]).form().is_none());
        assert!(user_defined(&[method[0], method[1], method[2]], &[51.0]).differences(&parallel)[0].contains("scale"));
    }

    #[test]
    fn a_name_that_says_nothing_names_no_system() {
        for name in ["unknown", "unnamed", "Undefined", "My grid"] {
            let keys =
                [[1024, 0, 1, 1], [1026, TEXTS, name.len() as u16, 0], [3072, 0, 1, USER_DEFINED], [3076, 0, 1, 9001]];
            let mut keys = records(&keys, &[]);
            keys.texts = name.as_bytes().to_vec();
            assert_eq!(parse(&keys).unwrap().is_named(), name == "My grid", "{name}");
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

    #[test]
    fn projections_that_only_codes_and_methods_define_are_told_apart_by_their_keys() {
        let of_code = |code| user_defined(&[[3074, 0, 1, code]], &[]);
        assert!(of_code(10_131).same_as(&of_code(10_131)) && of_code(10_131).is_named());
        let found = of_code(10_131).differences(&of_code(10_132));
        assert_eq!(found, ["what defines the projection (GeoTIFF key 3074=10131, GeoTIFF key 3074=10132)"]);
        let utm = from_epsg(26915).unwrap();
        assert!(utm.differences(&of_code(10_131))[0].contains("does not say its projection"));
        // An oblique Mercator projection.
        let oblique = |doubles: &[f64]| {
            let keys = [[3088, DOUBLES, 1, 0], [3089, DOUBLES, 1, 1], [3094, DOUBLES, 1, 2]];
            let method = [[3074, 0, 1, USER_DEFINED], [3075, 0, 1, 3]];
            user_defined(&[&keys[..], &method[..]].concat(), doubles)
        };
        assert!(oblique(&[7.4, 46.9, 90.0]).same_as(&oblique(&[7.4, 46.9, 90.0])));
        let found = oblique(&[7.4, 46.9, 90.0]).differences(&oblique(&[1.4, 40.0, 50.0]));
        assert_eq!(found, ["what defines the projection (GeoTIFF key 3088=7.4, GeoTIFF key 3088=1.4)"]);
        // The name of both is the citation.
        let cited = |code| user_defined(&[[3074, 0, 1, code], [3073, TEXTS, 8, 0]], &[]);
        assert!(!cited(10_131).same_as(&cited(10_132)));
        // Some writers leave out the key of the system.
        let keys = [[1024, 0, 1, 1], [3074, 0, 1, 10_131], [3076, 0, 1, 9001]];
        assert!(!parse(&records(&keys, &[])).unwrap().same_as(&of_code(10_132)));
    }

    #[test]
    fn keys_that_are_not_known_are_a_doubt() {
        let doubts = |keys: &[[u16; 4]]| {
            let base = [[1024, 0, 1, 1], [2048, 0, 1, 4269], [3076, 0, 1, 9001]];
            doubts(&records(&[&base[..], keys].concat(), &[-93.0, 0.0, 500_000.0, 0.9996])).concat()
        };
        assert!(
            doubts(&[[3072, 0, 1, USER_DEFINED], [3074, 0, 1, 10_131]])
                .contains("key 3074, its projection, has the code 10131")
        );
        let method = [[3072, 0, 1, USER_DEFINED], [3074, 0, 1, USER_DEFINED], [3075, 0, 1, 3]];
        assert!(doubts(&method).contains("key 3075, the method of its projection, has the code 3"));
        let angles = [&[[3072, 0, 1, USER_DEFINED], [2054, 0, 1, 9103]], &PARAMETERS[..]].concat();
        assert!(doubts(&angles).contains("key 2054, the unit of its angles, has the code 9103"));
        assert!(doubts(&[[3072, 0, 1, 50_001]]).contains("EPSG:50001 is not in the list of known codes"));
        assert_eq!(doubts(&[[3072, 0, 1, 26915]]), "");
    }

    #[test]
    fn angles_count_in_their_own_unit() {
        let utm = from_epsg(26915).unwrap();
        let keys = |unit: u16| [&[[2054, 0, 1, unit]], &PARAMETERS[..]].concat();
        let grads = user_defined(&keys(9105), &[-93.0 / 0.9, 0.0, 500_000.0, 0.9996]);
        assert_eq!(grads.differences(&utm), [""; 0]);
        let radians = user_defined(&keys(9101), &[-93f64.to_radians(), 0.0, 500_000.0, 0.9996]);
        assert_eq!(radians.differences(&utm), [""; 0]);
        let west = user_defined(&keys(9105), &[-93.0, 0.0, 500_000.0, 0.9996]);
        assert!(west.differences(&utm)[0].contains("the longitude of the origin"));
        // The geographic system is in grads, the keys are in degrees.
        let paris = user_defined(&[&[[2048, 0, 1, 4807]], &PARAMETERS[..]].concat(), &[-93.0, 0.0, 500_000.0, 0.9996]);
        assert!(paris.differences(&utm).iter().all(|what| !what.contains("longitude of the origin")), "{paris:?}");
    }

    #[test]
    fn the_citations_of_esri_are_read() {
        let cited = |key: u16, text: &str, geographic: u16| {
            let keys =
                [&[[2048, 0, 1, geographic], [key, TEXTS, text.len() as u16, 0], [2056, 0, 1, 7019]], &PARAMETERS[..]];
            let mut all = vec![[1024, 0, 1, 1], [3072, 0, 1, USER_DEFINED], [3076, 0, 1, 9001]];
            all.extend(keys.concat());
            let mut keys = records(&all, &[-93.0, 0.0, 500_000.0, 0.9996]);
            keys.texts = text.as_bytes().to_vec();
            parse(&keys).unwrap()
        };
        let own = from_epsg(6344).unwrap();
        let parts = "GCS Name = GCS_NAD_1983_2011|Datum = D_NAD_1983_2011|Ellipsoid = GRS_1980|Primem = Greenwich||";
        let read = cited(2049, parts, USER_DEFINED);
        assert_eq!(read.differences(&own), [""; 0]);
        assert!(read.differences(&from_epsg(26915).unwrap())[0].contains("GCS_NAD_1983_2011, NAD83"));
        let text = r#"ESRI PE String = PROJCS["NAD_1983_2011_UTM_Zone_15N",GEOGCS["GCS_NAD_1983_2011",DATUM["D_NAD_1983_2011",
            SPHEROID["GRS_1980",6378137.0,298.257222101]],PRIMEM["Greenwich",0.0],UNIT["Degree",0.0174532925199433]],
            PROJECTION["Transverse_Mercator"],PARAMETER["False_Easting",500000.0],PARAMETER["False_Northing",0.0],
            PARAMETER["Central_Meridian",-93.0],PARAMETER["Scale_Factor",0.9996],PARAMETER["Latitude_Of_Origin",0.0],
            UNIT["Meter",1.0]]|"#;
        let read = cited(3073, text, 4269);
        assert_eq!((read.differences(&own), read.name.as_deref()), (vec![], Some("NAD_1983_2011_UTM_Zone_15N")));
        assert_eq!(cited(3073, "PCS Name = My_UTM|", 6318).name.as_deref(), Some("My_UTM"));
        // The code of the datum, without that of the system.
        let keys = [
            [1024, 0, 1, 1],
            [2048, 0, 1, USER_DEFINED],
            [2050, 0, 1, 1116],
            [3072, 0, 1, USER_DEFINED],
            [3074, 0, 1, 16015],
            [3076, 0, 1, 9001],
        ];
        assert_eq!(parse(&records(&keys, &[])).unwrap().differences(&own), [""; 0]);
    }
}
