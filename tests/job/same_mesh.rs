//! The same points give the same mesh with any tiles, threads, order and backend.

use std::path::PathBuf;

use crate::clouds::{self, Cloud};
use crate::common::shared;
use crate::program::Job;

/// More points than any cloud here has.
const ALL_IN_ONE: u64 = 1_000_000;

/// Runs `job` in several ways, asserts that all give the same digest, and returns it.
#[track_caller]
fn one_digest(job: impl Fn() -> Job) -> String {
    let expected = job().tiles_of(ALL_IN_ONE).with("triangulation", "backend = \"reference\"").threads(1).digest();
    let ways =
        [(2_000, "cpu", 2), (2_000, "cpu", 1), (2_000, "reference", 2), (50_000, "cpu", 2), (ALL_IN_ONE, "cpu", 2)];
    for (sites, backend, threads) in ways {
        let job = job().tiles_of(sites).threads(threads);
        let digest = job.with("triangulation", &format!("backend = \"{backend}\"")).digest();
        assert_eq!(digest, expected, "{sites} sites a tile, {backend}, {threads} threads");
    }
    expected
}

/// Asserts the same for a synthetic cloud, in one file, and in three files in another order.
#[track_caller]
fn one_digest_of(cloud: &Cloud) {
    let folder = tempfile::tempdir().unwrap();
    let whole = clouds::write(folder.path(), "whole.csv", cloud);
    let expected = one_digest(|| Job::on(&[&whole]));
    let third = cloud.len() / 3;
    let parts = [&cloud[2 * third..], &cloud[..third], &cloud[third..2 * third]];
    let write = |(i, part): (usize, &&[[i64; 3]])| {
        let reversed: Cloud = part.iter().rev().copied().collect();
        clouds::write(folder.path(), &format!("part{i}.csv"), &reversed)
    };
    let files: Vec<PathBuf> = parts.iter().enumerate().map(write).collect();
    assert_eq!(Job::on(&files).tiles_of(3_000).digest(), expected, "in three files, backwards");
}

#[test]
fn autzen_trim_gives_one_mesh() {
    let Some(shared) = shared() else { return };
    one_digest(|| Job::on(&[shared.join("data/autzen_trim.las")]));
}

#[test]
fn compression_does_not_change_the_mesh() {
    let Some(shared) = shared() else { return };
    let packed = |file: &str, compression: &str| {
        let job = Job::on(&[shared.join("data").join(file)]).tiles_of(10_000);
        job.with("output", &format!("compression = \"{compression}\"")).digest()
    };
    for file in ["crop_2.laz", "32-1-472-150-76.laz", "Topography.laz"] {
        let [none, quantized, meshopt] = ["none", "quantized", "meshopt"].map(|compression| packed(file, compression));
        assert!(none == quantized && none == meshopt, "{file}");
    }
}

#[test]
fn a_real_lattice_gives_one_mesh() {
    let Some(shared) = shared() else { return };
    one_digest(|| Job::on(&[shared.join("data/simple1_4.las")]).with("input", "unit = \"metre\""));
}

#[test]
fn the_order_of_the_files_does_not_change_the_mesh() {
    let Some(shared) = shared() else { return };
    let files = ["data/crop_1.laz", "data/crop_2.laz"].map(|name| shared.join(name));
    let swapped = [&files[1], &files[0]];
    assert_eq!(Job::on(&files).tiles_of(20_000).digest(), Job::on(&swapped).tiles_of(7_000).digest());
}

#[test]
fn a_gaussian_blob_gives_one_mesh() {
    one_digest_of(&clouds::gaussian(60_000));
}

#[test]
fn clusters_give_one_mesh() {
    one_digest_of(&clouds::clusters(60_000));
}

#[test]
fn a_grid_gives_one_mesh() {
    one_digest_of(&clouds::grid(200, 150));
}

#[test]
fn a_circle_gives_one_mesh() {
    one_digest_of(&clouds::circle(20_000));
}

#[test]
fn an_exact_circle_gives_one_mesh() {
    one_digest_of(&clouds::exact_circle(1_185_665));
}

#[test]
fn a_nearly_straight_line_gives_one_mesh() {
    one_digest_of(&clouds::line(20_000, 1));
}

#[test]
fn thousands_of_points_on_two_spots_give_one_mesh() {
    let mut cloud = clouds::uniform(5_000, 30_000, 5);
    cloud.extend((0..6_000).map(|i| [15_000, 15_000, i % 100]));
    cloud.extend((0..6_000).map(|i| [15_001, 15_000, i % 100]));
    one_digest_of(&cloud);
}

#[test]
fn a_crowd_far_from_the_other_points_gives_one_mesh() {
    let mut cloud = clouds::uniform(20_000, 300, 6);
    cloud.extend([[7_000_000, 0, 1], [0, 7_000_000, 2], [-700_000, -700_000, 3]]);
    one_digest_of(&cloud);
}

#[test]
fn points_that_make_no_triangle_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (name, cloud) in [
        ("one", vec![[5, 5, 1]]),
        ("two", vec![[5, 5, 1], [9, 7, 1]]),
        ("equal", vec![[5, 5, 1]; 3_000]),
        ("line", clouds::line(200_000, 0)),
        ("column", (0..5_000).map(|y| [3, y, y]).collect()),
        ("none", vec![]),
    ] {
        let file = clouds::write(folder.path(), &format!("{name}.csv"), &cloud);
        let job = Job::on(&[file]).tiles_of(2_000);
        job.run().refused(3, &[if name == "none" { "no point" } else { "no triangle" }]);
        assert!(!job.out().join("report.json").exists(), "{name}: a failed job leaves no report");
    }
}
