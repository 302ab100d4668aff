//! Points on which a triangulation can take quadratic time: a whole job with levels ends, verifies, and gives one mesh with any tiles.
//!
//! Each of these took from half a minute to hours while `spade` triangulated what the pipeline rejects.

use crate::clouds;
use crate::program::Job;
use crate::scattered::with_heights;

const COUNT: i64 = 60_000;

/// Asserts that the points at `place(0)`, `place(1)` ... give the same mesh in one tile and in many.
#[track_caller]
fn gives_one_mesh(place: impl Fn(i64) -> [i64; 2]) {
    let folder = tempfile::tempdir().unwrap();
    let cloud = clouds::write(folder.path(), "cloud.csv", &with_heights((0..COUNT).map(place)));
    let job = || Job::on(&[&cloud]).with("output", "format = \"3dtiles\"");
    assert_eq!(job().tiles_of(8_000).digest(), job().tiles_of(1_000_000).digest());
}

#[test]
fn a_line_and_one_point_beside_it() {
    gives_one_mesh(|i| if i == 0 { [40_000, 70_000] } else { [2 * i, 0] });
}

#[test]
fn a_diagonal_and_one_point_beside_it() {
    gives_one_mesh(|i| if i == 0 { [100_000, 10_000] } else { [2 * i, 2 * i] });
}

#[test]
fn two_lines() {
    gives_one_mesh(|i| [i, 50_000 * (i % 2)]);
}

#[test]
fn a_cross() {
    gives_one_mesh(|i| if i % 2 == 0 { [i, COUNT / 2] } else { [COUNT / 2 + 1, i] });
}

#[test]
fn a_parabola() {
    gives_one_mesh(|i| [10 * i, (i - COUNT / 2) * (i - COUNT / 2) / 5_000]);
}

#[test]
fn a_narrow_parabola() {
    gives_one_mesh(|i| [2 * i - COUNT, (2 * i - COUNT).pow(2) / 200]);
}

#[test]
fn a_circle_and_its_centre() {
    gives_one_mesh(|i| {
        let (sin, cos) = (i as f64).sin_cos();
        if i == 0 { [0, 0] } else { [1e8 * cos, 1e8 * sin].map(|c| c.round() as i64) }
    });
}

#[test]
fn a_dense_ring_and_one_point_far_away() {
    gives_one_mesh(|i| {
        let (sin, cos) = (i as f64).sin_cos();
        let radius = if i % 2 == 0 { 5_000.0 } else { 4_900.0 * (i as f64 / COUNT as f64).sqrt() };
        if i == 0 { [5_000_000; 2] } else { [radius * cos, radius * sin].map(|c| c.round() as i64) }
    });
}
