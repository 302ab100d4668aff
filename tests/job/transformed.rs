//! Jobs whose points are transformed into one coordinate reference system.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use crs::{Crs, CrsTransform, DatumRule, NamedCrs};

use crate::coordinate_systems::{add_records, code, keys, text, warnings};
use crate::program::{Job, gdt_batch, number};

/// Both lie between two zones of UTM.
const MIDDLE: [f64; 2] = [-90.0, 45.0];

fn crs(code: &str) -> Crs {
    *NamedCrs::try_from(code.to_string()).unwrap().crs
}

/// Returns the way from one system to another.
pub(crate) fn way(from: &str, to: &str) -> CrsTransform {
    CrsTransform::between(&crs(from), &crs(to), DatumRule::Strict).unwrap()
}

/// Returns places around the middle with heights, as if a survey had measured them: `share` of three.
pub(crate) fn places(share: usize) -> Vec<[f64; 3]> {
    let place = |i: usize| {
        let (column, row) = ((i % 40) as f64, (i / 40) as f64);
        let wobble = ((i * 7919) % 101) as f64 / 101.0;
        [
            MIDDLE[0] + (column - 20.0 + wobble) * 2e-5,
            MIDDLE[1] + (row - 20.0 + 0.7 * wobble) * 1.5e-5,
            200.0 + 5.0 * wobble + 0.1 * column,
        ]
    };
    (0..1600).filter(|i| i % 3 == share).map(place).collect()
}

/// Writes the places as a text in this system, with so many decimals.
pub(crate) fn survey(folder: &Path, name: &str, system: &str, share: usize, decimals: usize) -> PathBuf {
    let way = way("EPSG:4269", system);
    let mut rows = String::from(if system == "EPSG:4269" { "lat,lon,z\n" } else { "x,y,z\n" });
    for [longitude, latitude, z] in places(share) {
        let [x, y] = way.apply([longitude, latitude]).unwrap();
        let [first, second] = if system == "EPSG:4269" { [y, x] } else { [x, y] };
        writeln!(rows, "{first:.decimals$},{second:.decimals$},{z:.2}").unwrap();
    }
    let path = folder.join(name);
    fs::write(&path, rows).unwrap();
    path
}

/// Makes a LAS file with these records of systems out of a text in that system.
pub(crate) fn las(folder: &Path, survey: &Path, name: &str, records: &[(u16, Vec<u8>)], scale: f64) -> PathBuf {
    let rows: Vec<[f64; 3]> = fs::read_to_string(survey)
        .unwrap()
        .lines()
        .skip(1)
        .map(|line| {
            let mut numbers = line.split(',').map(|number| number.parse().unwrap());
            std::array::from_fn(|_| numbers.next().unwrap())
        })
        .collect();
    las_of(folder, &rows, name, records, scale)
}

pub(crate) fn las_of(folder: &Path, rows: &[[f64; 3]], name: &str, records: &[(u16, Vec<u8>)], scale: f64) -> PathBuf {
    let mut bytes = vec![0u8; 227];
    bytes[..4].copy_from_slice(b"LASF");
    (bytes[24], bytes[25]) = (1, 2);
    bytes[94..96].copy_from_slice(&227u16.to_le_bytes());
    add_records(&mut bytes, records);
    bytes[105..107].copy_from_slice(&20u16.to_le_bytes());
    bytes[107..111].copy_from_slice(&(rows.len() as u32).to_le_bytes());
    let least = [0, 1, 2].map(|axis| rows.iter().map(|row| row[axis]).fold(f64::INFINITY, f64::min));
    let steps = [scale, scale, 0.01];
    for (axis, (step, least)) in steps.into_iter().zip(least).enumerate() {
        bytes[131 + 8 * axis..][..8].copy_from_slice(&step.to_le_bytes());
        bytes[155 + 8 * axis..][..8].copy_from_slice(&least.floor().to_le_bytes());
        let greatest = rows.iter().map(|row| row[axis]).fold(f64::NEG_INFINITY, f64::max);
        bytes[179 + 16 * axis..][..8].copy_from_slice(&greatest.to_le_bytes());
        bytes[187 + 16 * axis..][..8].copy_from_slice(&least.to_le_bytes());
    }
    for row in rows {
        let raw = |axis: usize| ((row[axis] - least[axis].floor()) / steps[axis]).round() as i32;
        bytes.extend([0, 1, 2].map(raw).iter().flat_map(|raw| raw.to_le_bytes()));
        bytes.extend([0; 8]);
    }
    let path = folder.join(name);
    fs::write(&path, bytes).unwrap();
    path
}

