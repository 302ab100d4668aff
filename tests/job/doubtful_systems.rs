//! Coordinate systems that cannot be read whole, or cannot be true: what a job takes together, refuses and warns about.

use std::fs;
use std::path::Path;

use crate::coordinate_systems::{code, ellipsoidal, keys, text, warnings, write};
use crate::program::{Job, gdt_batch};

const DOUBLES: u16 = 34736;

/// Records of keys and of their doubles.
fn keys_with(entries: &[[u16; 4]], doubles: &[f64]) -> Vec<(u16, Vec<u8>)> {
    vec![keys(entries), (DOUBLES, doubles.iter().flat_map(|value| value.to_le_bytes()).collect())]
}

/// Asserts that a job on files with these two systems is refused with `words`, and that one on two files of the first is not.
#[track_caller]
fn told_apart(first: &[(u16, Vec<u8>)], second: &[(u16, Vec<u8>)], words: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    let own = write(folder.path(), "own.las", first);
    let same = write(folder.path(), "same.las", first);
    let other = write(folder.path(), "other.las", second);
    Job::on(&[&own, &other]).run().refused(2, &[words, &["own.las", "other.las", "[input] crs"]].concat());
    Job::on(&[&own, &same]).report();
}

#[test]
fn keys_that_nothing_can_read_do_not_let_two_systems_pass() {
    let of_code = |code| {
        [keys(&[[1024, 0, 1, 1], [2048, 0, 1, 4269], [3072, 0, 1, 32767], [3074, 0, 1, code], [3076, 0, 1, 9003]])]
    };
    told_apart(&of_code(10_131), &of_code(10_132), &["3074=10131", "3074=10132"]);
    told_apart(&of_code(10_131), &[code(26915)], &["has no readable projection"]);
    let oblique = |doubles: [f64; 3]| {
        let projection = [[3072, 0, 1, 32767], [3074, 0, 1, 32767], [3075, 0, 1, 3], [3076, 0, 1, 9001]];
        let centre = [[3088, DOUBLES, 1, 1], [3089, DOUBLES, 1, 0], [3094, DOUBLES, 1, 2]];
        keys_with(&[&[[1024, 0, 1, 1], [2048, 0, 1, 4258]], &projection[..], &centre[..]].concat(), &doubles)
    };
    told_apart(&oblique([46.9, 7.4, 90.0]), &oblique([40.0, 1.4, 50.0]), &["3088=7.4", "3088=1.4"]);
    let grads = |longitude: f64| {
        let projection = [[3072, 0, 1, 32767], [3074, 0, 1, 32767], [3075, 0, 1, 1], [3076, 0, 1, 9001]];
        let origin = [[3080, DOUBLES, 1, 0], [3081, DOUBLES, 1, 1]];
        let base = [[1024, 0, 1, 1], [2048, 0, 1, 4258], [2054, 0, 1, 9105]];
        keys_with(&[&base[..], &projection[..], &origin[..]].concat(), &[longitude, 0.0])
    };
    told_apart(&grads(9.0), &grads(15.0), &["the longitude of the origin (8.1, 13.5)"]);
    told_apart(&[code(50_001)], &[code(50_002)], &["EPSG:50001 is not in the list of known codes"]);
}

#[test]
fn a_job_on_keys_that_nothing_can_read_says_so_and_names_the_system() {
    let folder = tempfile::tempdir().unwrap();
    let defined = [[1024, 0, 1, 1], [2048, 0, 1, 4269], [3072, 0, 1, 32767], [3074, 0, 1, 10_131], [3076, 0, 1, 9003]];
    let [own, coded] = [("own.las", keys(&defined)), ("coded.las", code(50_001))]
        .map(|(name, record)| write(folder.path(), name, &[record]));
    let said = warnings(&Job::on(&[&own]).report());
    assert!(said.contains("GeoTIFF key 3074, its projection, has the code 10131"), "{said}");
    assert!(!said.contains("name no CRS"), "{said}");
    let said = warnings(&Job::on(&[&coded]).report());
    assert!(said.contains("EPSG:50001 is not in the list of known codes"), "{said}");
}

