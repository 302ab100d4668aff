//! Cut and fill between terrains, and heights along lines.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;
use tempfile::TempDir;
use tiff::decoder::{Decoder, DecodingResult};
use tiles::color::from_srgb;
use tiles::gltf::read::read_tile;

use crate::clouds::{self, Cloud};
use crate::program::{Job, Said, gdt_batch, gdt_batch_with};
use crate::tileset::files_below;

/// The member of GeoJSON that states the CRS of the terrains here.
const CRS: &str = r#"{"type":"name","properties":{"name":"urn:ogc:def:crs:EPSG::26915"}}"#;

/// The CRS of the clouds, which lie far from where it is used.
const CRS_OF_CLOUDS: &str = "crs = \"EPSG:26915\"\noutside_crs_area = \"warn\"";

/// A flat square of points `step` apart, from `from` to `to` along both axes.
fn flat([from, to]: [i64; 2], step: usize, z: i64) -> Cloud {
    let along = || (from..=to).step_by(step);
    along().flat_map(|x| along().map(move |y| [x, y, z])).collect()
}

/// A terrain at height 10, and one of 5 metres more over its middle, in other tiles.
pub(crate) struct Surveys {
    _clouds: TempDir,
    pub(crate) before: Job,
    pub(crate) after: Job,
}

pub(crate) fn surveys() -> Surveys {
    let folder = tempfile::tempdir().unwrap();
    let before = clouds::write(folder.path(), "before.csv", &flat([0, 1000], 25, 10));
    let after = clouds::write(folder.path(), "after.csv", &flat([100, 900], 16, 15));
    let job = |file: &Path, sites: u64| Job::on(&[file]).tiles_of(sites).with("input", CRS_OF_CLOUDS);
    let surveys = Surveys { before: job(&before, 300), after: job(&after, 900), _clouds: folder };
    for job in [&surveys.before, &surveys.after] {
        job.run().succeeded();
    }
    surveys
}

impl Surveys {
    pub(crate) fn diff(&self, added: &[&str]) -> Said {
        let [before, after] = [self.before.out(), self.after.out()].map(|out| out.to_str().unwrap().to_owned());
        gdt_batch(self.before.folder(), &[&["diff", &before, &after], added].concat())
    }