/// A survey in two zones of UTM, as LAS, and in degrees, as text.
fn three_surveys(folder: &Path) -> [PathBuf; 3] {
    let zone = |code_15: u16, share: usize| {
        let survey = survey(folder, &format!("{code_15}.csv"), &format!("EPSG:{code_15}"), share, 3);
        las(folder, &survey, &format!("{code_15}.las"), &[code(code_15)], 0.001)
    };
    [zone(26915, 0), zone(26916, 1), survey(folder, "degrees.csv", "EPSG:4269", 2, 9)]
}

fn in_zone_15(files: &[PathBuf]) -> Job {
    Job::on(files).with("input", "missing_crs = \"EPSG:4269\"\nto_crs = \"EPSG:26915\"")
}

#[test]
fn two_zones_and_degrees_give_one_mesh() {
    let folder = tempfile::tempdir().unwrap();
    let files = three_surveys(folder.path());
    let whole = in_zone_15(&files);
    let report = whole.report();
    assert_eq!((number(&report["sites"]), report["crs"].as_str()), (1600, Some("NAD83 / UTM zone 15N")));
    let found = report["transformations"].as_array().unwrap();
    let from: Vec<&str> = found.iter().map(|way| way["from"].as_str().unwrap()).collect();
    assert_eq!(from, ["NAD83 / UTM zone 16N (EPSG:26916)", "NAD83 (EPSG:4269)"], "{report}");
    assert!(found.iter().all(|way| way["to"] == "NAD83 / UTM zone 15N (EPSG:26915)" && way["step"] == "0.001"));
    let digest = whole.verified()["digest"].as_str().unwrap().to_owned();
    assert_eq!(in_zone_15(&files).tiles_of(100).threads(1).digest(), digest);
    // Tasks read the transforms back from the plan.
    let parts = in_zone_15(&files).tiles_of(100).with("triangulation", "max_points_per_part = 400");
    let config = parts.config();
    let arguments = ["submit", config.to_str().unwrap(), "--engine", "local", "--tasks", "2"];
    gdt_batch(parts.folder(), &arguments).succeeded();
    assert_eq!(parts.verified()["digest"].as_str().unwrap(), digest);
    // The inputs prove the vertices, transformed in the same way.
    let mut arguments = vec!["verify", "out", "--input"];
    arguments.extend(files.iter().map(|file| file.to_str().unwrap()));
    gdt_batch(whole.folder(), &arguments).succeeded();
    fs::remove_file(&files[2]).unwrap();
    survey(folder.path(), "degrees.csv", "EPSG:4269", 1, 9);
    assert_eq!(gdt_batch(whole.folder(), &arguments).code, 4);
}

#[test]
fn the_mesh_of_several_systems_is_that_of_one_survey() {
    let folder = tempfile::tempdir().unwrap();
    let report = in_zone_15(&three_surveys(folder.path())).report();
    let way = way("EPSG:4269", "EPSG:26915");
    let rows = (0..3).flat_map(places).map(|[x, y, z]| {
        let [x, y] = way.apply([x, y]).unwrap();
        format!("{x:.3},{y:.3},{z:.2}\n")
    });
    let one = folder.path().join("one.csv");
    fs::write(&one, rows.collect::<String>()).unwrap();
    let one = Job::on(&[one]).with("input", "crs = \"EPSG:26915\"").report();
    // What was rounded decides a few edges, and the hull.
    let [own, other] = [&report, &one].map(|report| number(&report["triangles"]));
    assert!(own.abs_diff(other) * 100 < other, "{own} {other}");
}

