//! Which coordinate systems a job takes, and which of them it takes together.

use std::fs;
use std::path::{Path, PathBuf};

use proj4rs::{Proj, transform::transform};
use serde_json::Value;

use crate::common::shared;
use crate::globe::{distance, georeference};
use crate::las_file::LasFile;
use crate::program::Job;
use crate::tileset::numbers;

const TEXT: u16 = 2112;
const KEYS: u16 = 34735;
const CLARKE: &str = r#""Clarke_1866",6378206.4,294.9786982"#;
const GRS80: &str = r#""GRS_1980",6378137.0,298.257222101"#;

/// Adds records of coordinate systems to the header of a LAS file, whose points come next.
pub(crate) fn add_records(header: &mut Vec<u8>, records: &[(u16, Vec<u8>)]) {
    for (id, data) in records {
        let mut record = [0; 54];
        record[2..17].copy_from_slice(b"LASF_Projection");
        record[18..20].copy_from_slice(&id.to_le_bytes());
        record[20..22].copy_from_slice(&(data.len() as u16).to_le_bytes());
        header.extend(record);
        header.extend(data);
    }
    let points_at = header.len() as u32;
    header[96..100].copy_from_slice(&points_at.to_le_bytes());
    header[100..104].copy_from_slice(&(records.len() as u32).to_le_bytes());
}

/// Writes a sound LAS file with these records of coordinate systems.
pub(crate) fn write(folder: &Path, name: &str, records: &[(u16, Vec<u8>)]) -> PathBuf {
    let plain = LasFile::new(2, 0, 0, 200).las();
    let (header, points) = plain.split_at(227);
    let mut bytes = header.to_vec();
    add_records(&mut bytes, records);
    // The box: greatest and least of x, y and z.
    for (at, value) in [502_000.0f64, 498_000.0, 4_002_000.0, 3_998_000.0, 1.0, -1.0].into_iter().enumerate() {
        bytes[179 + 8 * at..][..8].copy_from_slice(&value.to_le_bytes());
    }
    bytes.extend(points);
    let path = folder.join(name);
    fs::write(&path, bytes).unwrap();
    path
}

/// Moves the points of a file that [`write`] wrote around a place, and its box.
pub(crate) fn move_to(path: &Path, place: [f64; 3]) {
    let mut bytes = fs::read(path).unwrap();
    for (axis, value) in place.into_iter().enumerate() {
        let half = if axis < 2 { 2_000.0 } else { 1.0 };
        for (at, value) in [(155 + 8 * axis, value), (179 + 16 * axis, value + half), (187 + 16 * axis, value - half)] {
            bytes[at..at + 8].copy_from_slice(&value.to_le_bytes());
        }
    }
    fs::write(path, bytes).unwrap();
}

pub(crate) fn text(text: &str) -> (u16, Vec<u8>) {
    (TEXT, text.as_bytes().to_vec())
}

pub(crate) fn keys(keys: &[[u16; 4]]) -> (u16, Vec<u8>) {
    let all = std::iter::once([1, 1, 0, keys.len() as u16]).chain(keys.iter().copied());
    (KEYS, all.flatten().flat_map(u16::to_le_bytes).collect())
}

pub(crate) fn code(code: u16) -> (u16, Vec<u8>) {
    keys(&[[1024, 0, 1, 1], [3072, 0, 1, code]])
}

/// ESRI's text of UTM zone 15, without a code.
fn esri(datum: &str, spheroid: &str) -> String {
    format!(
        r#"PROJCS["UTM_15N",GEOGCS["GCS_{datum}",DATUM["D_{datum}",SPHEROID[{spheroid}]],PRIMEM["Greenwich",0.0],
        UNIT["Degree",0.0174532925199433]],PROJECTION["Transverse_Mercator"],PARAMETER["False_Easting",500000.0],
        PARAMETER["False_Northing",0.0],PARAMETER["Central_Meridian",-93.0],PARAMETER["Scale_Factor",0.9996],
        PARAMETER["Latitude_Of_Origin",0.0],UNIT["Meter",1.0]]"#
    )
}

