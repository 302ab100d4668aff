//! What GeoTIFF keys say.

use crate::from_wkt::from_epsg;
use crate::geokeys::{DOUBLES, TEXTS};
use crate::geokeys::{GeoKeys, USER_DEFINED};
use crate::geotiff::{parse, problems};
use crate::system::{Crs, CrsKind};
use crate::unit::Unit;

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
    let crs =
        parse(&records(&[[1024, 0, 1, 1], [3072, 0, 1, 32104], [3076, 0, 1, 9003], [4099, 0, 1, 9003]], &[])).unwrap();
    assert_eq!((crs.horizontal, crs.vertical), (Unit::UsFoot, Some(Unit::US_FOOT)));
    assert_eq!(crs.wkt, None);
    let told =
        |unit: u16| problems(&records(&[[1024, 0, 1, 1], [3072, 0, 1, 32104], [3076, 0, 1, unit]], &[])).concat();
    assert!(told(9003).contains("is US survey foot, but EPSG:32104 has metre"), "{}", told(9003));
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
    let mut keys: Vec<[u16; 4]> =
        vec![[1024, 0, 1, 1], [2048, 0, 1, 4269], [3072, 0, 1, USER_DEFINED], [3074, 0, 1, 16015], [3076, 0, 1, 9001]];
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
    let problems = |changed: u16, entry: Option<[u16; 4]>| {
        let keys: Vec<[u16; 4]> = all.iter().filter(|key| key[0] != changed).copied().chain(entry).collect();
        let keys = records(&keys, &doubles);
        let (crs, problems) = (parse(&keys).unwrap(), problems(&keys));
        assert_eq!(crs.proj4_definition().is_some(), problems.is_empty(), "{changed}: {problems:?}");
        assert_eq!(crs.kind, CrsKind::Projected);
        problems.concat()
    };
    assert_eq!(problems(0, None), "");
    assert!(problems(3080, None).ends_with("it does not give the longitude of the origin"));
    assert!(problems(3081, None).ends_with("it does not give the latitude of the origin"));
    // GeoTIFF, like well-known text, has a value for these.
    for key in [3082, 3083, 3092] {
        assert_eq!(problems(key, None), "", "{key}");
    }
    for key in [3080, 3081, 3082, 3083, 3092, 2061] {
        for entry in [[key, DOUBLES, 1, 4], [key, DOUBLES, 1, 90], [key, 0, 1, 7]] {
            assert!(problems(key, Some(entry)).ends_with(&format!("key {key} has no number that can be read")));
        }
    }
    for entry in [[3076, 0, 1, 9999], [3076, 0, 1, USER_DEFINED]] {
        assert!(problems(3076, Some(entry)).contains("the unit of x and y"));
    }
}

#[test]
fn longitudes_in_another_angle_than_their_code_has_are_not_read() {
    for (code, unit) in [(4326, 9101), (4326, 9105), (4326, 9107), (4807, 9102), (32767, 9101)] {
        let keys = records(&[[1024, 0, 1, 2], [2048, 0, 1, code], [2054, 0, 1, unit], [2056, 0, 1, 7030]], &[]);
        let crs = parse(&keys).unwrap();
        assert!(crs.form().is_none() && crs.is_named() && crs.kind == CrsKind::Geographic, "{code} {unit}: {crs:?}");
        assert!(
            problems(&keys)[0].contains(&format!("key 2054, the unit of longitude and latitude, has the code {unit}"))
        );
    }
    for (code, unit) in [(4326, 9102), (4326, 9122), (4807, 9105)] {
        let keys = records(&[[1024, 0, 1, 2], [2048, 0, 1, code], [2054, 0, 1, unit]], &[]);
        assert!(parse(&keys).unwrap().form().is_some() && problems(&keys).is_empty(), "{code} {unit}");
    }
}