#[test]
fn what_is_not_said_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let files = three_surveys(folder.path());
    let zone = Job::on(&files).with("input", "missing_crs = \"EPSG:4269\"\nto_crs = \"utm\"");
    let said = zone.run_with(&["check"]).succeeded().out;
    assert!(said.contains("transformed") && said.contains("NAD83 / UTM zone 1"), "{said}");
    let said = gdt_batch(folder.path(), &["info", "degrees.csv"]).succeeded().out;
    assert!(said.contains("to_crs"), "{said}");
    Job::on(&files[..2]).run().refused(2, &["26915.las", "26916.las", "to_crs"]);
    Job::on(&files).with("input", "to_crs = \"EPSG:26915\"").run().refused(2, &["degrees.csv", "missing_crs"]);
    Job::on(&files[2..]).run().refused(2, &["degrees.csv", "to_crs"]);
    for (line, words) in [
        ("to_crs = \"zone 15\"", ["to_crs may be", "zone 15"]),
        ("to_crs = \"EPSG:1\"", ["to_crs may be", "EPSG:1 is not in the list"]),
        ("crs = \"EPSG:26915\"\nmissing_crs = \"EPSG:4269\"", ["missing_crs", "leave one of them out"]),
    ] {
        Job::on(&files).with("input", line).run().refused(2, &words);
    }
}

#[test]
fn a_crs_for_files_without_one_and_for_those_with_a_false_one() {
    let folder = tempfile::tempdir().unwrap();
    let survey = survey(folder.path(), "zone.csv", "EPSG:26916", 0, 2);
    let [plain, wrong] = [("plain.las", &[][..]), ("wrong.las", &[code(26915)][..])]
        .map(|(name, records)| las(folder.path(), &survey, name, records, 0.01));
    let right = las(folder.path(), &survey, "right.las", &[code(26916)], 0.01);
    let job = |file: &Path, crs: &str| Job::on(&[file]).with("input", &format!("to_crs = \"EPSG:26915\"\n{crs}"));
    let expected = job(&right, "").digest();
    for (file, line) in
        [(&plain, "crs = \"EPSG:26916\""), (&plain, "missing_crs = \"EPSG:26916\""), (&wrong, "crs = \"EPSG:26916\"")]
    {
        let job = job(file, line);
        let report = job.report();
        assert_eq!(job.verified()["digest"].as_str().unwrap(), expected, "{line}");
        assert_eq!(warnings(&report).contains("overrides its CRS"), file == &wrong, "{report}");
    }
    job(&plain, "").run().refused(2, &["plain.las", "names no CRS", "missing_crs"]);
    job(&plain, "crs = \"none\"").run().refused(2, &["to_crs needs their CRS"]);
    // What is there already keeps its coordinates.
    let there = Job::on(&[&right]).with("input", "to_crs = \"EPSG:26916\"");
    assert_eq!(there.digest(), Job::on(&[&right]).digest());
    assert_eq!(there.report().get("transformations"), None);
    // Records that cannot be true are no CRS.
    let degrees = las(folder.path(), &survey, "degrees.las", &[keys(&[[1024, 0, 1, 2], [2048, 0, 1, 4326]])], 0.01);
    job(&degrees, "").run().refused(2, &["degrees.las", "names no CRS"]);
}

