//! The Khronos validator finds no error and no warning in what whole jobs write.

use crate::clouds;
use crate::common::shared;
use crate::program::Job;
use crate::validator::validate;

/// Runs the job and validates every GLB file. There must be at least `least` of them.
#[track_caller]
fn validated(job: &Job, least: usize) {
    job.report();
    validate(&job.out(), least);
}

#[test]
fn many_small_tiles_are_valid() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = clouds::write(folder.path(), "cloud.csv", &clouds::clusters(30_000));
    validated(&Job::on(&[&cloud]).tiles_of(1_000), 30);
    validated(&Job::on(&[&cloud]).with("output", "color = \"none\""), 2);
    validated(&Job::on(&[&cloud]).with("output", "normals = false"), 2);
    validated(&Job::on(&[&cloud]).with("output", "color = \"none\"\nnormals = false").tiles_of(500), 60);
    validated(&Job::on(&[&cloud]).with("output", "compression = \"meshopt\"").tiles_of(1_000), 30);
    validated(&Job::on(&[&cloud]).with("output", "compression = \"none\"\nmax_edge = \"auto\"").tiles_of(1_000), 40);
}

#[test]
fn thin_and_flat_tiles_are_valid() {
    let folder = tempfile::tempdir().unwrap();
    let line = clouds::write(folder.path(), "line.csv", &clouds::line(5_000, 1));
    validated(&Job::on(&[line]).tiles_of(1_000), 5);
    let three = clouds::write(folder.path(), "three.csv", &[[0, 0, 5], [9, 0, 5], [0, 9, 5]]);
    validated(&Job::on(&[three]), 2);
}

#[test]
fn tiles_of_real_files_are_valid() {
    let Some(data) = shared().map(|shared| shared.join("data")) else { return };
    validated(&Job::on(&[data.join("autzen_trim.las")]).tiles_of(4_000), 28);
    // Fine steps over a wide area need several meshes in one tile.
    validated(&Job::on(&[data.join("simple1_4.las")]).with("input", "unit = \"metre\""), 2);
    validated(&Job::on(&[data.join("append-bug.laz")]).with("output", "color = \"class\""), 2);
}