/// The same with heights.
fn with_heights(system: &str, datum: &str, unit: &str) -> String {
    let plane = esri("North_American_1983", GRS80);
    format!(r#"COMPD_CS["c",{plane},VERT_CS["{system}",VERT_DATUM["{datum}",2005],UNIT[{unit}],AXIS["Up",UP]]]"#)
}

/// Returns a job on heights of which the user says that they are ellipsoidal.
pub(crate) fn ellipsoidal<P: AsRef<Path>>(files: &[P]) -> Job {
    Job::on(files).with("output", "height_offset = 0.0")
}

pub(crate) fn warnings(report: &Value) -> String {
    report["warnings"].to_string()
}

#[test]
fn the_cure_of_a_geocentric_system_is_one_that_helps() {
    let folder = tempfile::tempdir().unwrap();
    let (map, bare) = (write(folder.path(), "map.las", &[code(26915)]), write(folder.path(), "bare.las", &[]));
    let false_record = write(folder.path(), "false.las", &[keys(&[[2048, 0, 1, 4978]])]);
    let words = ["which is geocentric, but the points of", "bare.las do not lie on the surface of the earth"];
    for (line, key) in
        [("crs = \"EPSG:4978\"", "[input] crs is"), ("missing_crs = \"EPSG:4978\"", "[input] missing_crs is")]
    {
        Job::on(&[&bare, &map]).with("input", line).run().refused(2, &[words[0], words[1], key]);
    }
    // The user states a CRS already, or the other file does.
    let full = "the record is ignored";
    let short = "its geocentric coordinate system (WGS 84 (EPSG:4978)) is ignored, because [input] sets another";
    for (files, line, words) in [
        (vec![&false_record], "crs = \"EPSG:26915\"", [short, full]),
        (vec![&false_record, &bare], "missing_crs = \"EPSG:26915\"", [short, full]),
        (vec![&false_record, &map], "", [full, short]),
    ] {
        let job = Job::on(&files).with("input", line).report();
        let said = warnings(&job);
        assert!(said.contains(words[0]) && !said.contains(words[1]), "{said}");
        assert_eq!(job["crs"], "NAD83 / UTM zone 15N");
    }
    let earth = write(folder.path(), "earth.las", &[keys(&[[2048, 0, 1, 4978]])]);
    move_to(&earth, [4_177_000.0, 855_000.0, 4_728_000.0]);
    for line in ["", "to_crs = \"utm\""] {
        let refused = Job::on(&[&map, &earth]).with("input", line).run();
        refused.refused(2, &["earth.las: the coordinates are geocentric", "pdal translate"]);
    }
}

#[test]
fn the_unit_of_a_false_record_gives_way_to_every_other_statement() {
    let folder = tempfile::tempdir().unwrap();
    let place = [3_101_800.0, 10_070_600.0, 0.0];
    let file = |name: &str, records: &[(u16, Vec<u8>)]| {
        let path = write(folder.path(), name, records);
        move_to(&path, place);
        path
    };
    let texas = file("texas.las", &[code(2277)]);
    let silent = file("silent.las", &[keys(&[[2048, 0, 1, 6317]])]);
    let in_metres = file("metres.las", &[keys(&[[2048, 0, 1, 6317], [3076, 0, 1, 9001]])]);
    for record in [&silent, &in_metres] {
        for (files, lines) in [
            (vec![&texas, record], ""),
            (vec![&texas, record], "missing_crs = \"EPSG:2277\""),
            (vec![&texas, record], "unit = \"us-foot\""),
            (vec![record], "missing_crs = \"EPSG:2277\""),
            (vec![record], "crs = \"EPSG:2277\""),
        ] {
            let job = ellipsoidal(&files).with("input", lines);
            let report = job.report();
            assert_eq!(report["unit"], "us-foot", "{lines}");
            assert_eq!(report["crs"], "NAD83 / Texas Central (ftUS)", "{lines}");
            assert_eq!(georeference(&job, "metres_per_unit"), 1200.0 / 3937.0, "{lines}");
            assert!(!warnings(&report).contains("otherwise"), "{report}");
        }
        let lines = "missing_crs = \"EPSG:2277\"\nto_crs = \"EPSG:26914\"";
        assert_eq!(Job::on(&[&texas, record]).with("input", lines).report()["crs"], "NAD83 / UTM zone 14N");
    }
    let said = warnings(&Job::on(&[&silent]).report());
    assert!(said.contains("no input states a known unit of length: metres assumed; fix: set [input] unit"), "{said}");
    let said = warnings(&Job::on(&[&in_metres]).report());
    assert!(
        said.contains("x and y are treated as a plane in metre") && !said.contains("no input states a known unit"),
        "{said}"
    );
}

#[test]
fn geocentric_coordinates_are_refused_by_code_text_and_keys() {
    let folder = tempfile::tempdir().unwrap();
    let version_1 = r#"GEOCCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],PRIMEM["Greenwich",0],
        UNIT["metre",1],AXIS["Geocentric X",OTHER],AXIS["Geocentric Y",OTHER],AXIS["Geocentric Z",NORTH]]"#;
    let version_2 = r#"GEODCRS["WGS 84",DATUM["World Geodetic System 1984",ELLIPSOID["WGS 84",6378137,298.257223563]],
        CS[Cartesian,3],AXIS["(X)",geocentricX],AXIS["(Y)",geocentricY],AXIS["(Z)",geocentricZ],LENGTHUNIT["metre",1]]"#;
    for (name, record) in [
        ("version_1.las", text(version_1)),
        ("version_2.las", text(version_2)),
        ("code.las", keys(&[[2048, 0, 1, 4978]])),
        ("model.las", keys(&[[1024, 0, 1, 3], [2048, 0, 1, 4326]])),
    ] {
        let file = write(folder.path(), name, &[record]);
        let unplaced = Job::on(&[&file]).with("input", "unit = \"us-foot\"").report();
        let said = warnings(&unplaced);
        assert!(said.contains("is geocentric, but its points do not lie on the surface of the earth"), "{said}");
        assert_eq!((unplaced["unit"].as_str(), unplaced["crs"].as_str()), (Some("us-foot"), None));
        assert_eq!(Job::on(&[&file]).report()["unit"], "metre");
        move_to(&file, [4_177_000.0, 855_000.0, 4_728_000.0]);
        let words = ["geocentric", "z is not a height", "pdal translate", "[input] crs"];
        Job::on(&[&file]).run().refused(2, &words);
        Job::on(&[&file]).with("input", "unit = \"metre\"").run().refused(2, &words);
        Job::on(&[&file]).with("input", "crs = \"none\"").report();
    }
}

