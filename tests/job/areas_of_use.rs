//! Points that lie far outside the area that their coordinate reference system is made for.

use std::fs;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use crate::coordinate_systems::{code, keys, move_to, text, warnings, write};
use crate::program::{Job, number};

/// Writes a table of rows around a place.
fn csv(folder: &TempDir, name: &str, [x, y]: [f64; 2], step: f64) -> PathBuf {
    let row = |i: usize| {
        let [across, along] = [i % 10, i / 10].map(|count| count as f64 * step);
        format!("{:.7},{:.7},{}\n", x + across, y + along, i % 3)
    };
    let path = folder.path().join(name);
    fs::write(&path, format!("x,y,z\n{}", (0..60).map(row).collect::<String>())).unwrap();
    path
}

/// Writes a LAS file in EPSG:25832 around a place.
fn las(folder: &TempDir, name: &str, [x, y]: [f64; 2]) -> PathBuf {
    let path = write(folder.path(), name, &[code(25832)]);
    move_to(&path, [x, y, 0.0]);
    path
}

const PLACE: [f64; 2] = [500_000.0, 5_500_000.0];
const EXCHANGED: [f64; 2] = [5_500_000.0, 500_000.0];

#[test]
fn exchanged_coordinates_are_refused_with_the_way_to_exchange_them() {
    let folder = tempfile::tempdir().unwrap();
    let table = csv(&folder, "table.csv", EXCHANGED, 7.0);
    let words = ["outside its area of use (longitude 6 to 12", "with x and y exchanged, they lie within it"];
    let job = |file: &Path, line: &str| Job::on(&[file]).with("input", line);
    for line in ["crs = \"EPSG:25832\"", "missing_crs = \"EPSG:25832\""] {
        let refused = job(&table, line).run();
        refused.refused(3, &["table.csv", "columns = [\"y\", \"x\", \"z\"]"]);
        refused.refused(3, &words);
        job(&table, line).run_with(&["check"]).refused(3, &words);
    }
    let file = las(&folder, "cloud.las", EXCHANGED);
    job(&file, "").run().refused(3, &["cloud.las", "around x 55000", words[1], "pdal translate"]);
    // What the message says, and the option for whoever insists.
    let cured = "crs = \"EPSG:25832\"\n[input.csv]\ncolumns = [\"y\", \"x\", \"z\"]";
    assert!(!warnings(&job(&table, cured).report()).contains("area of use"));
    let said = warnings(&job(&file, "outside_crs_area = \"warn\"").report());
    assert!(said.contains("cloud.las: in ETRS89 / UTM zone 32N (EPSG:25832), its points"), "{said}");
    assert!(!warnings(&job(&las(&folder, "right.las", PLACE), "").report()).contains("area of use"));
}

#[test]
fn small_countries_whose_exchanged_coordinates_lie_near_are_known_too() {
    let folder = tempfile::tempdir().unwrap();
    let [right, exchanged] = [("r.csv", [84_600.0, 447_000.0]), ("e.csv", [447_000.0, 84_600.0])]
        .map(|(name, place)| csv(&folder, name, place, 7.0));
    let job = |file: &Path| Job::on(&[file]).with("input", "crs = \"EPSG:28992\"");
    assert!(!warnings(&job(&right).report()).contains("area of use"));
    job(&exchanged).run().refused(3, &["Amersfoort / RD New", "exchanged"]);
}

#[test]
fn coordinates_of_another_country_and_of_a_plane_are_refused_with_their_cures() {
    let folder = tempfile::tempdir().unwrap();
    for (name, place, crs, word) in [
        ("dutch.csv", [84_600.0, 447_000.0], 25832, "[input] crs = \"EPSG:...\""),
        ("zone_4.csv", [4_500_000.0, 5_500_000.0], 31467, "[input] crs = \"EPSG:...\""),
        ("site.csv", [0.0, 0.0], 25832, "crs = \"none\""),
        ("degrees.csv", [9.0, 50.0], 25832, "crs = \"EPSG:4326\""),
        // Krovak's projection has another form than all others.
        ("south.csv", [700_000.0, 1_050_000.0], 5514, "S-JTSK"),
        ("feet.csv", [1_640_419.0, 18_044_619.0], 25832, "in the unit foot, they lie within it"),
        ("nowhere.csv", [30_000_000.0, 5_500_000.0], 25832, "are not on earth"),
    ] {
        let file = csv(&folder, name, place, if name == "degrees.csv" { 1e-4 } else { 7.0 });
        let job = Job::on(&[&file]).with("input", &format!("crs = \"EPSG:{crs}\""));
        job.run().refused(3, &[name, "area of use", word, "outside_crs_area = \"warn\""]);
    }
}

