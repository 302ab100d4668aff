//! Published values of projections (EPSG Guidance Note 7-2), and the way there and back.

use super::between::{CrsTransform, DatumNote};
use super::datum_rule::DatumRule;
use crate::from_wkt::{from_epsg, parse};
use crate::system::Crs;

fn way(from: &Crs, to: &Crs) -> CrsTransform {
    CrsTransform::between(from, to, DatumRule::Strict).unwrap()
}

fn epsg(code: u32) -> Crs {
    from_epsg(code).unwrap()
}

/// Degrees, minutes and seconds.
fn angle(degrees: f64, minutes: f64, seconds: f64) -> f64 {
    degrees.signum() * (degrees.abs() + minutes / 60.0 + seconds / 3600.0)
}

#[test]
fn published_values_are_met_and_found_again() {
    let examples = [
        // Transverse Mercator: the British grid. The note has 577274.99 and 69740.50, by a series of a lower order.
        (4277, 27700, [0.5, 50.5], [577_274.984, 69_740.492]),
        // Lambert's cone with one parallel (Jamaica), and with two (Texas, in US survey feet).
        (4242, 24200, [angle(-76.0, 56.0, 37.26), angle(17.0, 55.0, 55.80)], [255_966.58, 142_493.51]),
        (4267, 32040, [-96.0, 28.5], [2_963_503.91, 254_759.80]),
        // Mercator: variants A (Makassar) and B (Caspian Sea), and that of web maps.
        (4257, 3002, [120.0, -3.0], [5_009_726.58, 569_150.82]),
        (4284, 3388, [53.0, 53.0], [165_704.29, 5_171_848.07]),
        (4326, 3857, [angle(-100.0, 20.0, 0.0), angle(24.0, 22.0, 54.433)], [-11_169_055.58, 2_800_000.00]),
        // Albers (the Great Lakes), and Lambert's azimuthal projection (Europe).
        (4269, 3174, [-78.75, 42.75], [1_466_493.492, 702_903.006]),
        (4258, 3035, [5.0, 50.0], [3_962_799.45, 2_999_718.85]),
        // Polar stereographic: variants A (north) and B (Antarctica).
        (4326, 32661, [44.0, 73.0], [3_320_416.75, 632_668.43]),
        (4326, 3032, [120.0, -75.0], [7_255_380.79, 7_053_389.56]),
        // Oblique stereographic: the Netherlands.
        (4289, 28992, [6.0, 53.0], [196_105.283, 557_057.739]),
        // Hotine's oblique Mercator, variant B: Borneo.
        (4298, 29873, [angle(115.0, 48.0, 19.8196), angle(5.0, 23.0, 14.1129)], [679_245.73, 596_562.78]),
        // Krovak. The note has southings and westings, and 1050538.643 by constants with fewer digits.
        (4156, 5514, [angle(16.0, 50.0, 59.179), angle(50.0, 12.0, 32.442)], [-568_990.995, -1_050_538.631]),
        // Cassini and Soldner: Trinidad, in links.
        (4302, 30200, [-62.0, 10.0], [66_644.94, 82_536.22]),
        // Transverse Mercator with westings and southings: South Africa. The note has 71984.49, for seconds with more digits.
        (4148, 2053, [angle(28.0, 16.0, 57.479), angle(-25.0, 43.0, 55.302)], [71_984.480, 2_847_342.735]),
    ];
    for (base, code, place, expected) in examples {
        let (base, map) = (epsg(base), epsg(code));
        let found = way(&base, &map).apply(place).unwrap();
        let off = (found[0] - expected[0]).abs().max((found[1] - expected[1]).abs());
        assert!(off < 0.0051, "EPSG:{code}: {found:?}, published {expected:?}");
        let again = way(&map, &base).apply(found).unwrap();
        let off = (again[0] - place[0]).abs().max((again[1] - place[1]).abs());
        assert!(off < 1e-13 * 180.0, "EPSG:{code}: {again:?} {place:?}");
    }
}