#[test]
fn texts_without_codes_whose_datums_differ_are_refused_unless_the_user_says_which() {
    let folder = tempfile::tempdir().unwrap();
    let old = write(folder.path(), "old.las", &[text(&esri("North_American_1927", CLARKE))]);
    let new = write(folder.path(), "new.las", &[text(&esri("North_American_1983", GRS80))]);
    let words = ["old.las", "new.las", "the datum", "1927", "1983", "one CRS", "[input] crs"];
    Job::on(&[&old, &new]).run().refused(2, &words);
    Job::on(&[&new, &old]).run().refused(2, &words);
    for (choice, used, other) in [("first", "UTM_15N", "new.las"), ("EPSG:26915", "NAD83 / UTM zone 15N", "old.las")] {
        let job = Job::on(&[&old, &new]).with("input", &format!("crs = \"{choice}\""));
        let report = job.report();
        assert_eq!(report["crs"], used);
        assert!(warnings(&report).contains(&format!("{other}: ")), "{report}");
        assert!(warnings(&report).contains("differs in the datum"), "{report}");
        job.verified();
    }
    let coded = write(folder.path(), "coded.las", &[code(26915)]);
    assert_eq!(warnings(&ellipsoidal(&[&new, &coded]).report()), "[]");
    Job::on(&[&old, &coded]).run().refused(2, &["the datum (", "NAD83"]);
}