#[test]
fn surveys_beyond_the_area_are_taken_and_those_farther_out_with_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    // At 50 degrees north, about 3, 6 and 8.5 degrees of longitude east of zone 32.
    for (name, x, is_warned) in
        [("a.csv", 930_000.0, false), ("b.csv", 1_140_000.0, true), ("c.csv", 1_320_000.0, true)]
    {
        let file = csv(&folder, name, [x, 5_600_000.0], 7.0);
        let said = warnings(&Job::on(&[&file]).with("input", "crs = \"EPSG:25832\"").report());
        assert_eq!(said.contains("outside its area of use"), is_warned, "{name}: {said}");
    }
}

#[test]
fn the_points_decide_and_neither_headers_nor_stray_points() {
    let folder = tempfile::tempdir().unwrap();
    let empty_box = |path: &Path| {
        let mut bytes = fs::read(path).unwrap();
        bytes[179..227].fill(0);
        fs::write(path, bytes).unwrap();
    };
    let [right, exchanged] =
        [("right.las", PLACE), ("exchanged.las", EXCHANGED)].map(|(name, at)| las(&folder, name, at));
    [&right, &exchanged].into_iter().for_each(|file| empty_box(file));
    assert!(!warnings(&Job::on(&[&right]).report()).contains("area of use"));
    Job::on(&[&exchanged]).run().refused(3, &["exchanged.las", "with x and y exchanged"]);
    let stray = csv(&folder, "stray.csv", EXCHANGED, 7.0);
    let rows = fs::read_to_string(&stray).unwrap();
    fs::write(&stray, format!("{rows}500000,5500000,1\n0,0,0\n")).unwrap();
    Job::on(&[&stray]).with("input", "crs = \"EPSG:25832\"").run().refused(3, &["stray.csv", "with x and y exchanged"]);
}

#[test]
fn a_file_elsewhere_stops_the_job_even_if_bad_files_are_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let [right, exchanged] =
        [("right.las", PLACE), ("exchanged.las", EXCHANGED)].map(|(name, at)| las(&folder, name, at));
    let job = |line: &str| Job::on(&[&exchanged, &right]).with("input", line);
    for line in ["", "on_bad_file = \"skip\""] {
        job(line).run().refused(3, &["exchanged.las: in ETRS89"]);
    }
    // Bounds leave it out.
    job("bounds = [400000.0, 5000000.0, 600000.0, 6000000.0]").report();
}

#[test]
fn systems_without_a_code_have_the_area_of_their_datum_and_projection() {
    let folder = tempfile::tempdir().unwrap();
    let zone_32 = r#"PROJCS["ETRS_1989_UTM_Zone_32N",GEOGCS["GCS_ETRS_1989",DATUM["D_ETRS_1989",
        SPHEROID["GRS_1980",6378137.0,298.257222101]],PRIMEM["Greenwich",0.0],UNIT["Degree",0.0174532925199433]],
        PROJECTION["Transverse_Mercator"],PARAMETER["False_Easting",500000.0],PARAMETER["False_Northing",0.0],
        PARAMETER["Central_Meridian",9.0],PARAMETER["Scale_Factor",0.9996],PARAMETER["Latitude_Of_Origin",0.0],
        UNIT["Meter",1.0]]"#;
    let file = write(folder.path(), "esri.las", &[text(zone_32)]);
    move_to(&file, [EXCHANGED[0], EXCHANGED[1], 0.0]);
    Job::on(&[&file]).run().refused(3, &["in ETRS_1989_UTM_Zone_32N, its points", "with x and y exchanged"]);
    move_to(&file, [PLACE[0], PLACE[1], 0.0]);
    assert!(!warnings(&Job::on(&[&file]).report()).contains("area of use"));
}