#[test]
fn snyders_examples_are_met() {
    // "Map Projections: A Working Manual", pages 282 and 304, on the ellipsoid of Clarke.
    let base = epsg(4267);
    let map = |projection: &str| {
        let text = base.wkt.clone().unwrap();
        parse(&format!(r#"PROJCS["s",{text},PROJECTION{projection},UNIT["metre",1]]"#)).unwrap()
    };
    let cylinder =
        map(r#"["Cylindrical_Equal_Area"],PARAMETER["standard_parallel_1",5],PARAMETER["central_meridian",-75]"#);
    let cones = map(r#"["Polyconic"],PARAMETER["latitude_of_origin",30],PARAMETER["central_meridian",-96]"#);
    for (map, place, expected) in
        [(cylinder, [-78.0, 5.0], [-332_699.8, 554_248.5]), (cones, [-75.0, 40.0], [1_776_774.5, 1_319_657.8])]
    {
        let found = way(&base, &map).apply(place).unwrap();
        let off = (found[0] - expected[0]).abs().max((found[1] - expected[1]).abs());
        assert!(off < 0.051, "{found:?}, published {expected:?}");
    }
}

#[test]
fn places_are_found_again_all_over_the_area_of_a_projection() {
    for (base, code, west, south, east, north) in [
        (4326, 32633, -15.0, -80.0, 45.0, 84.0),
        (4326, 32733, 9.0, -80.0, 21.0, 0.0),
        (4171, 2154, -10.0, 40.0, 15.0, 52.0),
        (4269, 5070, -130.0, 20.0, -60.0, 55.0),
        (4283, 3112, 110.0, -45.0, 155.0, -10.0),
        (4326, 3395, -180.0, -80.0, 180.0, 84.0),
        (4326, 3857, -180.0, -85.0, 180.0, 85.0),
        (4326, 3413, -180.0, 60.0, 180.0, 89.9999),
        (4326, 3031, -180.0, -89.9999, 180.0, -60.0),
        (4289, 28992, 2.0, 49.0, 9.0, 55.0),
        (4258, 3035, -30.0, 25.0, 60.0, 80.0),
        (4326, 6933, -180.0, -85.0, 180.0, 85.0),
        (4150, 2056, -10.0, 30.0, 25.0, 60.0),
        (4237, 23700, 10.0, 40.0, 30.0, 55.0),
        (4156, 5514, -10.0, 30.0, 60.0, 70.0),
        (4742, 3375, 90.0, -20.0, 115.0, 25.0),
        (4298, 29873, 100.0, -20.0, 130.0, 25.0),
        (4269, 26931, -150.0, 45.0, -120.0, 65.0),
        (4314, 3068, 0.0, 45.0, 27.0, 60.0),
        (4302, 30200, -71.0, -5.0, -52.0, 20.0),
        (4674, 5880, -83.0, -40.0, -25.0, 40.0),
        (4148, 2053, 19.0, -45.0, 39.0, 10.0),
    ] {
        let (base, map) = (epsg(base), epsg(code));
        let (there, back) = (way(&base, &map), way(&map, &base));
        for i in 0..=30 * 30 {
            let place =
                [west + (east - west) * f64::from(i % 31) / 30.0, south + (north - south) * f64::from(i / 31) / 30.0];
            let on_map = there.apply(place).unwrap();
            let again = back.apply(on_map).unwrap();
            let metres = [0, 1].map(|axis| {
                let turn = if axis == 0 {
                    ((again[0] - place[0] + 540.0) % 360.0 - 180.0).abs()
                } else {
                    (again[1] - place[1]).abs()
                };
                turn * 111_320.0 * if axis == 0 { libm::cos(place[1] * 0.017_453) } else { 1.0 }
            });
            assert!(metres[0].max(metres[1]) < 1e-6, "EPSG:{code}: {place:?} {on_map:?} {again:?}");
        }
    }
}

#[test]
fn units_meridians_and_whole_turns_count() {
    // The same cone in metres and in US survey feet.
    let (metres, feet) = (epsg(32139), epsg(2277));
    let [x, y] = way(&metres, &feet).apply([700_000.0, 3_000_000.0]).unwrap();
    let foot = 1200.0 / 3937.0;
    // The code in feet has its false easting to a thousandth of one.
    assert!((x * foot - 700_000.0).abs() < 2e-4 && (y * foot - 3_000_000.0).abs() < 2e-4, "{x} {y}");
    // Grads from Paris.
    let paris = epsg(4807);
    let zone = epsg(27572);
    let [x, y] = way(&paris, &zone).apply([0.0, 52.0]).unwrap();
    assert!((x - 600_000.0).abs() < 1e-6 && (y - 2_200_000.0).abs() < 0.1, "{x} {y}");
    let there = way(&epsg(4326), &epsg(32615));
    assert_eq!(there.apply([267.0, 45.0]), there.apply([-93.0, 45.0]));
}

#[test]
fn the_words_for_proj4_mean_the_same_place() {
    use proj4rs::{Proj, transform::transform};
    let degrees = Proj::from_proj_string("+proj=longlat +datum=WGS84 +no_defs").unwrap();
    for (code, place) in [
        (32615, [-93.1, 45.0]),
        (3395, [12.0, 48.0]),
        (3413, [-50.0, 72.0]),
        (3031, [120.0, -75.0]),
        (32661, [44.0, 83.0]),
        (3994, [-170.0, -40.0]),
    ] {
        let map = Crs { epsg: None, ..epsg(code) };
        let own = Proj::from_proj_string(&map.proj4_definition().unwrap()).unwrap();
        let [x, y] = way(&epsg(4326), &map).apply(place).unwrap();
        let mut found = (x, y, 0.0);
        transform(&own, &degrees, &mut found).unwrap();
        let off = (found.0.to_degrees() - place[0]).abs().max((found.1.to_degrees() - place[1]).abs());
        assert!(off < 1e-8, "EPSG:{code}: {found:?} {place:?}");
    }
}

#[test]
fn what_a_projection_does_not_show_is_no_place() {
    let utm = way(&epsg(4326), &epsg(32615));
    for place in [[-33.0, 10.0], [87.0, 0.0], [-93.0, 90.5], [600.0, 0.0], [f64::NAN, 0.0], [f64::INFINITY, 0.0]] {
        assert_eq!(utm.apply(place), None, "{place:?}");
    }
    let back = way(&epsg(32615), &epsg(4326));
    for place in [[1e9, 0.0], [f64::NAN, 4e6], [5e5, 1e300], [-2e7, 0.0]] {
        assert_eq!(back.apply(place), None, "{place:?}");
    }
    assert_eq!(way(&epsg(4326), &epsg(3031)).apply([0.0, 10.0]), None);
    assert_eq!(way(&epsg(4326), &epsg(3395)).apply([0.0, 90.0]), None);
    // Beyond the pole of the other side there is nothing on a cone.
    assert_eq!(way(&epsg(4171), &epsg(2154)).apply([3.0, -90.0]), None);
}

#[test]
fn shifts_are_refused_by_name() {
    let between = |from: u32, to: u32, rule| CrsTransform::between(&epsg(from), &epsg(to), rule);
    let refused = between(26715, 26915, DatumRule::Close).unwrap_err();
    assert!(refused.contains("us_noaa_conus.tif") && refused.contains("NAD27"), "{refused}");
    assert!(between(27700, 32630, DatumRule::Close).unwrap_err().contains("OSTN15"));
    let strict = between(26915, 32615, DatumRule::Strict).unwrap_err();
    assert!(strict.contains("datums = \"close\""), "{strict}");
    let close = between(26915, 32615, DatumRule::Close).unwrap();
    assert_eq!(close.datums(), &DatumNote::TakenAlike("NAD83 and WGS 84".into()));
    assert_eq!(between(26915, 26916, DatumRule::Strict).unwrap().datums(), &DatumNote::Same);
}

#[test]
fn projections_that_are_not_computed_are_refused_by_name() {
    let refused =
        |code: u32, base: u32| CrsTransform::between(&epsg(base), &epsg(code), DatumRule::Strict).unwrap_err();
    assert!(refused(27200, 4272).contains("New_Zealand_Map_Grid"), "{}", refused(27200, 4272));
    // Southings and westings, in this order, and formulas of a sphere.
    assert!(refused(5513, 4156).contains("its x grows to the west"), "{}", refused(5513, 4156));
    assert!(refused(3975, 4326).contains("Cylindrical_Equal_Area"), "{}", refused(3975, 4326));
    assert!(refused(4978, 4326).contains("neither a map"));
    let oblique = r#"PROJCS["o",GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],PRIMEM["Greenwich",0],
        UNIT["degree",0.0174532925199433]],PROJECTION["Stereographic"],PARAMETER["latitude_of_origin",45],
        PARAMETER["central_meridian",9],PARAMETER["scale_factor",1],UNIT["metre",1]]"#;
    let oblique = parse(oblique).unwrap();
    let refused = CrsTransform::between(&oblique, &epsg(4326), DatumRule::Strict).unwrap_err();
    assert!(refused.contains("Stereographic"), "{refused}");
}

#[test]
fn no_parameter_and_no_place_leads_to_infinity() {
    const METHODS: [&str; 15] = [
        "Transverse_Mercator",
        "Lambert_Conformal_Conic_1SP",
        "Lambert_Conformal_Conic_2SP",
        "Mercator_1SP",
        "Mercator_2SP",
        "Albers_Conic_Equal_Area",
        "Lambert_Azimuthal_Equal_Area",
        "Polar_Stereographic",
        "Oblique_Stereographic",
        "Hotine_Oblique_Mercator",
        "Hotine_Oblique_Mercator_Azimuth_Center",
        "Krovak",
        "Cassini_Soldner",
        "Polyconic",
        "Cylindrical_Equal_Area",
    ];
    const ODD: [f64; 9] = [0.0, 45.0, 90.0, -90.0, 1e-300, 1e300, -1e300, 1e6, 359.999];
    let earth = epsg(4326);
    let mut made = 0;
    for (method, odd) in METHODS.iter().flat_map(|method| ODD.map(|odd| (method, odd))) {
        for (latitude, scale) in [(odd, 1.0), (40.0, odd)] {
            let has_parallels = method.contains("2SP") || method.starts_with("Albers");
            let parallels =
                format!(r#"PARAMETER["standard_parallel_1",{latitude}],PARAMETER["standard_parallel_2",{odd}],"#);
            const UNSCALED: [&str; 4] =
                ["Lambert_Azimuthal_Equal_Area", "Cassini_Soldner", "Polyconic", "Cylindrical_Equal_Area"];
            let has_scale = !has_parallels && !UNSCALED.contains(method);
            let line = format!(r#"PARAMETER["azimuth",{odd}],"#);
            let of_line = if method.starts_with("Hotine") { line.as_str() } else { "" };
            let parallels = if has_parallels { parallels.as_str() } else { of_line };
            let text = format!(
                r#"PROJCS["odd",GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],PRIMEM["Greenwich",0],
                UNIT["degree",0.0174532925199433]],PROJECTION["{method}"],PARAMETER["latitude_of_origin",{}],
                PARAMETER["central_meridian",{odd}],{parallels}PARAMETER["scale_factor",{}],PARAMETER["false_easting",{}],
                UNIT["metre",1]]"#,
                if method.starts_with("Mercator") || method.starts_with("Cyl") { 0.0 } else { latitude },
                if has_scale { scale } else { 1.0 },
                if *method == "Krovak" { 0.0 } else { odd },
            );
            let Ok(there) = CrsTransform::between(&earth, &parse(&text).unwrap(), DatumRule::Strict) else { continue };
            let back = CrsTransform::between(&parse(&text).unwrap(), &earth, DatumRule::Strict).unwrap();
            made += 1;
            for place in ODD.iter().flat_map(|x| ODD.map(|y| [*x, y])) {
                let found = [there.apply(place), back.apply(place), back.apply(place.map(|value| value * 1e4))];
                assert!(found.iter().flatten().flatten().all(|value| value.is_finite()), "{text} {place:?} {found:?}");
            }
        }
    }
    assert!(made > 30, "{made}");
}
