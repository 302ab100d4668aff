//! Colours by height: one point of noise, or a header that lies, does not give all of a terrain one colour.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use job::plan::job_plan::Plan;
use job::plan::lattice_choice::LatticeCoarsening;
use job::plan::make_plan::make_plan;
use tiles::color::{HeightRange, height_color};
use tiles::gltf::read::read_tile;
use verify::SourceGrid;

use crate::clouds::{self, Cloud};
use crate::las_file::LasFile;
use crate::levels::hills;
use crate::parts::in_files;
use crate::program::{Job, number};
use crate::tileset::files_below;

/// Linear red, green and blue by height in steps.
type ColorsByHeight = BTreeMap<i32, BTreeSet<[u16; 3]>>;

/// Runs the job and returns the colours of its exact tiles. Heights are multiples of `step`.
#[track_caller]
fn colors(job: &Job, parts: bool, step: f64) -> ColorsByHeight {
    assert_eq!(number(&job.report()["parts"]) > 1, parts);
    let mut colors = ColorsByHeight::new();
    for path in files_below(&job.out().join("tiles")) {
        let tile = read_tile(&path).unwrap();
        let grid = SourceGrid::new(&tile.extras).unwrap();
        for part in &tile.parts {
            for (v, &[r, g, b, _]) in part.colors.as_ref().unwrap().iter().enumerate() {
                let z = grid.coordinates(grid.integers(part.world(v)).unwrap())[2];
                colors.entry((z / step).round() as i32).or_default().insert([r, g, b]);
            }
        }
    }
    colors
}

/// Returns a job whose tiles are coloured by height. In parts, it has several.
fn by_height(files: &[PathBuf], parts: bool) -> Job {
    // Without packing, so that the colours come back exactly.
    let job = Job::on(files).tiles_of(2_000).with("output", "color = \"elevation\"\ncompression = \"none\"");
    if parts { job.with("triangulation", "max_points_per_part = 5000") } else { job }
}

fn planned(job: &Job) -> Plan {
    make_plan(&gdt_batch::config::load(&job.config()).unwrap(), LatticeCoarsening::default()).unwrap()
}

/// Asserts that every height has its colour on the ramp over `range`.
#[track_caller]
fn are_on_the_ramp(colors: &ColorsByHeight, low: i32, high: i32) {
    assert!(colors.len() > 90, "{}", colors.len());
    for (&z, found) in colors {
        assert_eq!(*found, [height_color(z, HeightRange { low, high })].into(), "{z} on {low} to {high}");
    }
}

/// Returns the heights of a cloud without one of a thousand at either end.
fn without_noise(cloud: &Cloud) -> [i32; 2] {
    let mut heights: Vec<i32> = cloud.iter().map(|point| point[2] as i32).collect();
    heights.sort_unstable();
    let left_out = heights.len() / 1000;
    [heights[left_out], heights[heights.len() - 1 - left_out]]
}

#[test]
fn a_point_five_kilometres_high_leaves_the_other_colours() {
    let folder = tempfile::tempdir().unwrap();
    let mut cloud = hills(20_000, 3);
    cloud.push([9_999, 10_001, 5_000]);
    let files = in_files(folder.path(), &cloud, 4_000);
    let [low, high] = without_noise(&cloud);
    assert!(high < 1_000);
    for parts in [false, true] {
        are_on_the_ramp(&colors(&by_height(&files, parts), parts, 1.0), low, high);
    }
}

/// Writes a spiral of points, with heights from -40 to 56 steps, as LAS whose header claims those from -`reach` to `reach` metres.
fn spiral(folder: &Path, points: usize, reach: f64) -> PathBuf {
    let mut bytes = LasFile::new(2, 2, 0, points).las();
    let radius = points as f64 * 0.1;
    for (at, middle, reach) in [(179, 5e5, radius), (195, 4e6, radius), (211, 0.0, reach)] {
        for (at, value) in [(at, middle + reach), (at + 8, middle - reach)] {
            bytes[at..at + 8].copy_from_slice(&f64::to_le_bytes(value));
        }
    }
    let path = folder.join(format!("spiral_{points}_{reach}.las"));
    fs::write(&path, bytes).unwrap();
    path
}