#[test]
fn shifts_of_datums_and_heights_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let survey = survey(folder.path(), "zone.csv", "EPSG:26915", 0, 2);
    let old = las(folder.path(), &survey, "old.las", &[code(26715)], 0.01);
    let new = las(folder.path(), &survey, "new.las", &[code(26915)], 0.01);
    let to = |file: &Path, line: &str| Job::on(&[file]).with("input", line);
    to(&old, "to_crs = \"EPSG:26915\"\ndatums = \"close\"")
        .run()
        .refused(2, &["old.las", "NAD27", "us_noaa_conus.tif", "does not do"]);
    to(&new, "to_crs = \"EPSG:32615\"").run().refused(2, &["NAD83", "WGS 84", "datums = \"close\""]);
    let close = to(&new, "to_crs = \"EPSG:32615\"\ndatums = \"close\"").report();
    assert!(warnings(&close).contains("no datum shift between NAD83 and WGS 84"), "{close}");
    to(&new, "to_crs = \"EPSG:4326\"").run().refused(2, &["to_crs", "not a map"]);
    to(&new, "to_crs = \"EPSG:5513\"\ncrs = \"EPSG:4156\"").run().refused(2, &["Krovak"]);
    let heights = |name: &str| {
        let plane = crs("EPSG:26916").wkt.unwrap();
        let compound = format!(r#"COMPD_CS["c",{plane},VERT_CS["{name}",VERT_DATUM["{name}",2005],UNIT["metre",1]]]"#);
        las(folder.path(), &survey, &format!("{name}.las"), &[text(&compound)], 0.01)
    };
    let [navd, egm] = ["NAVD88 height", "EGM96 height"].map(heights);
    let job = Job::on(&[&navd, &egm]).with("input", "to_crs = \"EPSG:26915\"");
    job.run().refused(2, &["NAVD88", "EGM96", "needs a geoid grid"]);
    to(&egm, "to_crs = \"EPSG:26915+5703\"").run().refused(2, &["EGM96", "[input] to_crs", "the datum of heights"]);
}

#[test]
fn points_beyond_the_area_of_a_projection_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let mut rows: Vec<[f64; 3]> = places(0);
    rows.push([-20.0, 10.0, 0.0]);
    let file = las_of(folder.path(), &rows, "far.las", &[keys(&[[1024, 0, 1, 2], [2048, 0, 1, 4269]])], 1e-7);
    let job = |line: &str| Job::on(&[&file]).with("input", &format!("to_crs = \"EPSG:26915\"\n{line}"));
    job("").run().refused(3, &["far.las", "outside the area of NAD83 / UTM zone 15N", "x = -20, y = 10"]);
    let few = job("max_malformed_fraction = 0.01").report();
    assert_eq!((number(&few["points"]["malformed"]), number(&few["points"]["kept"])), (1, rows.len() as u64 - 1));
    // Bounds are in the system of the job.
    let [x, y] = way("EPSG:4269", "EPSG:26915").apply(MIDDLE).unwrap();
    let bounds = format!("bounds = [{}, {}, {x}, {y}]", x - 25.0, y - 25.0);
    let within = job(&bounds).report();
    let (kept, out) = (number(&within["points"]["kept"]), number(&within["points"]["out_of_bounds"]));
    assert!(kept > 50 && kept < 500 && kept + out == rows.len() as u64, "{within}");
}

#[test]
fn feet_and_metres_become_one_unit() {
    let folder = tempfile::tempdir().unwrap();
    let all: Vec<[f64; 3]> = places(0);
    let way = way("EPSG:4269", "EPSG:26915");
    let metres: Vec<[f64; 3]> =
        all.iter().map(|&[x, y, z]| way.apply([x, y]).map(|[x, y]| [x, y, z]).unwrap()).collect();
    let feet: Vec<[f64; 3]> = metres.iter().map(|place| place.map(|value| value * 3937.0 / 1200.0)).collect();
    let metres = las_of(folder.path(), &metres, "metres.las", &[code(26915)], 0.01);
    let plane = keys(&[[1024, 0, 1, 1], [3072, 0, 1, 26915], [3076, 0, 1, 9003], [4099, 0, 1, 9003]]);
    let feet = las_of(folder.path(), &feet, "feet.las", &[plane], 0.01);
    let report = Job::on(&[&feet]).with("input", "to_crs = \"EPSG:26915+5703\"").report();
    assert_eq!(report["unit"], "metre");
    let way = &report["transformations"][0];
    assert!(way["heights"].as_str().unwrap().starts_with("times 0.3048"), "{report}");
    let both = Job::on(&[&metres, &feet]).with("input", "to_crs = \"EPSG:26915+5703\"");
    let lattice = &both.report()["lattice"];
    // A hundredth of a foot is finer than a hundredth of a metre.
    assert_eq!((lattice["resolution"].as_str(), lattice["resolution_z"].as_str()), (Some("0.001"), Some("0.001")));
    both.verified();
}
