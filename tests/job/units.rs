//! The units of texts beside those of other files, and under the choices of the user.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;
use tempfile::TempDir;

use crate::coordinate_systems::{code, keys, text, warnings, write};
use crate::program::Job;

const US_FOOT: f64 = 1200.0 / 3937.0;

/// NAD83 / UTM 15N with heights in US feet.
const FEET_OF_HEIGHT: [[u16; 4]; 4] = [[1024, 0, 1, 1], [3072, 0, 1, 26915], [4096, 0, 1, 5703], [4099, 0, 1, 9003]];

fn csv(folder: &TempDir, name: &str, header: &str) -> PathBuf {
    let row = |i: usize| format!("{}.25,{}.50,{}.75\n", 500_000 + i % 10 * 7, 4_000_000 + i / 10 * 9, i % 3);
    let path = folder.path().join(name);
    fs::write(&path, format!("{header}\n{}", (0..60).map(row).collect::<String>())).unwrap();
    path
}

/// Returns the metres of a unit of x and y, and of z, and the warnings.
#[track_caller]
fn metres(files: &[&Path], input: &str) -> ([f64; 2], String) {
    let job = Job::on(files).with("input", input);
    let said = warnings(&job.report());
    let place: Value = serde_json::from_slice(&fs::read(job.out().join("georeference.json")).unwrap()).unwrap();
    (["metres_per_unit", "metres_per_unit_z"].map(|key| place[key].as_f64().unwrap()), said)
}

#[test]
fn a_text_that_says_one_unit_for_all_columns_says_that_of_its_heights() {
    let folder = tempfile::tempdir().unwrap();
    let [metre, feet] = [("m.csv", "x [m],y [m],z [m]"), ("ft.csv", "x [us-ft],y [us-ft],z [us-ft]")]
        .map(|(name, header)| csv(&folder, name, header));
    let [centimetre, silent] = [("cm.csv", "x [m],y [m],z [cm]"), ("none.csv", "x [m],y [m],z")]
        .map(|(name, header)| csv(&folder, name, header));
    let heights = write(folder.path(), "heights.las", &[keys(&FEET_OF_HEIGHT)]);
    let metres_of_height = [[1024, 0, 1, 1], [3072, 0, 1, 2276], [4096, 0, 1, 5703], [4099, 0, 1, 9001]];
    let mixed = write(folder.path(), "mixed.las", &[keys(&metres_of_height)]);
    for (files, words) in [
        (
            [&metre, &centimetre],
            ["m.csv has its columns in metre", "and z in 0.01 m", "the unit of height (metre, 0.01 m)"],
        ),
        ([&metre, &heights], ["m.csv has its columns in metre", "heights.las is in NAD83", "the unit of height"]),
        ([&feet, &mixed], ["has its columns in US survey foot", "mixed.las is in NAD83", "the unit of height"]),
        ([&metre, &feet], ["columns in metre", "columns in US survey foot", "[input] unit"]),
    ] {
        Job::on(&files).run().refused(2, &words);
        let swapped = Job::on(&[files[1], files[0]]).run();
        swapped.refused(2, &["the unit of "]);
        assert!(!swapped.err.contains("unknown"), "{swapped:?}");
    }
    let (found, said) = metres(&[&silent, &centimetre], "");
    assert_eq!(found, [1.0, 0.01]);
    assert!(said.contains("1 of 2 inputs have no unit of heights, such as") && said.contains("none.csv"), "{said}");
    assert_eq!(metres(&[&metre, &silent], "").0, [1.0, 1.0]);
    // The first file is right, says the user.
    assert_eq!(metres(&[&metre, &centimetre], "crs = \"first\"").0, [1.0, 1.0]);
    assert_eq!(metres(&[&centimetre, &metre], "crs = \"first\"").0, [1.0, 0.01]);
}

#[test]
fn a_crs_of_the_user_takes_no_unit_of_heights_away() {
    let folder = tempfile::tempdir().unwrap();
    let feet = csv(&folder, "feet.csv", "x [m],y [m],z [ft]");
    let las = write(folder.path(), "feet.las", &[keys(&FEET_OF_HEIGHT)]);
    for (file, metre) in [(&feet, 0.3048), (&las, US_FOOT)] {
        let (found, said) = metres(&[file], "crs = \"EPSG:26915\"");
        assert_eq!(found, [1.0, metre]);
        assert!(said.contains("[input] crs (NAD83 / UTM zone 15N (EPSG:26915)) has no unit of heights"), "{said}");
        assert_eq!(metres(&[file], "crs = \"EPSG:26915+5703\"").0, [1.0, 1.0]);
    }
    let both = Job::on(&[&feet, &las]).with("input", "crs = \"EPSG:26915\"").run();
    both.refused(2, &["feet.csv has heights in foot", "feet.las has them in US survey foot", "crs = \"first\""]);
}