#[test]
fn what_is_transformed_is_judged_by_both_systems() {
    let folder = tempfile::tempdir().unwrap();
    let degrees = keys(&[[1024, 0, 1, 2], [2048, 0, 1, 4258]]);
    let file = write(folder.path(), "swapped.las", &[degrees]);
    move_to(&file, [50.0, 9.0, 0.0]);
    let mut bytes = fs::read(&file).unwrap();
    for (at, value) in [(131, 1e-7), (139, 1e-7), (179, 50.1), (187, 49.9), (195, 9.1), (203, 8.9)] {
        bytes[at..at + 8].copy_from_slice(&f64::to_le_bytes(value));
    }
    fs::write(&file, bytes).unwrap();
    for to in ["utm", "EPSG:25832"] {
        let job = Job::on(&[&file]).with("input", &format!("to_crs = \"{to}\"\ndatums = \"close\""));
        job.run().refused(3, &["swapped.las: in ETRS89 (EPSG:4258)", "with x and y exchanged"]);
    }
    let table = csv(&folder, "table.csv", PLACE, 7.0);
    let far = "crs = \"EPSG:25832\"\nto_crs = \"EPSG:32615\"\ndatums = \"close\"";
    Job::on(&[&table]).with("input", far).run().refused(3, &["WGS 84 / UTM zone 15N", "[input] to_crs = "]);
}

/// The text of a map without a name, a code or a datum.
fn nameless(projection: &str, parameters: &[(&str, f64)]) -> String {
    let parameters: String = parameters.iter().map(|(name, value)| format!("PARAMETER[\"{name}\",{value}],")).collect();
    format!("PROJCS[\"unknown\",PROJECTION[\"{projection}\"],{parameters}UNIT[\"metre\",1]]")
}

#[test]
fn a_projection_without_name_code_and_datum_has_the_area_that_it_is_good_for() {
    let folder = tempfile::tempdir().unwrap();
    let cylinder = nameless(
        "Transverse_Mercator",
        &[
            ("latitude_of_origin", 0.0),
            ("central_meridian", 11.0),
            ("scale_factor", 0.9996),
            ("false_easting", 500_000.0),
            ("false_northing", 0.0),
        ],
    );
    let cone = nameless(
        "Lambert_Conformal_Conic_2SP",
        &[
            ("latitude_of_origin", 46.5),
            ("central_meridian", 3.0),
            ("standard_parallel_1", 49.0),
            ("standard_parallel_2", 44.0),
            ("false_easting", 700_000.0),
            ("false_northing", 6_600_000.0),
        ],
    );
    for (name, text, [x, y]) in [("c", &cylinder, PLACE), ("l", &cone, [652_000.0, 6_861_000.0])] {
        let job = |file: &Path| Job::on(&[file]).with("input", &format!("crs = '''{text}'''"));
        assert!(!warnings(&job(&csv(&folder, &format!("{name}r.csv"), [x, y], 7.0)).report()).contains("area of use"));
        let exchanged = csv(&folder, &format!("{name}e.csv"), [y, x], 7.0);
        job(&exchanged).run().refused(3, &["estimated from its projection", "with x and y exchanged"]);
    }
}

