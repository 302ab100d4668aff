//! Systems that a careless reader would take for others, far from where they are.

use super::between::{CrsTransform, DatumNote};
use super::datum_rule::DatumRule;
use super::utm::utm_zone;
use crate::datum::Sameness;
use crate::from_wkt::{from_epsg, parse};
use crate::proj4;
use crate::system::Crs;

const WGS84: &str = r#"GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],PRIMEM["Greenwich",0],
    UNIT["degree",0.0174532925199433]]"#;

fn map(name: &str, base: &str, projection: &str, rest: &str) -> Crs {
    parse(&format!(r#"PROJCS["{name}",{base},{projection}UNIT["metre",1]{rest}]"#)).unwrap()
}

fn mercator(projection: &str, rest: &str) -> Crs {
    map("m", WGS84, &format!(r#"PROJECTION{projection},PARAMETER["central_meridian",9],"#), rest)
}

/// UTM zone 33N on another base, with other axes.
fn zone(name: &str, base: &str, rest: &str) -> Crs {
    let projection = r#"PROJECTION["Transverse_Mercator"],PARAMETER["latitude_of_origin",0],PARAMETER["central_meridian",15],
        PARAMETER["scale_factor",0.9996],PARAMETER["false_easting",500000],PARAMETER["false_northing",0],"#;
    map(name, base, projection, rest)
}

/// A base whose datum has no name, with this shift.
fn nameless(shift: &str) -> String {
    format!(
        r#"GEOGCS["unknown",DATUM["unknown",SPHEROID["WGS 84",6378137,298.257223563]{shift}],PRIMEM["Greenwich",0],
        UNIT["degree",0.0174532925199433]]"#
    )
}

const SHIFT: &str = ",TOWGS84[-199.87,74.79,246.62,0,0,0,0]";

fn refused(from: &Crs, to: &Crs) -> String {
    CrsTransform::between(from, to, DatumRule::Close).unwrap_err()
}

fn is_refuted(sameness: Sameness) -> bool {
    matches!(sameness, Sameness::Refuted(_))
}

#[test]
fn a_system_that_says_nothing_is_not_known_to_be_another() {
    let target = from_epsg(32633).unwrap();
    let unread = r#"PROJECTION["Transverse_Mercator"],PARAMETER["central_meridian",15],"#;
    for (name, projection) in [("unnamed", ""), ("", ""), ("unknown", unread)] {
        let crs = map(name, WGS84, projection, "");
        assert!(crs.differences(&target).is_empty() && is_refuted(crs.sameness(&target)), "{name} {projection}");
        assert!(refused(&crs, &target).contains("has no readable projection"), "{name} {projection}");
    }
    assert!(is_refuted(Crs::default().sameness(&target)));
    assert_eq!(target.sameness(&from_epsg(32633).unwrap()), Sameness::Known);
    assert_eq!(zone("any name", WGS84, "").sameness(&target), Sameness::Known);
    assert!(is_refuted(from_epsg(32632).unwrap().sameness(&target)));
    // An equal code or name says enough.
    let coded = |code| Crs { epsg: Some(code), ..Crs::default() };
    assert_eq!(coded(65_001).sameness(&coded(65_001)), Sameness::Known);
    let named = |name: &str| Crs { name: Some(name.into()), ..Crs::default() };
    assert_eq!(named("WGS 84 / UTM zone 33N").sameness(&target), Sameness::Known);
    assert!(is_refuted(named("unnamed").sameness(&named("unnamed"))));
    assert!(refused(&coded(65_001), &target).contains("EPSG:65001 is not in the list"));
    // Without a datum it may be on any, where the projection is the same.
    let without = zone("x", WGS84, "").wkt.unwrap().replace(&format!("{WGS84},"), "");
    assert_eq!(parse(&without).unwrap().sameness(&target), Sameness::Assumed);
}

#[test]
fn a_datum_without_a_name_is_assumed_unless_a_shift_speaks_against_it() {
    let target = from_epsg(32633).unwrap();
    let plain = zone("unknown", &nameless(""), "");
    assert_eq!(plain.sameness(&target), Sameness::Assumed);
    assert!(is_refuted(zone("unknown", &nameless(SHIFT), "").sameness(&target)));
    let other_zone = from_epsg(32632).unwrap();
    let way = CrsTransform::between(&plain, &other_zone, DatumRule::Strict).unwrap();
    assert_eq!(way.datums(), &DatumNote::Assumed("an unnamed datum and WGS 84".into()));
    assert!(refused(&zone("unknown", &nameless(SHIFT), ""), &other_zone).contains("the shift of the datum"));
    // "utm" takes it for WGS 84, not for the first datum with such an ellipsoid.
    let utm = |shift: &str| utm_zone(&zone("unknown", &nameless(shift), ""), [15.0, 48.0], DatumRule::Strict);
    assert_eq!(utm("").unwrap().epsg, Some(32633));
    assert!(utm(SHIFT).unwrap_err().contains("no code for UTM zone 33N"));
}

#[test]
fn mercators_parallel_is_never_dropped() {
    let [parallel, both, plain] = [
        r#"["Mercator_2SP"],PARAMETER["standard_parallel_1",42]"#,
        r#"["Mercator_2SP"],PARAMETER["standard_parallel_1",42],PARAMETER["scale_factor",1]"#,
        r#"["Mercator_1SP"],PARAMETER["scale_factor",1]"#,
    ]
    .map(|projection| mercator(projection, ""));
    assert_eq!(both.differences(&parallel), [""; 0]);
    assert!(both.differences(&plain)[0].contains("scale factor"));
    let odd = r#"["Mercator_2SP"],PARAMETER["standard_parallel_1",42],PARAMETER["scale_factor",0.5]"#;
    assert!(mercator(odd, "").problems()[0].contains("contradict each other"));
}

#[test]
fn what_web_mercator_does_not_have_is_not_dropped() {
    let wgs84 = from_epsg(4326).unwrap();
    let sphere = |more: &str| {
        mercator(
            &format!(
                r#"["Mercator_Auxiliary_Sphere"],PARAMETER["Standard_Parallel_1",0],{more}PARAMETER["Auxiliary_Sphere_Type",0]"#
            ),
            "",
        )
    };
    assert!(CrsTransform::between(&sphere(""), &wgs84, DatumRule::Strict).is_ok());
    for odd in [
        r#"["Mercator_Auxiliary_Sphere"],PARAMETER["Auxiliary_Sphere_Type",2]"#,
        r#"["Mercator_Auxiliary_Sphere"],PARAMETER["Standard_Parallel_1",40]"#,
    ] {
        assert!(refused(&mercator(odd, ""), &wgs84).contains("is unknown"), "{odd}");
    }
    let extended = |words: &str| {
        let extension = format!(
            r#",EXTENSION["PROJ4","+proj=merc +a=6378137 +b=6378137 {words} +units=m +nadgrids=@null +no_defs"]"#
        );
        mercator(r#"["Mercator_1SP"],PARAMETER["scale_factor",1]"#, &extension)
    };
    let web = extended("+lat_ts=0.0 +lon_0=9 +x_0=0.0 +y_0=0 +k=1.0");
    assert!(CrsTransform::between(&web, &wgs84, DatumRule::Strict).unwrap().apply([0.0, 0.0]).is_some());
    assert!(extended("+lat_ts=0 +k=0.5").problems()[0].contains("is an unknown projection"));
    assert!(from_epsg(3857).unwrap().problems().is_empty());
}

#[test]
fn axes_count_in_the_direction_that_they_have() {
    let wgs84 = from_epsg(4326).unwrap();
    let axes = |x: &str, y: &str| zone("z", WGS84, &format!(r#",AXIS["x",{x}],AXIS["y",{y}]"#));
    for (x, y) in [("EAST", "SOUTH"), ("WEST", "NORTH"), ("SOUTH", "WEST"), ("SOUTH", "EAST")] {
        assert!(refused(&axes(x, y), &wgs84).contains("to the south"), "{x} {y}");
        assert!(axes(x, y).differences(&axes("EAST", "NORTH"))[0].contains("direction"), "{x} {y}");
        assert_eq!(axes(x, y).proj4_definition(), None);
    }
    for (x, y) in [("EAST", "NORTH"), ("NORTH", "EAST")] {
        assert!(CrsTransform::between(&axes(x, y), &wgs84, DatumRule::Strict).is_ok(), "{x} {y}");
    }
    // Around a pole, both may go south.
    assert!(CrsTransform::between(&from_epsg(3413).unwrap(), &wgs84, DatumRule::Strict).is_ok());
}

#[test]
fn spherical_formulas_on_an_ellipsoid_and_two_scales_are_refused() {
    for (code, base) in [(3973, 4326), (3974, 4326), (9311, 4267)] {
        let [crs, base] = [code, base].map(|code| from_epsg(code).unwrap());
        assert!(refused(&crs, &base).contains("gdt-batch does not support"), "EPSG:{code}");
        assert_eq!(proj4::definition(Some(code), crs.wkt.as_deref()), None);
    }
    let cone = |scale: &str, second: u32| {
        let text = format!(
            r#"PROJECTION["Lambert_Conformal_Conic_2SP"],PARAMETER["latitude_of_origin",46.5],PARAMETER["central_meridian",3],
            PARAMETER["standard_parallel_1",49],PARAMETER["standard_parallel_2",{second}],{scale}"#
        );
        map("cone", WGS84, &text, "")
    };
    let half = r#"PARAMETER["scale_factor",0.5],"#;
    let wgs84 = from_epsg(4326).unwrap();
    assert!(refused(&cone(half, 44), &wgs84).contains("two standard parallels and also the scale factor 0.5"));
    for fine in [cone("", 44), cone(r#"PARAMETER["scale_factor",1],"#, 44), cone(half, 49)] {
        assert!(CrsTransform::between(&fine, &wgs84, DatumRule::Strict).is_ok(), "{fine:?}");
    }
}

#[test]
fn what_an_earthquake_moved_is_not_one() {
    let [before, after] = [4612, 6668].map(|code| from_epsg(code).unwrap());
    assert!(refused(&before, &after).contains("touhoku"));
    let close = CrsTransform::between(&from_epsg(4674).unwrap(), &from_epsg(4326).unwrap(), DatumRule::Close).unwrap();
    assert!(matches!(close.datums(), DatumNote::TakenAlike(_)));
}
