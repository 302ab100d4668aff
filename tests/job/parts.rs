//! A job of several parts gives the mesh of a job of one part, with the same borders, levels and report.

use crate::clouds::{self, Cloud};
use crate::las_file::LasFile;
use crate::levels::{coarser_tiles_cover_their_leaves, errors_are_true, hills};
use crate::program::{Job, number};
use crate::tileset::{keeps_the_rules, tiles};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Writes `cloud` as files of neighbouring points, as surveys come.
pub(crate) fn in_files(folder: &Path, cloud: &Cloud, side: i64) -> Vec<PathBuf> {
    let mut files: BTreeMap<[i64; 2], Cloud> = BTreeMap::new();
    cloud.iter().for_each(|point| {
        files.entry([point[0].div_euclid(side), point[1].div_euclid(side)]).or_default().push(*point)
    });
    let write = |([x, y], points): (&[i64; 2], &Cloud)| clouds::write(folder, &format!("{x}_{y}.csv"), points);
    files.iter().map(write).collect()
}

/// Returns a job of small tiles whose parts have about so many points.
pub(crate) fn in_parts(files: &[PathBuf], points: u64) -> Job {
    Job::on(files).tiles_of(500).with("triangulation", &format!("max_points_per_part = {points}"))
}

/// Asserts that jobs of few and of many parts give the same mesh.
#[track_caller]
fn gives_one_mesh(cloud: &Cloud, side: i64) {
    let folder = tempfile::tempdir().unwrap();
    let files = in_files(folder.path(), cloud, side);
    let expected = Job::on(&files).tiles_of(500).digest();
    for points in [800, 3_000, 10_000] {
        assert_eq!(in_parts(&files, points).digest(), expected, "{points} points a part");
    }
    let whole = clouds::write(folder.path(), "whole.csv", cloud);
    assert_eq!(in_parts(&[whole], 2_000).digest(), expected, "one file");
}

#[test]
fn random_points() {
    gives_one_mesh(&clouds::uniform(20_000, 20_000, 7), 4_000);
}

#[test]
fn clusters() {
    gives_one_mesh(&clouds::clusters(20_000), 150_000);
}

#[test]
fn a_lattice_of_cocircular_points() {
    gives_one_mesh(&clouds::grid(130, 130), 13_000);
}

#[test]
fn points_on_a_circle() {
    gives_one_mesh(&clouds::circle(6_000), 5_000);
}

#[test]
fn a_line_and_empty_parts() {
    gives_one_mesh(&clouds::line(8_000, 3), 9_000);
}

#[test]
fn the_bytes_do_not_depend_on_threads() {
    let folder = tempfile::tempdir().unwrap();
    let files = in_files(folder.path(), &hills(20_000, 3), 4_000);
    let bytes = |threads: usize| {
        let job = in_parts(&files, 2_500).threads(threads);
        job.report();
        std::fs::read_to_string(job.out().join("XXH128SUMS")).unwrap().lines().map(str::to_owned).collect::<Vec<_>>()
    };
    let (one, four) = (bytes(1), bytes(4));
    assert!(one.len() > 40);
    assert_eq!(one, four);
}

#[test]
fn levels_reach_over_the_parts() {
    let folder = tempfile::tempdir().unwrap();
    let files = in_files(folder.path(), &hills(20_000, 5), 5_000);
    let job = in_parts(&files, 3_000).with("output", "max_points_per_level_tile = 500");
    let report = job.report();
    job.verified();
    let tiles = tiles(&job);
    keeps_the_rules(&job, &tiles);
    let coarser = tiles.iter().filter(|tile| !tile.json["children"].is_null());
    assert_eq!(number(&report["levels"]["files"]), coarser.count() as u64);
    coarser_tiles_cover_their_leaves(&job, &tiles);
    errors_are_true(&job, &tiles, "hills in parts");
}

#[test]
fn max_edge_cuts_the_same_triangles() {
    let folder = tempfile::tempdir().unwrap();
    let files = in_files(folder.path(), &clouds::clusters(15_000), 150_000);
    for max_edge in ["\"auto\"", "3000.0"] {
        let cut = |job: Job| {
            let job = job.with("output", &format!("max_edge = {max_edge}"));
            let report = job.report();
            job.verified();
            [number(&report["triangles"]), number(&report["cut_triangles"])]
        };
        let whole = cut(Job::on(&files).tiles_of(500));
        assert!(whole[1] > 0);
        assert_eq!(cut(in_parts(&files, 2_000)), whole, "{max_edge}");
    }
}

/// The rule looks at squares of the area that the points fill, which is not what headers claim.
#[test]
fn max_edge_auto_cuts_the_same_triangles_where_the_claims_are_wide() {
    let folder = tempfile::tempdir().unwrap();
    let mut text = String::from("x,y,z\n");
    for i in 0..6_000 {
        text += &format!("5.00,{}.{:02},1\n", i / 100, i % 100);
    }
    let file = folder.path().join("line.csv");
    std::fs::write(&file, text + "6.00,30.00,2\n").unwrap();
    let kept = |job: Job| {
        let report = job.with("output", "max_edge = \"auto\"").report();
        [number(&report["triangles"]), number(&report["cut_triangles"])]
    };
    let whole = kept(Job::on(&[&file]).tiles_of(500));
    assert!(whole[1] > 0);
    assert_eq!(kept(in_parts(&[file], 2_000)), whole);
}

/// The header claims a box that holds the first points and not the last.
#[test]
fn a_header_that_proves_wrong_is_measured() {
    let folder = tempfile::tempdir().unwrap();
    let mut bytes = LasFile::new(2, 2, 0, 120_000).las();
    let reach = 10.0 * 60_000.0 * 0.01;
    let claims =
        [(179, 5e5 + reach), (187, 5e5 - reach), (195, 4e6 + reach), (203, 4e6 - reach), (211, 1.0), (219, -1.0)];
    for (at, value) in claims {
        bytes[at..at + 8].copy_from_slice(&f64::to_le_bytes(value));
    }
    let path = folder.path().join("spiral.las");
    std::fs::write(&path, bytes).unwrap();
    let job = || Job::on(&[&path]).tiles_of(10_000);
    let parts = job().with("triangulation", "max_points_per_part = 20000");
    let said = parts.run().succeeded();
    assert!(said.err.contains("measuring all files and starting again"), "{}", said.err);
    let report = std::fs::read(parts.out().join("report.json")).unwrap();
    let report: serde_json::Value = serde_json::from_slice(&report).unwrap();
    assert!(number(&report["parts"]) > 1);
    assert_eq!(parts.verified()["digest"], serde_json::json!(job().digest()));
}