#[test]
fn the_mistake_that_explains_the_place_is_named() {
    let folder = tempfile::tempdir().unwrap();
    for (name, place, step, crs, word) in [
        ("prefix.csv", [32_500_000.0, 5_500_000.0], 7.0, 25832, "with 32000000 subtracted from x"),
        ("no_prefix.csv", [500_000.0, 5_400_000.0], 7.0, 31467, "with 3000000 added to x"),
        (
            "lv95.csv",
            [2_600_000.0, 1_200_000.0],
            7.0,
            21781,
            "with 2000000 subtracted from x and 1000000 subtracted from y",
        ),
        ("south.csv", [333_000.0, -3_740_000.0], 7.0, 7856, "with 10000000 added to y"),
        (
            "south_of_north.csv",
            [330_148.0, 7_395_154.0],
            7.0,
            31976,
            "[input] crs = \"EPSG:31982\" (SIRGAS 2000 / UTM zone 22S)",
        ),
        ("krovak.csv", [744_000.0, 1_041_000.0], 7.0, 5514, "with the sign of x and y changed"),
        ("km.csv", [500.0, 5_500.0], 0.007, 25832, "in the unit kilometre"),
        ("degrees.csv", [2.35, 48.85], 1e-4, 2154, "as longitude and latitude, they lie within it"),
        ("latitude.csv", [48.85, 2.35], 1e-4, 2154, "Latitude comes first: [input.csv] columns"),
    ] {
        let file = csv(&folder, name, place, step);
        let job = Job::on(&[&file]).with("input", &format!("crs = \"EPSG:{crs}\""));
        job.run().refused(3, &[name, "area of use", word]);
    }
    let path = folder.path().join("geocentric.csv");
    let row = |i: usize| format!("{},{},{}\n", 4_181_455 + i % 10 * 7, 850_749 + i / 10 * 9, 4_724_370 + i);
    fs::write(&path, format!("x,y,z\n{}", (0..60).map(row).collect::<String>())).unwrap();
    let words = ["they look geocentric", "pdal translate"];
    Job::on(&[&path]).with("input", "crs = \"EPSG:25832\"").run().refused(3, &words);
    let said = warnings(&Job::on(&[&path]).report());
    assert!(said.contains("geocentric.csv: its coordinates (around"), "{said}");
    assert!(!warnings(&Job::on(&[&path]).with("input", "crs = \"none\"").report()).contains("geocentric"));
}

#[test]
fn degrees_in_the_wrong_order_or_with_the_wrong_sign_are_named_where_the_target_is_missed() {
    let folder = tempfile::tempdir().unwrap();
    for (name, place, to, word) in [
        ("lat_lon.csv", [53.5, 9.9], "EPSG:25832", "with x and y exchanged, they lie within it"),
        ("sign.csv", [118.2, 34.0], "EPSG:26911", "with the sign of x changed, they lie within it"),
    ] {
        let file = csv(&folder, name, place, 1e-4);
        let lines = format!("crs = \"EPSG:4326\"\nto_crs = \"{to}\"\ndatums = \"close\"");
        Job::on(&[&file]).with("input", &lines).run().refused(3, &[name, "outside its area of use", word]);
    }
}

#[test]
fn longitudes_beyond_180_degrees_are_taken_without_whole_turns_and_with_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let job = |name: &str, x: f64| {
        let file = csv(&folder, name, [x, 34.0], 1e-4);
        Job::on(&[&file]).with("input", "crs = \"EPSG:4326\"\nto_crs = \"utm\"").report()
    };
    let (west, turned) = (job("west.csv", -118.2), job("turned.csv", 241.8));
    assert_eq!((&west["crs"], &west["points"]), (&turned["crs"], &turned["points"]));
    assert!(warnings(&turned).contains("lie beyond 180 degrees, and are taken as -118.2"), "{turned}");
    assert!(!warnings(&west).contains("beyond 180 degrees"), "{west}");
}