#[test]
fn the_first_file_may_leave_the_unit_of_heights_to_another_with_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let plain = write(folder.path(), "m.las", &[code(26915)]);
    let feet = [[1024, 0, 1, 1], [3072, 0, 1, 26915], [4096, 0, 1, 6360]];
    let feet = write(folder.path(), "mzft.las", &[keys(&feet)]);
    for choice in ["auto", "first"] {
        let (found, said) = metres(&[&plain, &feet], &format!("crs = \"{choice}\""));
        assert_eq!(found, [1.0, US_FOOT], "{choice}");
        let words = "1 of 2 inputs have no unit of heights, such as";
        assert!(said.contains(words) && said.contains("m.las: US survey foot assumed"), "{choice}: {said}");
    }
}

#[test]
fn without_a_crs_the_units_of_columns_count() {
    let folder = tempfile::tempdir().unwrap();
    let feet = csv(&folder, "feet.csv", "x [ft],y [ft],z [ft]");
    let other = csv(&folder, "mm.csv", "x [mm],y [mm],z [mm]");
    let las = write(folder.path(), "feet.las", &[code(2276)]);
    for choice in ["none", "first"] {
        let (found, said) = metres(&[&feet], &format!("crs = \"{choice}\""));
        assert_eq!(found, [0.3048, 0.3048]);
        assert!(!said.contains("no input states"), "{said}");
    }
    Job::on(&[&feet, &other])
        .with("input", "crs = \"none\"")
        .run()
        .refused(2, &["feet.csv has x and y in foot", "0.001 m"]);
    let (found, said) = metres(&[&las], "crs = \"none\"");
    assert_eq!(found, [1.0, 1.0]);
    assert!(said.contains("ignores the units that records of coordinate systems state"), "{said}");
    let (found, said) = metres(&[&feet], "[input.csv]\ncolumns = [\"x\", \"y\", \"z\"]");
    assert_eq!(found, [0.3048, 0.3048]);
    assert!(!said.contains("no input states"), "{said}");
}

#[test]
fn the_unit_of_the_user_is_that_of_all_columns() {
    let folder = tempfile::tempdir().unwrap();
    let [feet, metre] =
        ["ft", "m"].map(|unit| csv(&folder, &format!("{unit}.csv"), &format!("x [{unit}],y [{unit}],z [{unit}]")));
    // What a foot is, the text does not say.
    let (found, said) = metres(&[&feet], "unit = \"us-foot\"");
    assert_eq!(found, [US_FOOT, US_FOOT]);
    assert!(!said.contains("overrides") && !said.contains("heights are in another unit"), "{said}");
    // Which foot it is asks whoever has not stated it.
    assert!(
        !said.contains("are in feet of an unknown kind")
            && metres(&[&feet], "").1.contains("are in feet of an unknown kind")
    );
    let (found, said) = metres(&[&feet, &metre], "unit = \"metre\"");
    assert_eq!(found, [1.0, 1.0]);
    assert!(said.contains("overrides the unit of its columns") && said.contains("(foot)"), "{said}");
    assert_eq!(metres(&[&csv(&folder, "cm.csv", "x [m],y [m],z [cm]")], "unit = \"foot\"").0, [0.3048, 0.01]);
}

#[test]
fn files_without_a_unit_beside_a_text_with_one_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let other = csv(&folder, "mm.csv", "x [mm],y [mm],z [mm]");
    let bare = csv(&folder, "bare.csv", "x,y,z");
    let las = write(folder.path(), "bare.las", &[]);
    for silent in [&bare, &las] {
        let (found, said) = metres(&[&other, silent], "");
        assert_eq!(found, [0.001, 0.001]);
        let name = silent.file_name().unwrap().to_str().unwrap();
        let words = "1 of 2 inputs have no unit of length, such as";
        assert!(said.contains(words) && said.contains(&format!("{name}: 0.001 m assumed")), "{said}");
    }
    let named = write(folder.path(), "named.las", &[text(r#"PROJCS["Site grid",GEOGCS["g"],PROJECTION["x"]]"#)]);
    assert!(metres(&[&other, &named], "").1.contains("have no unit of length"));
    assert!(!metres(&[&other, &bare], "unit = \"metre\"").1.contains("have no unit"));
}

/// NAD83 / UTM 15N without a code.
const WORDED: &str = r#"PROJCS["UTM",GEOGCS["GCS_North_American_1983",DATUM["D_North_American_1983",
    SPHEROID["GRS_1980",6378137.0,298.257222101]],PRIMEM["Greenwich",0.0],UNIT["Degree",0.0174532925199433]],
    PROJECTION["Transverse_Mercator"],PARAMETER["False_Easting",500000.0],PARAMETER["False_Northing",0.0],
    PARAMETER["Central_Meridian",-93.0],PARAMETER["Scale_Factor",0.9996],PARAMETER["Latitude_Of_Origin",0.0],
    UNIT["Meter",1.0]]"#;

