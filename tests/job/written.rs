//! The bytes that a job writes depend on nothing but the configuration and the input.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use serde_json::Value;
use tiles::preview::canvas::LONGER_SIDE;
use verify::verify;

use crate::clouds;
use crate::program::{Job, number};

/// Returns all files below `folder` except the report, which holds times.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        if path.is_dir() {
            found.extend(files(&path).into_iter().map(|(below, bytes)| (format!("{name}/{below}"), bytes)));
        } else if name != "report.json" {
            found.insert(name, fs::read(&path).unwrap());
        }
    }
    found
}

#[test]
fn threads_and_repetition_change_no_byte() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = clouds::write(folder.path(), "cloud.csv", &clouds::gaussian(40_000));
    let job = |threads: usize| {
        Job::on(&[&cloud]).tiles_of(3_000).with("output", "max_points_per_level_tile = 3000").threads(threads)
    };
    let (one, two) = (job(1), job(2));
    one.report();
    two.report();
    let expected = files(&one.out());
    let is_tile = |name: &&String| ["tiles/", "levels/", "cut/"].iter().any(|folder| name.starts_with(folder));
    let names: Vec<&String> = expected.keys().filter(|name| !is_tile(name)).collect();
    assert_eq!(names, ["XXH128SUMS", "georeference.json", "preview.pgw", "preview.png", "terrain.glb", "tileset.json"]);
    assert!(expected.keys().filter(|name| name.starts_with("levels/")).count() > 4);
    let differ = |found: BTreeMap<String, Vec<u8>>| {
        assert!(found.keys().eq(expected.keys()));
        expected.iter().filter(|(name, bytes)| found[*name] != **bytes).map(|(name, _)| name).collect::<Vec<_>>()
    };
    assert!(differ(files(&two.out())).is_empty());
    two.report();
    assert!(differ(files(&two.out())).is_empty(), "a second run into the same directory");
}

#[test]
fn no_tile_of_an_earlier_job_stays() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = clouds::write(folder.path(), "cloud.csv", &clouds::gaussian(20_000));
    let job = Job::on(&[&cloud]).tiles_of(1_000);
    let many = number(&job.report()["tiles"]);
    let job = job.with("input", "bounds = [-20000, -20000, 20000, 20000]");
    assert!(number(&job.report()["tiles"]) < many);
    job.verified();
}

#[test]
fn the_report_adds_up_the_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = clouds::write(folder.path(), "cloud.csv", &clouds::clusters(10_000));
    let job = Job::on(&[&cloud]).tiles_of(1_000);
    let report = job.report();
    let bytes: usize = files(&job.out()).values().map(Vec::len).sum();
    assert_eq!(number(&report["bytes_written"]), bytes as u64);
    let figures = &report["leaves"]["outcome"];
    let ways = ["pipeline", "reference", "small", "crowded", "not_accepted"].map(|way| number(&figures[way]));
    assert!(ways.iter().sum::<u64>() >= number(&report["tiles"]), "every tile was triangulated: {figures}");
}

#[test]
fn terrain_glb_holds_the_mesh_of_all_tiles() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = clouds::write(folder.path(), "cloud.csv", &clouds::gaussian(20_000));
    // Without the triangles in cut/ the mesh cannot be proved.
    let job = Job::on(&[&cloud]).tiles_of(2_000).with("output", "hull = \"whole\"");
    let digest = job.digest();
    // `verify` proves it alone in a directory of tiles as well.
    let alone = folder.path().join("alone/tiles");
    fs::create_dir_all(&alone).unwrap();
    fs::copy(job.out().join("terrain.glb"), alone.join("terrain.glb")).unwrap();
    let verdict = verify(alone.parent().unwrap(), 1 << 28).unwrap();
    assert!(verdict.holds(), "{verdict}");
    assert_eq!(verdict.digest, digest);
}

#[test]
fn the_georeference_agrees_with_the_cloud() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = clouds::write(folder.path(), "cloud.csv", &clouds::grid(30, 20));
    let job = Job::on(&[&cloud]).usual_preview();
    job.report();
    let text = fs::read(job.out().join("georeference.json")).unwrap();
    let georeference: Value = serde_json::from_slice(&text).unwrap();
    assert_eq!(georeference["bounds"], serde_json::json!([[0.0, 0.0, 0.0], [14_500.0, 9_500.0, 996.0]]));
    assert_eq!((georeference["resolution"].as_f64(), georeference["unit"].as_str()), (Some(1.0), Some("metre")));
    let png = fs::read(job.out().join("preview.png")).unwrap();
    let picture = png::Decoder::new(std::io::Cursor::new(png)).read_info().unwrap();
    assert_eq!(picture.info().width, LONGER_SIDE as u32);
}