    /// Writes a file with a named square, and one with a hole.
    pub(crate) fn write_areas(&self) -> String {
        let square = |at: i64, side: i64| {
            let [low, high] = [at, at + side];
            format!("[[{low},{low}],[{high},{low}],[{high},{high}],[{low},{high}],[{low},{low}]]")
        };
        let feature = |properties: &str, rings: &[String]| {
            let rings = rings.join(",");
            format!(
                r#"{{"type":"Feature","properties":{properties},"geometry":{{"type":"Polygon","coordinates":[{rings}]}}}}"#
            )
        };
        let features =
            [feature(r#"{"name":"yard"}"#, &[square(200, 200)]), feature("{}", &[square(50, 600), square(300, 100)])];
        let features = features.join(",");
        let file = self.before.folder().join("areas.geojson");
        fs::write(&file, format!(r#"{{"type":"FeatureCollection","crs":{CRS},"features":[{features}]}}"#)).unwrap();
        file.to_str().unwrap().to_owned()
    }
}

#[track_caller]
fn near(found: &Value, wanted: f64) {
    let found = found.as_f64().unwrap();
    assert!((found - wanted).abs() <= 1e-9 * wanted.abs(), "{found} is not {wanted}");
}

#[test]
fn a_box_of_fill_has_its_volume_whatever_the_tiles() {
    let surveys = surveys();
    let file = surveys.write_areas();
    let found = surveys.diff(&["--json", "--areas", &file]).succeeded().json();
    near(&found["fill"], 5.0 * 800.0 * 800.0);
    near(&found["net"], 5.0 * 800.0 * 800.0);
    near(&found["area"], 800.0 * 800.0);
    near(&found["area_before_only"], 1000.0 * 1000.0 - 800.0 * 800.0);
    near(&found["max_rise"], 5.0);
    for nothing in ["cut", "area_after_only", "max_fall"] {
        assert_eq!(found[nothing], 0.0, "{nothing}");
    }
    let [yard, ring] = [&found["areas"][0], &found["areas"][1]];
    assert_eq!((&yard["name"], &yard["number"], &ring["name"]), (&"yard".into(), &1.into(), &Value::Null));
    near(&yard["fill"], 5.0 * 200.0 * 200.0);
    // From 100 on, without the hole.
    near(&ring["fill"], 5.0 * (550.0 * 550.0 - 100.0 * 100.0));
    let higher = surveys.diff(&["--json", "--threshold", "5.5"]).succeeded().json();
    assert_eq!((&higher["fill"], &higher["areas"]), (&0.0.into(), &Value::Null));
    let text = surveys.diff(&[]).succeeded().out;
    assert!(text.contains("fill") && text.contains("3200000.000 m³"), "{text}");
    difference_as_files(&surveys);
    damaged_results_are_refused(&surveys);
}

/// Where the square of 800 m has risen by 5 m, and nowhere else, cells have that difference and vertices the colour of it.
fn difference_as_files(surveys: &Surveys) {
    let out = surveys.before.folder().join("changes");
    let named = out.to_str().unwrap();
    let written = surveys.diff(&["--json", "-o", named, "--resolution", "10"]).succeeded().json();
    let [raster, mesh] = ["raster", "mesh"].map(|kind| &written["written"][kind]);
    assert_eq!((&raster["size"], &raster["cells"]), (&serde_json::json!([80, 80]), &6400.into()));
    near(&mesh["legend"]["range"], 5.0);
    let tileset: Value = serde_json::from_slice(&fs::read(out.join("tileset.json")).unwrap()).unwrap();
    assert_eq!(tileset["asset"]["extras"]["difference"], mesh["legend"]);
    let mut decoder = Decoder::new(fs::File::open(out.join("difference.tif")).unwrap()).unwrap();
    let DecodingResult::F32(cells) = decoder.read_image().unwrap() else { panic!() };
    assert!(cells.iter().all(|cell| *cell == 5.0));
    let blue = &mesh["legend"]["colors"][4];
    for path in files_below(&out.join("tiles")) {
        let plain = surveys.after.out().join(path.strip_prefix(&out).unwrap());
        let [colored, plain] = [&path, &plain].map(|path| read_tile(path).unwrap());
        assert_eq!(colored.extras, plain.extras);
        for (colored, plain) in colored.parts.iter().zip(&plain.parts) {
            assert_eq!((colored.translation, colored.scale), (plain.translation, plain.scale));
            assert_eq!(colored.positions.len(), plain.positions.len());
            let colors = colored.colors.as_ref().unwrap();
            let near_blue = |[color, wanted]: [u16; 2]| color.abs_diff(wanted) <= 257;
            let wanted = [0, 1, 2].map(|k| from_srgb([blue[k].as_u64().unwrap() as u8; 3])[0]);
            assert!(colors.iter().all(|color| (0..3).all(|k| near_blue([color[k], wanted[k]]))), "{path:?}");
        }
    }
    // Again, on one thread: the same bytes in place of those before.
    let contents = || {
        let named = |path: PathBuf| (path.clone(), fs::read(path).unwrap());
        files_below(&out).into_iter().map(named).collect::<BTreeMap<_, _>>()
    };
    let before = contents();
    let added = ["-o", named, "--resolution", "10"];
    let paths = [surveys.before.out(), surveys.after.out()].map(|out| out.to_str().unwrap().to_owned());
    let again = [&["diff", &paths[0], &paths[1]], &added[..]].concat();
    gdt_batch_with(surveys.before.folder(), &again, &[("GDT_PROCESSORS", "1")]).succeeded();
    assert!(contents() == before);
    // No folder with anything else in it is touched.
    let after = surveys.after.out();
    surveys.diff(&["-o", after.to_str().unwrap()]).refused(2, &["overwrites only what diff has written"]);
    fs::write(out.join("notes.txt"), "").unwrap();
    surveys.diff(&["-o", named]).refused(2, &["notes.txt"]);
    surveys.diff(&["--resolution", "1"]).refused(2, &["--output"]);
}

fn damaged_results_are_refused(surveys: &Surveys) {
    let tile = surveys.after.out().join("tiles/000000.glb");
    let mut bytes = fs::read(&tile).unwrap();
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    fs::write(&tile, bytes).unwrap();
    surveys.diff(&[]).refused(3, &["000000.glb", "checksum"]);
    fs::remove_file(surveys.after.out().join("report.json")).unwrap();
    surveys.diff(&[]).refused(2, &["has no report.json"]);
}

#[test]
fn a_terrain_against_itself_in_other_tiles_is_exactly_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = clouds::write(folder.path(), "cloud.csv", &clouds::uniform(4000, 30_000, 5));
    let jobs = [300, 1500].map(|sites| Job::on(&[&cloud]).tiles_of(sites).with("output", "hull = \"whole\""));
    for job in &jobs {
        job.run().succeeded();
    }
    // By their configurations.
    let [before, after] = jobs.each_ref().map(|job| job.config().to_str().unwrap().to_owned());
    let found = gdt_batch(folder.path(), &["diff", &before, &after, "--json"]).succeeded().json();
    assert!(found["area"].as_f64().unwrap() > 1e8);
    for nothing in ["cut", "fill", "net", "area_before_only", "area_after_only", "max_rise", "max_fall"] {
        assert_eq!(found[nothing], 0.0, "{nothing}");
    }
}

#[test]
fn terrains_in_other_systems_are_not_compared() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = clouds::write(folder.path(), "cloud.csv", &flat([0, 100], 10, 3));
    let out = |input: &str| {
        let job = Job::on(&[&cloud]).with("input", input);
        job.run().succeeded();
        job
    };
    let [zone, other, feet, plane] = [
        CRS_OF_CLOUDS,
        "crs = \"EPSG:26916\"\noutside_crs_area = \"warn\"",
        "crs = \"none\"\nunit = \"foot\"",
        "crs = \"none\"\nunit = \"metre\"",
    ]
    .map(out);
    let diff = |before: &Job, after: &Job| {
        let [before, after] = [before, after].map(|job| job.out().to_str().unwrap().to_owned());
        gdt_batch(folder.path(), &["diff", &before, &after])
    };
    diff(&zone, &other).refused(2, &["EPSG:26915", "EPSG:26916", "to_crs"]);
    diff(&feet, &plane).refused(2, &["the unit of x and y"]);
    let said = diff(&zone, &plane).succeeded().out;
    assert!(said.contains("warning: the CRS of") && said.contains("is unknown"), "{said}");
}

#[test]
fn a_profile_has_the_same_rows_whatever_the_tiles() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = clouds::write(folder.path(), "cloud.csv", &clouds::uniform(3000, 30_000, 6));
    let places = "[[-900.25,-700.5],[14000.75,16000.125],[29000,2000]]";
    let geometry = format!(r#"{{"type":"LineString","coordinates":{places}}}"#);
    let line = format!(r#"{{"type":"Feature","crs":{CRS},"properties":{{"name":"a, b"}},"geometry":{geometry}}}"#);
    let lines = folder.path().join("lines.geojson");
    fs::write(&lines, line).unwrap();
    let profile = |sites: u64| {
        let job = Job::on(&[&cloud]).tiles_of(sites).with("input", CRS_OF_CLOUDS);
        job.run().succeeded();
        gdt_batch(folder.path(), &["profile", job.out().to_str().unwrap(), lines.to_str().unwrap()]).succeeded().out
    };
    let text = profile(300);
    assert_eq!(text, profile(2000));
    let rows: Vec<&str> = text.lines().collect();
    assert_eq!(rows[0], "line,distance,x,y,z");
    // Outside of the terrain.
    assert_eq!(rows[1], "\"a, b\",0.000,-900.250,-700.500,");
    let distance = |row: &&str| row.split(',').nth(2).unwrap().parse::<f64>().unwrap();
    let distances: Vec<f64> = rows[1..].iter().map(distance).collect();
    assert!(rows.len() > 100 && distances.is_sorted(), "{text}");
    // On a line through the terrain every height is between the lowest and the highest point.
    let heights = rows[1..].iter().filter_map(|row| row.split(',').nth(5).unwrap().parse::<f64>().ok());
    assert!(heights.clone().count() > 100 && heights.clone().all(|z| (0.0..997.0).contains(&z)));
}