#[test]
fn a_unit_that_contradicts_the_crs_is_refused_with_both_names() {
    let folder = tempfile::tempdir().unwrap();
    let bare = csv(&folder, "bare.csv", "x,y,z");
    let [metre, feet] =
        [("m.las", 26915), ("ft.las", 2276)].map(|(name, crs)| write(folder.path(), name, &[code(crs)]));
    let worded = write(folder.path(), "text.las", &[text(WORDED)]);
    for (file, lines, words) in [
        (
            &metre,
            "unit = \"us-foot\"",
            ["m.las is in NAD83 / UTM zone 15N (EPSG:26915), whose unit is the metre", "US"],
        ),
        (&worded, "unit = \"foot\"", ["text.las is in UTM, whose unit is the metre", "unit is foot"]),
        // The two kinds of foot.
        (&feet, "unit = \"foot\"", ["whose unit is the US survey foot", "unit is foot"]),
        (&metre, "crs = \"first\"\nunit = \"foot\"", ["m.las is in NAD83", "unit is foot"]),
        (&bare, "crs = \"EPSG:26915\"\nunit = \"us-foot\"", ["[input] crs is NAD83", "leave unit out"]),
        (&bare, "missing_crs = \"EPSG:26915\"\nunit = \"foot\"", ["[input] missing_crs is NAD83", "leave unit out"]),
        (&bare, "crs = \"EPSG:2276\"\nto_crs = \"utm\"\nunit = \"metre\"", ["[input] crs is NAD83", "unit is metre"]),
    ] {
        Job::on(&[file]).with("input", lines).run().refused(2, &words);
        Job::on(&[file]).with("input", lines).run_with(&["check"]).refused(2, &words);
    }
    let degrees = folder.path().join("degrees.csv");
    std::fs::write(&degrees, "9.90,53.50,1\n9.91,53.50,2\n9.90,53.51,3\n9.91,53.52,2\n").unwrap();
    let job = Job::on(&[&degrees]).with("input", "crs = \"EPSG:4326\"\nunit = \"foot\"");
    job.run().refused(2, &["[input] crs is", "whose unit is the degree", "to_crs = \"utm\"", "crs = \"none\""]);
    // The same unit, a CRS of the user in that unit, and no CRS.
    assert_eq!(metres(&[&metre], "unit = \"metre\"").0, [1.0, 1.0]);
    let in_feet =
        WORDED.replace("500000.0", "1640416.666666667").replace("\"Meter\",1.0", "\"Foot_US\",0.3048006096012192");
    let lines = format!("crs = '''{in_feet}'''\nunit = \"us-foot\"\noutside_crs_area = \"warn\"");
    assert_eq!(metres(&[&metre], &lines).0, [US_FOOT, US_FOOT]);
    assert_eq!(metres(&[&metre], "crs = \"none\"\nunit = \"us-foot\"").0, [US_FOOT, US_FOOT]);
    assert_eq!(metres(&[&bare], "unit = \"us-foot\"").0, [US_FOOT, US_FOOT]);
}

#[test]
fn a_record_that_is_left_aside_and_states_another_unit_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let las = write(folder.path(), "metre.las", &[code(26915)]);
    let (found, said) = metres(&[&las], "crs = \"none\"\nunit = \"foot\"");
    assert_eq!(found, [0.3048, 0.3048]);
    let words = "ignores its unit";
    assert!(said.contains(words) && said.contains("(metre for x and y)"), "{said}");
    assert!(!metres(&[&las], "crs = \"none\"\nunit = \"metre\"").1.contains("ignores its unit"));
    let heights = write(folder.path(), "heights.las", &[keys(&FEET_OF_HEIGHT)]);
    let (found, said) = metres(&[&heights], "crs = \"none\"\nunit = \"metre\"");
    assert_eq!(found, [1.0, 1.0]);
    assert!(said.contains("(US survey foot for z)"), "{said}");
    let (found, said) = metres(&[&heights], "unit = \"metre\"");
    assert_eq!(found, [1.0, US_FOOT]);
    assert!(said.contains("[input] unit sets that of x and y alone"), "{said}");
}