#[test]
fn user_defined_keys_are_compared_with_codes() {
    let folder = tempfile::tempdir().unwrap();
    let defined = |datum: u16| {
        keys(&[[1024, 0, 1, 1], [2048, 0, 1, datum], [3072, 0, 1, 32767], [3074, 0, 1, 16015], [3076, 0, 1, 9001]])
    };
    let [nad83, nad27] =
        [("nad83.las", 4269), ("nad27.las", 4267)].map(|(name, datum)| write(folder.path(), name, &[defined(datum)]));
    let [utm15, utm16] =
        [("15.las", 26915), ("16.las", 26916)].map(|(name, utm)| write(folder.path(), name, &[code(utm)]));
    assert_eq!(warnings(&ellipsoidal(&[&nad83, &utm15]).report()), "[]");
    Job::on(&[&nad27, &utm15]).run().refused(2, &["nad27.las", "15.las", "the datum (", "NAD27", "NAD83"]);
    Job::on(&[&nad83, &utm16]).run().refused(2, &["nad83.las", "16.las", "longitude of the origin (", "-93", "-87"]);
}

#[test]
fn a_file_without_a_crs_beside_others_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let bare = write(folder.path(), "bare.las", &[]);
    let coded = write(folder.path(), "coded.las", &[code(26915)]);
    for files in [[&bare, &coded], [&coded, &bare]] {
        let report = Job::on(&files).report();
        let said = warnings(&report);
        assert!(said.contains("1 of 2 inputs have no CRS") && said.contains("bare.las"), "{said}");
        assert_eq!(report["crs"], "NAD83 / UTM zone 15N");
    }
    assert!(!warnings(&Job::on(&[&bare]).report()).contains("name no CRS"));
}

#[test]
fn units_and_datums_of_height_are_told_apart() {
    let folder = tempfile::tempdir().unwrap();
    let (metre, foot) = (r#""metre",1"#, r#""US survey foot",0.304800609601219"#);
    let write = |name: &str, record| write(folder.path(), name, &[record]);
    let metres = write("metres.las", text(&with_heights("NAVD88 height", "North American Vertical Datum 1988", metre)));
    let feet =
        write("feet.las", text(&with_heights("NAVD88 height (ftUS)", "North American Vertical Datum 1988", foot)));
    let older =
        write("older.las", text(&with_heights("NGVD29 height (m)", "National Geodetic Vertical Datum 1929", metre)));
    let plane = write("plane.las", text(&esri("North_American_1983", GRS80)));
    let refused = |files: [&PathBuf; 2], words: &[&str]| Job::on(&files).run().refused(2, words);
    refused([&metres, &feet], &["differ in the unit of height (", "US survey foot", "metre", "[input] crs"]);
    refused([&metres, &older], &["differ in the datum of heights (", "NAVD88", "NGVD29"]);
    // Whatever the order, what one file says of its heights counts for those that say nothing.
    for files in [[&plane, &feet], [&feet, &plane]] {
        let job = Job::on(&files);
        let said = warnings(&job.report());
        assert!(said.contains("1 of 2 inputs have no unit of heights") && said.contains("plane.las"), "{said}");
        let georeference: Value =
            serde_json::from_slice(&fs::read(job.out().join("georeference.json")).unwrap()).unwrap();
        // However the file rounds it.
        assert_eq!(georeference["metres_per_unit_z"], 1200.0 / 3937.0);
    }
}

#[test]
fn a_file_of_unknown_datum_does_not_let_two_datums_pass() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, system: String| write(folder.path(), name, &[text(&system)]);
    const WGS84: &str = r#""WGS_1984",6378137.0,298.257223563"#;
    let named = esri("Unknown", GRS80).replace("UTM_15N", "Zone 15");
    let [unknown, nad83, wgs84] = [
        write("unknown.las", named),
        write("nad83.las", esri("North_American_1983", GRS80)),
        write("wgs84.las", esri("WGS_1984", WGS84)),
    ];
    for files in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
        let files = files.map(|index| [&unknown, &nad83, &wgs84][index]);
        Job::on(&files).run().refused(2, &["nad83.las", "wgs84.las", "the datum (", "WGS_1984", "one CRS"]);
    }
    for files in [[&unknown, &nad83], [&nad83, &unknown]] {
        let report = Job::on(&files).report();
        let said = warnings(&report);
        assert!(said.contains("1 of 2 inputs have no datum, such as") && said.contains("unknown.las"), "{said}");
        assert!(said.contains("GCS_North_American_1983 assumed"), "{said}");
        assert_eq!(report["crs"], "UTM_15N");
    }
    assert!(!warnings(&Job::on(&[&unknown]).report()).contains("have no datum"));
}