#[test]
fn a_far_row_does_not_choose_the_zone_and_the_bounds_against_it_are_those_of_the_target() {
    let folder = tempfile::tempdir().unwrap();
    for (place, far, zone) in [([11.5, 47.9], "0,0,0", "32N"), ([-121.5, 38.0], "121.5,38,0", "10N")] {
        let path = csv(&folder, "far.csv", place, 1e-4);
        let clean = fs::read_to_string(&path).unwrap();
        let at = clean.match_indices('\n').nth(3).unwrap().0;
        fs::write(&path, format!("{}\n{far}{}", &clean[..at], &clean[at..])).unwrap();
        let job =
            |line: &str| Job::on(&[&path]).with("input", &format!("crs = \"EPSG:4326\"\nto_crs = \"utm\"\n{line}"));
        let system = format!("WGS 84 / UTM zone {zone}");
        let refused = job("").run();
        refused.refused(3, &[&format!("line 5: \"{far}\" lies far from all other rows (in {system}")]);
        // The bounds of the message are a cure.
        let from = refused.err.find("bounds = [").unwrap();
        let bounds = &refused.err[from..=from + refused.err[from..].find(']').unwrap()];
        for (line, malformed) in [(bounds, 0), ("max_malformed_fraction = 0.1", 1)] {
            let report = job(line).report();
            assert!(report["crs"].as_str().unwrap().starts_with(&system), "{report}");
            assert_eq!((number(&report["points"]["kept"]), number(&report["points"]["malformed"])), (60, malformed));
        }
    }
}

#[test]
fn a_cure_brings_one_of_several_files_to_the_others() {
    let folder = tempfile::tempdir().unwrap();
    let others = [0.0, 200.0].map(|east| csv(&folder, &format!("{east}.csv"), [450_400.0 + east, 4_500_100.0], 7.0));
    for (name, place, step, words) in [
        (
            "scale.csv",
            [45_050.0, 450_010.0],
            0.7,
            "multiplied by 10, they lie beside those of the other files: the decimal point",
        ),
        ("exchanged.csv", [4_500_100.0, 450_500.0], 7.0, "with x and y exchanged, they lie within it"),
    ] {
        let file = csv(&folder, name, place, step);
        let job = |lines: &str| {
            Job::on(&[&others[0], &file, &others[1]]).with("input", &format!("crs = \"EPSG:32633\"\n{lines}"))
        };
        let words = [name, "outside its area of use", words];
        job("").run().refused(3, &words);
        job("").run_with(&["check"]).refused(3, &words);
    }
    // SingleProcess, x and y may be exchanged.
    let alone = csv(&folder, "alone.csv", [45_050.0, 450_010.0], 0.7);
    let said = Job::on(&[&alone]).with("input", "crs = \"EPSG:32633\"").run();
    assert!((said.out + &said.err).contains("with x and y exchanged"), "{}", said.err);
}

#[test]
fn exchanged_coordinates_that_lie_beside_the_zone_are_known_too() {
    let folder = tempfile::tempdir().unwrap();
    // Palermo and Bornholm in zone 32, as all of Italy and Denmark are.
    for (name, place, crs) in
        [("palermo.csv", [4_228_309.0, 882_459.0], 32632), ("bornholm.csv", [6_122_022.0, 876_443.0], 25832)]
    {
        let file = csv(&folder, name, place, 7.0);
        let refused = Job::on(&[&file]).with("input", &format!("crs = \"EPSG:{crs}\"")).run();
        refused.refused(3, &[name, "with x and y exchanged, they lie near it: [input.csv] columns"]);
    }
    let lecce = csv(&folder, "lecce.csv", [1_279_470.0, 4_507_360.0], 7.0);
    let said = warnings(&Job::on(&[&lecce]).with("input", "crs = \"EPSG:32632\"").report());
    assert!(said.contains("Nothing, if the CRS and the coordinates are right") && !said.contains("foot"), "{said}");
}

#[test]
fn a_site_s_own_grid_under_a_map_is_named_however_near_its_area_is() {
    let folder = tempfile::tempdir().unwrap();
    for (name, place, crs) in [
        ("site.csv", [10.0, 420.0], 32632),
        ("total.csv", [5_000.0, 2_000.0], 32617),
        ("centre.csv", [-9.0, -9.0], 3857),
    ] {
        let file = csv(&folder, name, place, 7.0);
        let said = warnings(&Job::on(&[&file]).with("input", &format!("crs = \"EPSG:{crs}\"")).report());
        assert!(said.contains("fix: [input] crs = "), "{name} {said}");
    }
    // Uganda beside its zone, at the equator.
    let right = csv(&folder, "right.csv", [140_000.0, 40_000.0], 7.0);
    let said = warnings(&Job::on(&[&right]).with("input", "crs = \"EPSG:32636\"").report());
    assert!(!said.contains("area of use"), "{said}");
}