#[test]
fn a_header_with_wrong_heights_leaves_the_colours() {
    let folder = tempfile::tempdir().unwrap();
    // The sample sees all records.
    let small = [spiral(folder.path(), 30_000, 5_000.0)];
    let all = [false, true].map(|parts| colors(&by_height(&small, parts), parts, 0.01));
    are_on_the_ramp(&all[0], -40, 56);
    assert_eq!(all[0], all[1]);
    // It sees some of three chunks.
    let large = [spiral(folder.path(), 120_000, 5_000.0)];
    let some = [false, true].map(|parts| colors(&by_height(&large, parts), parts, 0.01));
    assert!(some[0].values().flatten().collect::<BTreeSet<_>>().len() > 90, "{:?}", some[0]);
    assert_eq!(some[0], some[1]);
}

/// What no record in the sample shows is on the ramp if it is no higher than a slope would be there, and the headers claim it.
#[test]
fn a_slope_has_its_colours_to_the_ends() {
    let folder = tempfile::tempdir().unwrap();
    let slope: Cloud = (0..300_000).map(|i| [i % 500, i / 500, i / 100]).collect();
    let job = by_height(&[clouds::write(folder.path(), "slope.csv", &slope)], false);
    let plan = planned(&job);
    assert!(plan.inputs[0].source.chunks() > 1);
    assert_eq!(plan.heights, Some(HeightRange { low: 0, high: 2_999 }));
}

#[test]
fn a_small_job_has_exact_ends() {
    let folder = tempfile::tempdir().unwrap();
    let mut cloud = hills(900, 6);
    cloud.push([9_999, 10_001, 2_000]);
    let ends = |cloud: &Cloud| {
        let heights = || cloud.iter().map(|point| point[2] as i32);
        [heights().min().unwrap(), heights().max().unwrap()]
    };
    let [low, high] = ends(&cloud);
    let job = by_height(&[clouds::write(folder.path(), "small.csv", &cloud)], false);
    are_on_the_ramp(&colors(&job, false, 1.0), low, high);
}

/// Far from its middle a spiral has few points in a small square, and most records in the sample lie outside.
#[test]
fn where_the_sample_has_too_few_points_the_kept_points_decide() {
    let folder = tempfile::tempdir().unwrap();
    let file = spiral(folder.path(), 200_000, 0.56);
    let bounds = |reach: f64| format!("bounds = [{}, {}, {}, {}]", 5e5, 4e6, 5e5 + reach, 4e6 + reach);
    let job = || by_height(std::slice::from_ref(&file), false).with("input", "classes = [2]");
    let few = job().with("input", &bounds(400.0));
    assert_eq!(planned(&few).heights, None);
    let found = colors(&few, false, 0.01);
    let [low, high] = [found.keys().min(), found.keys().max()].map(|z| *z.unwrap());
    assert_eq!(found[&low], [height_color(0, HeightRange { low: 0, high: 1 })].into());
    assert_eq!(found[&high], [height_color(1, HeightRange { low: 0, high: 1 })].into());
    assert!(planned(&job()).heights.is_some());
}

/// Files that `bounds` leave out say nothing of the heights in them.
#[test]
fn files_out_of_bounds_have_no_say() {
    let folder = tempfile::tempdir().unwrap();
    let near = clouds::write(folder.path(), "near.csv", &hills(60_000, 7));
    let far: Cloud = hills(60_000, 8).into_iter().map(|[x, y, z]| [x + 100_000, y, z + 4_000]).collect();
    let job = |files: &[PathBuf]| by_height(files, false).with("input", "bounds = [0, 0, 20000, 20000]");
    let alone = planned(&job(std::slice::from_ref(&near))).heights;
    assert!(alone.is_some());
    assert_eq!(planned(&job(&[near, clouds::write(folder.path(), "far.csv", &far)])).heights, alone);
}