#[test]
fn texts_without_a_known_datum_or_with_a_false_code_are_told_apart() {
    let zone = |system: &str, datum: &str, shift: &str, meridian: u32, end: &str| {
        [text(&format!(
            r#"PROJCS["my",GEOGCS["{system}",DATUM["{datum}",SPHEROID["International 1924",6378388,297]{shift}],
            PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]],PROJECTION["Transverse_Mercator"],
            PARAMETER["latitude_of_origin",0],PARAMETER["central_meridian",{meridian}],PARAMETER["scale_factor",1],
            PARAMETER["false_easting",500000],PARAMETER["false_northing",0],UNIT["metre",1]{end}]"#
        ))]
    };
    let nameless = |shift: &str| zone("unknown", "Unknown based on International 1924 ellipsoid", shift, 9, "");
    let shifts = [",TOWGS84[598.1,73.7,418.2,0.202,0.045,-2.455,6.7]", ",TOWGS84[577.3,90.1,463.9,5.1,1.5,5.3,2.4]"];
    told_apart(&nameless(shifts[0]), &nameless(shifts[1]), &["the shift of the datum to WGS 84"]);
    let generic = |datum: &str| zone("Geographic Coordinate System", datum, "", 9, "");
    told_apart(&generic("European_Datum_1950"), &generic("Monte_Mario"), &["the datum (", "ed50", "montemario"]);
    let coded = |meridian| zone("ED50", "European_Datum_1950", "", meridian, r#",AUTHORITY["EPSG","23032"]"#);
    told_apart(&coded(9), &coded(12), &["the longitude of the origin (9, 12)"]);
}

#[test]
fn heights_of_a_code_agree_with_their_name() {
    let folder = tempfile::tempdir().unwrap();
    let plane = r#"PROJCS["ETRS_1989_UTM_Zone_32N",GEOGCS["GCS_ETRS_1989",DATUM["D_ETRS_1989",SPHEROID["GRS_1980",6378137.0,
        298.257222101]],PRIMEM["Greenwich",0.0],UNIT["Degree",0.0174532925199433]],PROJECTION["Transverse_Mercator"],
        PARAMETER["False_Easting",500000.0],PARAMETER["False_Northing",0.0],PARAMETER["Central_Meridian",9.0],
        PARAMETER["Scale_Factor",0.9996],PARAMETER["Latitude_Of_Origin",0.0],UNIT["Meter",1.0]]"#;
    let heights = r#"VERTCS["Landesnivellement_1902",VDATUM["Landesnivellement_1902"],PARAMETER["Vertical_Shift",0.0],UNIT["Meter",1.0]]"#;
    let named = write(folder.path(), "named.las", &[text(&format!("{plane},{heights}"))]);
    let coded = |name: &str, height| {
        write(folder.path(), name, &[keys(&[[1024, 0, 1, 1], [3072, 0, 1, 25832], [4096, 0, 1, height]])])
    };
    assert_eq!(warnings(&ellipsoidal(&[&named, &coded("ln02.las", 5728)]).report()), "[]");
    let unknown = coded("unknown.las", 30_001);
    Job::on(&[&named, &unknown]).run().refused(2, &["EPSG:30001 is not in the list of known codes of heights"]);
}