#[test]
fn longitude_and_latitude_may_be_defined_by_keys() {
    let keys =
        [[1024, 0, 1, 2], [2048, 0, 1, USER_DEFINED], [2049, TEXTS, 6, 0], [2054, 0, 1, 9102], [2056, 0, 1, 7030]];
    let mut keys = records(&keys, &[]);
    keys.texts = b"WGS 84|".to_vec();
    assert_eq!(parse(&keys).unwrap().differences(&from_epsg(4326).unwrap()), [""; 0]);
    assert!(problems(&keys).is_empty());
    // Without an ellipsoid, nobody can tell.
    let keys = records(&[[1024, 0, 1, 2], [2048, 0, 1, USER_DEFINED]], &[]);
    assert!(problems(&keys)[0].contains("do not define its datum"));
}

#[test]
fn mercators_projection_may_be_true_to_scale_at_a_parallel() {
    let method = [[3074, 0, 1, USER_DEFINED], [3075, 0, 1, 7], [3080, DOUBLES, 1, 0], [3078, DOUBLES, 1, 1]];
    let parallel = user_defined(&method, &[51.0, 42.0]);
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
    assert_eq!(found, ["the definition of the projection (GeoTIFF key 3074=10131, GeoTIFF key 3074=10132)"]);
    let utm = from_epsg(26915).unwrap();
    assert!(utm.differences(&of_code(10_131))[0].contains("has no readable projection"));
    // An oblique Mercator projection.
    let oblique = |doubles: &[f64]| {
        let keys = [[3088, DOUBLES, 1, 0], [3089, DOUBLES, 1, 1], [3094, DOUBLES, 1, 2]];
        let method = [[3074, 0, 1, USER_DEFINED], [3075, 0, 1, 3]];
        user_defined(&[&keys[..], &method[..]].concat(), doubles)
    };
    assert!(oblique(&[7.4, 46.9, 90.0]).same_as(&oblique(&[7.4, 46.9, 90.0])));
    let found = oblique(&[7.4, 46.9, 90.0]).differences(&oblique(&[1.4, 40.0, 50.0]));
    assert_eq!(found, ["the definition of the projection (GeoTIFF key 3088=7.4, GeoTIFF key 3088=1.4)"]);
    // The name of both is the citation.
    let cited = |code| user_defined(&[[3074, 0, 1, code], [3073, TEXTS, 8, 0]], &[]);
    assert!(!cited(10_131).same_as(&cited(10_132)));
    // Some writers leave out the key of the system.
    let keys = [[1024, 0, 1, 1], [3074, 0, 1, 10_131], [3076, 0, 1, 9001]];
    assert!(!parse(&records(&keys, &[])).unwrap().same_as(&of_code(10_132)));
}

#[test]
fn keys_that_are_not_known_are_a_doubt() {
    let problems = |keys: &[[u16; 4]]| {
        let base = [[1024, 0, 1, 1], [2048, 0, 1, 4269], [3076, 0, 1, 9001]];
        problems(&records(&[&base[..], keys].concat(), &[-93.0, 0.0, 500_000.0, 0.9996])).concat()
    };
    assert!(
        problems(&[[3072, 0, 1, USER_DEFINED], [3074, 0, 1, 10_131]])
            .contains("key 3074, its projection, has the code 10131")
    );
    let method = [[3072, 0, 1, USER_DEFINED], [3074, 0, 1, USER_DEFINED], [3075, 0, 1, 3]];
    assert!(problems(&method).contains("key 3075, the method of its projection, has the code 3"));
    let angles = [&[[3072, 0, 1, USER_DEFINED], [2054, 0, 1, 9103]], &PARAMETERS[..]].concat();
    assert!(problems(&angles).contains("key 2054, the unit of its angles, has the code 9103"));
    assert!(problems(&[[3072, 0, 1, 50_001]]).contains("EPSG:50001 is not in the list of known codes"));
    assert_eq!(problems(&[[3072, 0, 1, 26915]]), "");
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