#[test]
fn a_projection_without_its_origin_is_not_placed_and_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let whole = esri("North_American_1983", GRS80);
    let lost = whole.replace(r#"PARAMETER["Central_Meridian",-93.0],"#, "");
    let unreadable = whole.replace("-93.0", "nan");
    // There are fewer doubles than the key points at.
    let defined = [
        [1024, 0, 1, 1],
        [2048, 0, 1, 4269],
        [3072, 0, 1, 32767],
        [3075, 0, 1, 1],
        [3076, 0, 1, 9001],
        [3080, 34736, 1, 90],
    ];
    for (name, record, what) in [
        ("lost.las", text(&lost), "it does not give the longitude of the origin"),
        ("unreadable.las", text(&unreadable), "its Central_Meridian is no number"),
        ("keys.las", keys(&defined), "GeoTIFF key 3080 has no number that can be read"),
    ] {
        let file = write(folder.path(), name, &[record]);
        let job = Job::on(&[&file]);
        let said = warnings(&job.report());
        assert!(said.contains(name) && said.contains(what) && said.contains("globe"), "{said}");
        let tileset: Value = serde_json::from_slice(&fs::read(job.out().join("tileset.json")).unwrap()).unwrap();
        assert!(tileset["root"].get("transform").is_none(), "{tileset}");
    }
    let file = write(folder.path(), "plain.las", &[]);
    let given = Job::on(&[&file]).with("input", &format!("crs = '''{lost}'''")).report();
    assert!(warnings(&given).contains("[input] crs (UTM_15N): the place of its coordinates is unknown"), "{given}");
}

#[test]
fn a_unit_that_is_no_length_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let whole = esri("North_American_1983", GRS80);
    for (unit, shown) in [("0", "0"), ("-1", "-1"), ("nan", "NaN")] {
        let system = whole.replace(r#""Meter",1.0"#, &format!(r#""Meter",{unit}"#));
        let file = write(folder.path(), "bad.las", &[text(&system)]);
        let said = warnings(&Job::on(&[&file]).report());
        let named = format!("its coordinate system (UTM_15N): its unit of x and y is Meter with {shown}");
        assert!(said.contains("bad.las") && said.contains(&named), "{said}");
        assert!(said.contains("no input states a known unit of length"), "{said}");
    }
}

#[test]
fn degrees_in_the_hundred_thousands_are_a_plane_in_metres() {
    let folder = tempfile::tempdir().unwrap();
    let degrees = keys(&[[1024, 0, 1, 2], [2048, 0, 1, 4326]]);
    let scan = write(folder.path(), "scan.las", &[degrees]);
    let job = Job::on(&[&scan]);
    let report = job.report();
    let said = warnings(&report);
    assert!(said.contains("scan.las") && said.contains("WGS 84") && said.contains("in degrees, but x"), "{said}");
    assert_eq!((report["unit"].as_str(), report["crs"].as_str()), (Some("metre"), None));
    job.verified();
    let given = Job::on(&[&scan]).with("input", "crs = \"EPSG:26915\"").report();
    assert_eq!(given["crs"], "NAD83 / UTM zone 15N");
}

#[test]
fn nad83_2011_by_parameters_is_placed_on_the_globe() {
    let folder = tempfile::tempdir().unwrap();
    let file = write(folder.path(), "new.las", &[text(&esri("NAD_1983_2011", GRS80))]);
    let coded = write(folder.path(), "coded.las", &[code(6344)]);
    assert_eq!(warnings(&ellipsoidal(&[&file, &coded]).report()), "[]");
    assert_eq!(warnings(&ellipsoidal(&[&file]).report()), "[]");
    let Some(shared) = shared() else { return };
    let real = ellipsoidal(&[shared.join("data/file_with_both_wkt_and_geotiff_vlrs.las")]).report();
    assert!(!warnings(&real).contains("globe"), "{real}");
}