#[test]
fn depths_are_told_from_heights_and_said_to_be_depths() {
    let folder = tempfile::tempdir().unwrap();
    let plane = r#"PROJCS["plane",GEOGCS["g",DATUM["D_ETRS_1989",SPHEROID["GRS_1980",6378137.0,298.257222101]],
        PRIMEM["Greenwich",0.0],UNIT["Degree",0.0174532925199433]],PROJECTION["Transverse_Mercator"],PARAMETER["False_Easting",500000.0],
        PARAMETER["False_Northing",0.0],PARAMETER["Central_Meridian",9.0],PARAMETER["Scale_Factor",0.9996],
        PARAMETER["Latitude_Of_Origin",0.0],UNIT["Meter",1.0]]"#;
    let axis = |way: &str| {
        [text(&format!(
            r#"COMPD_CS["c",{plane},VERT_CS["Local",VERT_DATUM["Local",2005],UNIT["metre",1],AXIS["z",{way}]]]"#
        ))]
    };
    let esri = |way: &str| {
        [text(&format!(
            r#"{plane},VERTCS["Local",VDATUM["Local"],PARAMETER["Vertical_Shift",0.0],PARAMETER["Direction",{way}],UNIT["Meter",1.0]]"#
        ))]
    };
    told_apart(&axis("UP"), &axis("DOWN"), &["the direction of heights, one of which are depths"]);
    told_apart(&esri("1.0"), &esri("-1.0"), &["the direction of heights, one of which are depths"]);
    told_apart(&axis("DOWN"), &esri("1.0"), &["the direction of heights, one of which are depths"]);
    let [up, down] =
        [("up.las", "1.0"), ("down.las", "-1.0")].map(|(name, way)| write(folder.path(), name, &esri(way)));
    let said = warnings(&Job::on(&[&down]).report());
    assert!(said.contains("down.las") && said.contains("its z is a depth (Local)"), "{said}");
    assert_eq!(warnings(&ellipsoidal(&[&up]).report()), "[]");
    // Once the user has said what is meant, there is no more to say about the record.
    for choice in ["EPSG:25832+7837", "none"] {
        let said = warnings(&Job::on(&[&down]).with("input", &format!("crs = \"{choice}\"")).report());
        assert!(!said.contains("upside down"), "{choice}: {said}");
    }
    let silent = write(folder.path(), "silent.las", &[text(plane)]);
    for choice in ["auto", "first"] {
        let said = Job::on(&[&down, &silent]).with("input", &format!("crs = \"{choice}\"")).report();
        let said = warnings(&said);
        assert!(said.contains("1 of 2 inputs, such as") && said.contains("its z is a depth (Local)"), "{said}");
        let words = "1 of 2 inputs do not state whether z is a height or a depth, such as";
        assert!(said.contains(words) && said.contains("silent.las: a depth assumed, as"), "{choice}: {said}");
    }
    let info = gdt_batch(folder.path(), &["info", "down.las"]);
    assert!(info.out.contains("its z is a depth (Local)"), "{info:?}");
    let given = Job::on(&[&up]).with("input", "crs = \"EPSG:25832+5715\"").report();
    assert!(warnings(&given).contains("its z is a depth (EPSG:5715)"), "{given}");
}

/// Moves a file's box and points to longitude 11.5 and latitude 48.1.
fn move_to_degrees(path: &Path) {
    let mut bytes = fs::read(path).unwrap();
    let header =
        [(131, 1e-5), (139, 1e-5), (155, 11.5), (163, 48.1), (179, 11.6), (187, 11.4), (195, 48.2), (203, 48.0)];
    for (at, value) in header {
        bytes[at..at + 8].copy_from_slice(&f64::to_le_bytes(value));
    }
    fs::write(path, bytes).unwrap();
}

#[test]
fn a_projected_system_over_degrees_is_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let [far, near] = ["far.las", "near.las"].map(|name| write(folder.path(), name, &[code(25832)]));
    move_to_degrees(&far);
    // Its area of use does not reach to the equator.
    Job::on(&[&far]).run().refused(3, &["far.las", "as longitude and latitude, they lie within it: [input] crs"]);
    let said = Job::on(&[&far]).with("input", "outside_crs_area = \"warn\"").run_with(&["check"]);
    let said = format!("{}{}", said.out, said.err);
    assert!(said.contains("far.las") && said.contains("look like longitude and latitude"), "{said}");
    let said = Job::on(&[&near]).run_with(&["check"]);
    assert!(!said.out.contains("look like longitude"), "{said:?}");
}

#[test]
fn what_the_user_says_is_not_called_a_record() {
    let folder = tempfile::tempdir().unwrap();
    let file = write(folder.path(), "plain.las", &[]);
    for (choice, word) in [("EPSG:4326", "degrees"), ("EPSG:4978", "geocentric")] {
        let said = Job::on(&[&file]).with("input", &format!("crs = \"{choice}\"")).run();
        said.refused(2, &[word, "in another CRS than [input] crs"]);
        assert!(!said.err.contains("record is wrong"), "{said:?}");
    }
    let degrees = write(folder.path(), "degrees.las", &[keys(&[[1024, 0, 1, 2], [2048, 0, 1, 4326]])]);
    move_to_degrees(&degrees);
    Job::on(&[&degrees])
        .run()
        .refused(2, &["degrees.las: the coordinates are in degrees", "if the CRS record is wrong, set [input] crs"]);
}
