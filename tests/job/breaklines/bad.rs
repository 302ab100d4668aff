//! Files of lines that cannot be used: the message names the file and the feature, and says what to do.

use std::fs;
use std::path::{Path, PathBuf};

use super::files::{Features, geojson, geopackage, shapefile};
use super::terrain::{Mesh, Survey, cross};
use crate::bad_files::{damaged, good, write};
use crate::program::Job;
use rusqlite::Connection;

#[test]
fn broken_files_are_named() {
    let survey = Survey::new(300);
    let folder = survey.folder();
    let refused = |file: &Path, rest: &str, code: i32, words: &[&str]| {
        // The message may name a file beside it.
        let name = file.file_stem().unwrap().to_str().unwrap();
        let said = survey.job_with(&[file], rest).run_with(&["--quiet"]);
        said.refused(code, &[&[name], words].concat());
    };
    let lines = || Features::lines(&[("line", cross(0)), ("line", cross(1))]);
    let shp = shapefile(folder, "a", &lines());
    let bytes = fs::read(&shp).unwrap();
    fs::write(&shp, &bytes[..bytes.len() - 10]).unwrap();
    refused(&shp, "", 3, &["is cut off"]);
    let mut broken = bytes.clone();
    broken[156..164].copy_from_slice(&f64::NAN.to_le_bytes());
    fs::write(&shp, &broken).unwrap();
    refused(&shp, "", 3, &["feature 1 has the vertex", "which is no place"]);
    fs::write(&shp, &bytes).unwrap();
    fs::remove_file(shp.with_extension("dbf")).unwrap();
    refused(&shp, "kind_field = \"kind\"", 3, &["its attributes are missing"]);
    let shp = shapefile(folder, "b", &lines());
    refused(&shp, "kind_field = \"type\"", 3, &["no attribute \"type\"", "it has kind"]);
    let wall = vec![[10.0, 10.0, 1.0], [20.0, 10.0, 1.0], [20.0, 10.0, 9.0], [30.0, 10.0, 9.0]];
    let walls = geojson(folder, "wall.geojson", &Features::lines(&[("line", wall)]));
    refused(&walls, "", 3, &["feature 1 is a wall", "1 and 9 at (500020, 4000010)"]);
    let gpkg = geopackage(folder, "c.gpkg", &lines());
    refused(&gpkg, "layer = \"roads\"", 3, &["has no layer \"roads\"", "\"waters\""]);
    refused(&gpkg, "height_field = \"level\"", 3, &["feature 1 has no number in \"level\""]);
    let file = Connection::open(&gpkg).unwrap();
    file.execute("UPDATE waters SET geom = x'47500001' WHERE fid = 2", []).unwrap();
    file.close().unwrap();
    refused(&gpkg, "", 3, &["feature 2 has a geometry that is damaged"]);
    let page = folder.join("page.html");
    fs::write(&page, "<html>").unwrap();
    refused(&page, "", 3, &["ogr2ogr lines.gpkg"]);
}

#[test]
fn geodatabases_and_other_systems_are_refused() {
    let survey = Survey::new(300);
    let base = survey.folder().join("roads.gdb");
    fs::create_dir(&base).unwrap();
    survey.job_with(&[&base], "").run().refused(3, &["roads.gdb", "ogr2ogr lines.gpkg"]);
    survey.job_with(&["nothing.shp"], "").run().refused(2, &["[[breaklines]] files", "nothing.shp"]);
    let shp = shapefile(survey.folder(), "other", &Features::lines(&[("line", cross(0))]));
    let old =
        super::files::UTM_33.replace("D_WGS_1984", "D_European_1950").replace("GCS_WGS_1984", "GCS_European_1950");
    fs::write(shp.with_extension("prj"), old).unwrap();
    survey.job_with(&[&shp], "").run().refused(2, &["other.shp is in", "-t_srs EPSG:32633", "crs = \"points\""]);
    survey.job_with(&[&shp], "crs = \"points\"").report();
    let degrees = survey.folder().join("degrees.geojson");
    // From 20 m, 20 m to 120 m, 150 m beside the origin of the cloud.
    let way = "[[15.00022231495, 36.14489841313, 14], [15.001333909542, 36.146070450144, 14]]";
    fs::write(&degrees, format!("{{\"type\": \"LineString\", \"coordinates\": {way}}}")).unwrap();
    let report = survey.job_with(&[&degrees], "").report();
    assert!(report["warnings"].to_string().contains("transformed from WGS 84"), "{report}");
    let edges = report["breaklines"]["subsegments"].as_u64();
    assert!(edges.is_some_and(|edges| edges > 10), "{}", report["breaklines"]);
    fs::remove_file(shp.with_extension("prj")).unwrap();
    let said = survey.job_with(&[&shp], "").run().succeeded();
    assert!(said.out.contains("no .prj file"), "{}", said.out);
    let said = survey.job_with(&[&shp], "").run_with(&["check"]);
    assert!(said.out.contains("edges") || said.code == 2, "{said:?}");
}

#[test]
fn options_that_contradict_each_other_are_refused() {
    let survey = Survey::new(300);
    let river = survey.river();
    for (rest, words) in [
        ("kind = \"river\"\nkind_field = \"kind\"", ["kind and kind_field", "keep one"]),
        ("kind = \"creek\"", ["river", "lake"]),
        ("spacing = -1", ["positive", "auto"]),
        ("crs = \"first\"", ["points", "EPSG"]),
    ] {
        survey.job_with(&[&river], rest).run().refused(2, &words);
    }
    survey.job_with::<&str>(&[], "").run().refused(2, &["[[breaklines]] files is empty"]);
}

/// How far points are apart on average counts for how lines are cut, but only with those of files that are used.
#[test]
fn a_cloud_that_proves_bad_has_no_say_in_how_lines_are_cut() {
    let folder = tempfile::tempdir().unwrap();
    let clouds = [good(folder.path()), write(folder.path(), "damaged.laz", &damaged(0.01))];
    let line = vec![[-60.0, -50.0, 1.0], [70.0, 40.0, 2.0]];
    let lines = geojson(folder.path(), "line.geojson", &Features::lines(&[("line", line)]));
    let edges = |clouds: &[PathBuf]| {
        let job = Job::on(clouds).with("input", "on_bad_file = \"skip\"");
        let job = job.with("[breaklines]", &format!("files = [{lines:?}]"));
        let report = job.report();
        job.verified();
        (Mesh::listed(&job), report["skipped"].as_array().unwrap().len())
    };
    let (both, one) = (edges(&clouds), edges(&clouds[..1]));
    assert_eq!((both.1, one.1), (1, 0));
    assert!(one.0.len() > 3);
    assert_eq!(both.0, one.0);
}