#[test]
fn a_text_is_placed_on_the_globe_by_the_crs_that_the_user_names() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cloud.csv");
    let rows: String =
        (0..100).map(|i| format!("{},{},{}\n", 500_000 + i % 10 * 7, 4_000_000 + i / 10 * 9, i % 3)).collect();
    fs::write(&path, rows).unwrap();
    assert!(warnings(&Job::on(&[&path]).report()).contains("globe"));
    let report = ellipsoidal(&[&path]).with("input", "crs = \"EPSG:26915+6360\"").report();
    let said = warnings(&report);
    assert!(!said.contains("globe") && !said.contains("unit of its coordinates"), "{said}");
    assert!(said.contains("heights are in another unit"), "{said}");
}

/// Runs a job on a table in this system.
fn table_job(folder: &Path, code: u32, [x, y]: [i32; 2]) -> Job {
    let path = folder.join(format!("{code}.csv"));
    let rows: String = (0..100).map(|i| format!("{},{},{}\n", x + i % 10 * 7, y + i / 10 * 9, i % 3)).collect();
    fs::write(&path, rows).unwrap();
    ellipsoidal(&[&path]).with("input", &format!("crs = \"EPSG:{code}\""))
}

#[test]
fn oblique_maps_and_other_meridians_are_placed_to_a_millimetre() {
    let folder = tempfile::tempdir().unwrap();
    for (code, place) in [(2056, [2_683_000, 1_247_000]), (5514, [-743_000, -1_043_000]), (27572, [600_000, 2_427_000])]
    {
        let job = table_job(folder.path(), code, place);
        let said = warnings(&job.report());
        assert!(!said.contains("globe"), "EPSG:{code}: {said}");
        let globe = georeference(&job, "globe");
        let [x, y, z] = numbers(&georeference(&job, "offset")).unwrap();
        let own = globe["definition"].as_str().unwrap();
        let [own, degrees, earth] = [own, "+proj=longlat +datum=WGS84", "+proj=geocent +datum=WGS84"]
            .map(|definition| Proj::from_proj_string(definition).unwrap());
        let mut place = (x, y, z);
        transform(&own, &degrees, &mut place).unwrap();
        // Heights stay as they are.
        place.2 = z;
        transform(&degrees, &earth, &mut place).unwrap();
        let columns: [f64; 16] = numbers(&globe["transform"]).unwrap();
        let off = distance([columns[12], columns[13], columns[14]], [place.0, place.1, place.2]);
        assert!(off < 0.001, "EPSG:{code}: {off} m");
    }
}

#[test]
fn a_map_that_is_not_computed_is_not_placed_and_is_named() {
    let folder = tempfile::tempdir().unwrap();
    for (code, place, what) in [
        (5513, [-743_000, -1_043_000], "S-JTSK / Krovak (EPSG:5513): its x grows to the west"),
        (
            27200,
            [2_660_000, 5_990_000],
            "NZGD49 / New Zealand Map Grid (EPSG:27200): its projection is New_Zealand_Map_Grid",
        ),
    ] {
        let job = table_job(folder.path(), code, place);
        let said = warnings(&job.report());
        assert!(said.contains(&format!("not placed on the globe: gdt-batch does not support {what}")), "{said}");
        assert!(said.contains("pdal translate"), "{said}");
        job.verified();
        let tileset: Value = serde_json::from_slice(&fs::read(job.out().join("tileset.json")).unwrap()).unwrap();
        assert!(tileset["root"].get("transform").is_none(), "EPSG:{code}: {tileset}");
    }
}

#[test]
fn a_crs_that_is_not_known_is_an_error_of_the_configuration() {
    let folder = tempfile::tempdir().unwrap();
    let file = write(folder.path(), "a.las", &[]);
    Job::on(&[&file]).with("input", "crs = \"UTM 15\"").run().refused(2, &["line", "EPSG:26915", "well-known text"]);
    Job::on(&[&file]).with("input", "crs = \"EPSG:4978\"").run().refused(2, &["geocentric"]);
    let urn = "crs = \"urn:ogc:def:crs:EPSG::1\"";
    Job::on(&[&file]).with("input", urn).run().refused(2, &["line", "EPSG:1 is not"]);
}