#[test]
fn a_unit_of_length_over_columns_of_degrees_must_be_stated_twice() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("degrees.csv");
    let row =
        |i: usize| format!("{:.6},{:.6},{}\n", 11.5 + (i % 10) as f64 * 1e-4, 48.1 + (i / 10) as f64 * 1e-4, i % 3);
    fs::write(&path, format!("lon,lat,z\n{}", (0..60).map(row).collect::<String>())).unwrap();
    let words = ["degrees.csv: its columns are named as degrees", "[input] unit is metre", "to_crs = \"utm\""];
    Job::on(&[&path]).with("input", "unit = \"metre\"").run().refused(2, &words);
    let (found, said) = metres(&[&path], "unit = \"metre\"\ncrs = \"none\"");
    assert_eq!(found, [1.0, 1.0]);
    assert!(said.contains("(degree for x and y)"), "{said}");
}

#[test]
fn the_unit_of_a_record_without_a_system_is_that_of_the_plane_unless_the_user_states_another() {
    let folder = tempfile::tempdir().unwrap();
    let bare = write(folder.path(), "key.las", &[keys(&[[3076, 0, 1, 9003]])]);
    assert_eq!(metres(&[&bare], "").0[0], US_FOOT);
    let (found, said) = metres(&[&bare], "unit = \"metre\"");
    assert_eq!(found[0], 1.0);
    assert!(
        said.contains("[input] unit (metre) overrides the unit of its records") && said.contains("(US survey foot)"),
        "{said}"
    );
    assert!(!metres(&[&bare], "unit = \"us-foot\"").1.contains("overrides"));
    let geocentric =
        write(folder.path(), "false.las", &[keys(&[[1024, 0, 1, 3], [2048, 0, 1, 4978], [2052, 0, 1, 9002]])]);
    let (found, said) = metres(&[&geocentric], "");
    assert_eq!(found[0], 0.3048);
    assert!(said.contains("x and y are treated as a plane in foot"), "{said}");
}

/// `height_unit` states what files do not. What a file or a CRS states instead is no unit that it overrides in silence.
#[test]
fn the_user_states_the_unit_of_heights() {
    let folder = tempfile::tempdir().unwrap();
    let [silent, feet] =
        [("none.csv", "x,y,z"), ("ft.csv", "x [m],y [m],z [ft]")].map(|(name, header)| csv(&folder, name, header));
    let crs = "crs = \"EPSG:32633\"";
    let (found, said) = metres(&[&silent], crs);
    assert_eq!(found, [1.0; 2]);
    assert!(said.contains("heights are taken to be in the unit of x and y (metre)"), "{said}");
    let chosen = format!("{crs}\nheight_unit = \"foot\"");
    let (found, said) = metres(&[&silent], &chosen);
    assert_eq!(found, [1.0, 0.3048]);
    assert!(!said.contains("has no unit of heights") && !said.contains("taken to be in the unit"), "{said}");
    assert_eq!(metres(&[&silent], "height_unit = \"foot\"").0, [1.0, 0.3048]);
    assert_eq!(metres(&[&silent], "unit = \"foot\"\nheight_unit = \"metre\"").0, [0.3048, 1.0]);
    // A CRS of the user overrides those of files, and so does the unit beside it.
    assert_eq!(metres(&[&feet], &format!("{crs}\nheight_unit = \"us-foot\"")).0, [1.0, US_FOOT]);
    for (to, unit, highest) in [("EPSG:32634", 0.3048, 2.75), ("EPSG:32634+5773", 1.0, 2.75 * 0.3048)] {
        let job = Job::on(&[&silent]).with("input", &format!("{chosen}\nto_crs = {to:?}"));
        job.report();
        let place: Value = serde_json::from_slice(&fs::read(job.out().join("georeference.json")).unwrap()).unwrap();
        assert_eq!(place["metres_per_unit_z"].as_f64(), Some(unit), "{place}");
        assert!((place["bounds"][1][2].as_f64().unwrap() - highest).abs() < 0.006, "{place}");
    }
    for input in ["height_unit = \"metre\"", "crs = \"EPSG:32633+5773\"\nheight_unit = \"foot\""] {
        Job::on(&[&feet]).with("input", input).run().refused(2, &["[input] height_unit is ", "leave height_unit out"]);
    }
}