#[test]
fn metres_under_a_map_in_feet_are_named_some_kilometres_outside_its_area() {
    let folder = tempfile::tempdir().unwrap();
    for (name, place, crs, unit) in [
        ("new_york.csv", [303_000.0, 62_000.0], 2263, Some("metre")),
        ("albany.csv", [200_000.0, 230_000.0], 2260, Some("metre")),
        // A survey across the border of its zone, and one of a map without a false origin.
        ("new_jersey.csv", [890_000.0, 200_000.0], 2263, None),
        ("shinshu.csv", [-159_807.0, -29_800.0], 6677, None),
    ] {
        let file = csv(&folder, name, place, 7.0);
        let said = warnings(&Job::on(&[&file]).with("input", &format!("crs = \"EPSG:{crs}\"")).report());
        match unit {
            Some(unit) => assert!(said.contains(&format!("in the unit {unit}, they lie within it")), "{name} {said}"),
            None => assert!(!said.contains("area of use"), "{name} {said}"),
        }
    }
}

#[test]
fn a_text_whose_unit_contradicts_its_code_is_judged_by_the_area_of_the_code() {
    let folder = tempfile::tempdir().unwrap();
    let utm = r#"PROJCS["ETRS89 / UTM zone 32N",GEOGCS["ETRS89",DATUM["European_Terrestrial_Reference_System_1989",
        SPHEROID["GRS 1980",6378137,298.257222101]],PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]],
        PROJECTION["Transverse_Mercator"],PARAMETER["latitude_of_origin",0],PARAMETER["central_meridian",9],
        PARAMETER["scale_factor",0.9996],PARAMETER["false_easting",500000],PARAMETER["false_northing",0],
        UNIT["metre",0.3048,AUTHORITY["EPSG","9001"]],AUTHORITY["EPSG","25832"]]"#;
    let file = write(folder.path(), "feet.las", &[text(utm)]);
    move_to(&file, [PLACE[0], PLACE[1], 0.0]);
    let words = ["whose text and code differ in the unit of x and y (foot, metre)", "latitude 36.5 to 84"];
    Job::on(&[&file]).run().refused(3, &words);
    let job = Job::on(&[&file]).with("input", "outside_crs_area = \"warn\"");
    let said = warnings(&job.report());
    assert!(said.contains("metre with 0.3048 in place of its length in metres"), "{said}");
    let place: serde_json::Value =
        serde_json::from_slice(&fs::read(job.out().join("georeference.json")).unwrap()).unwrap();
    assert!(place["epsg"].is_null() && place["crs"].is_string(), "{place}");
}

#[test]
fn a_file_without_a_crs_beside_others_is_told_so_and_the_cure_helps() {
    let folder = tempfile::tempdir().unwrap();
    let named = las(&folder, "named.las", PLACE);
    let assumed =
        "it has no CRS, and that of the other files is assumed: in ETRS89 / UTM zone 32N (EPSG:25832), its points";
    for (name, place, missing) in [
        ("prefixed.las", [32_500_010.0, 5_500_010.0], "EPSG:4647"),
        ("nowhere.las", [50_000_000.0, 5_500_000.0], "EPSG:..."),
    ] {
        let file = write(folder.path(), name, &[]);
        move_to(&file, [place[0], place[1], 0.0]);
        let remedy = format!("missing_crs = \"{missing}\" and [input] to_crs = \"EPSG:25832\"");
        let refused = Job::on(&[&named, &file]).run();
        refused.refused(3, &[name, assumed, &remedy]);
        assert!(!refused.err.contains("[input] crs"), "{name}");
        // Alone it has no CRS, and a file that names one is told as before.
        Job::on(&[&file]).report();
    }
    let file = folder.path().join("prefixed.las");
    let cured = "missing_crs = \"EPSG:4647\"\nto_crs = \"EPSG:25832\"";
    let said = warnings(&Job::on(&[&named, &file]).with("input", cured).report());
    assert!(!said.contains("area of use"), "{said}");
}