#[test]
fn urns_and_urls_name_systems_as_codes_do() {
    let folder = tempfile::tempdir().unwrap();
    let file = write(folder.path(), "a.las", &[]);
    let report = |lines: &str| Job::on(&[&file]).with("input", lines).report();
    let version = "urn:ogc:def:crs:EPSG:9.6.2:26915";
    for crs in ["urn:ogc:def:crs:EPSG::26915", version, "http://www.opengis.net/def/crs/EPSG/0/26915"] {
        for key in ["crs", "missing_crs"] {
            assert_eq!(report(&format!("{key} = \"{crs}\""))["crs"], "NAD83 / UTM zone 15N", "{key} {crs}");
        }
    }
    let compound = "urn:ogc:def:crs,crs:EPSG::26915,crs:EPSG::6360";
    assert!(warnings(&report(&format!("crs = \"{compound}\""))).contains("heights are in another unit"));
    let path = folder.path().join("degrees.csv");
    let place = |i: usize| [-93.0 + (i % 10) as f64 * 1e-4, 45.0 + (i / 10) as f64 * 1e-4];
    let rows = (0..60).map(|i| format!("{:.6},{:.6},{}\n", place(i)[0], place(i)[1], i % 3)).collect::<String>();
    fs::write(&path, rows).unwrap();
    let lines = "missing_crs = \"urn:ogc:def:crs:OGC:1.3:CRS84\"\nto_crs = \"urn:ogc:def:crs:EPSG::32615\"";
    let moved = Job::on(&[&path]).with("input", lines).report();
    assert_eq!(moved["crs"], "WGS 84 / UTM zone 15N");
    assert_eq!(moved["transformations"][0]["inputs"], 1);
}

#[test]
fn northings_that_are_as_great_as_the_radius_of_the_earth_are_no_geocentric_coordinates() {
    let folder = tempfile::tempdir().unwrap();
    let file = write(folder.path(), "north.las", &[keys(&[[2048, 0, 1, 4978]])]);
    move_to(&file, [560_000.0, 6_353_000.0, 20.0]);
    // The points reach 200 m from there.
    let mut bytes = fs::read(&file).unwrap();
    [131, 139].into_iter().for_each(|at| bytes[at..at + 8].copy_from_slice(&0.1f64.to_le_bytes()));
    fs::write(&file, bytes).unwrap();
    let said = warnings(&Job::on(&[&file]).report());
    assert!(said.contains("is geocentric, but its points would be vertical near the equator"), "{said}");
}

#[test]
fn a_file_without_a_system_whose_coordinates_look_like_degrees_is_named() {
    let folder = tempfile::tempdir().unwrap();
    for (name, records) in [("bare.las", vec![]), ("false.las", vec![keys(&[[2048, 0, 1, 4978]])])] {
        let file = write(folder.path(), name, &records);
        let mut bytes = fs::read(&file).unwrap();
        let write = |bytes: &mut [u8], at: usize, value: f64| bytes[at..at + 8].copy_from_slice(&value.to_le_bytes());
        for (axis, (scale, place, half)) in
            [(1e-7, 7.1, 0.01), (1e-7, 51.2, 0.01), (0.01, 300.0, 40.0)].into_iter().enumerate()
        {
            write(&mut bytes, 131 + 8 * axis, scale);
            write(&mut bytes, 155 + 8 * axis, place);
            write(&mut bytes, 179 + 16 * axis, place + half);
            write(&mut bytes, 187 + 16 * axis, place - half);
        }
        fs::write(&file, bytes).unwrap();
        let words = "look like longitude and latitude, but are treated as lengths";
        let job = |line: &str| Job::on(&[&file]).with("input", line);
        assert!(warnings(&job("").report()).contains(words), "{name}");
        assert!(!warnings(&job("crs = \"none\"").report()).contains(words), "{name}");
    }
}
