//! Slivers along the hull are left out of what viewers see: the same ones whatever the tiles, and never lakes or holes.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::PathBuf;

use serde_json::Value;
use tiles::gltf::read::read_tile;

use crate::clouds::{self, Cloud};
use crate::parts::{in_files, in_parts};
use crate::program::{Job, gdt_batch, number};
use crate::random::Random;
use crate::tileset::{Tile, files_below, height, tiles, triangles};

/// A triangle in the plane, its least corner first.
type Triangle = [[i64; 2]; 3];

/// The side of the square of the bay.
const SIDE: i64 = 100_000;
const BAY: [i64; 2] = [50_000, 90_000];
const LAKE: [i64; 2] = [70_000, 30_000];
const RIVER: [i64; 2] = [25_000, 35_000];

/// Random points around a round lake and a river that opens into the outside in the west. In the north is a bay.
fn bay(count: usize) -> Cloud {
    let mut random = Random(11);
    let is_land = |[x, y]: [i64; 2]| {
        let is_lake = (x - LAKE[0]).pow(2) + (y - LAKE[1]).pow(2) < 12_000i64.pow(2);
        let is_river = x < 45_000 && (y - RIVER[1]).abs() < 8_000;
        let is_bay = (x - 50_000).pow(2) + (y - 110_000).pow(2) < 45_000i64.pow(2);
        !is_lake && !is_river && !is_bay
    };
    let places = std::iter::repeat_with(|| [random.below(SIDE as u64) as i64, random.below(SIDE as u64) as i64]);
    clouds::with_heights(places.filter(|place| is_land(*place)).take(count))
}

/// Points on a steep parabola: every triangle is a sliver.
fn parabola() -> Cloud {
    clouds::with_heights((0..6_000).map(|i| [i, i * i / 10]))
}

/// Returns where the coordinates of the tiles begin.
fn offset(job: &Job) -> [f64; 2] {
    let text = fs::read(job.out().join("georeference.json")).unwrap();
    let georeference: Value = serde_json::from_slice(&text).unwrap();
    [0, 1].map(|axis| georeference["offset"][axis].as_f64().unwrap())
}

/// Returns the triangles in the files of `folder`.
fn mesh_in(job: &Job, folder: &str) -> Vec<Triangle> {
    let (offset, mut found) = (offset(job), Vec::new());
    for path in files_below(&job.out().join(folder)) {
        for part in read_tile(&path).unwrap().parts {
            let corner = |v: u32| {
                let [x, _, z] = part.world(v as usize);
                [x + offset[0], offset[1] - z].map(|value| value.round() as i64)
            };
            found.extend(part.triangles.iter().map(|t| canonical(t.map(corner))));
        }
    }
    found.sort_unstable();
    found
}

fn canonical([a, b, c]: Triangle) -> Triangle {
    [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().unwrap()
}

/// Returns a number with all but its first three bits cleared.
fn in_three_bits(number: i128) -> i128 {
    let below = (i128::BITS - number.leading_zeros()).saturating_sub(3);
    number >> below << below
}

/// The slivers of a mesh by their definition, those with the longest edges first: a way out goes over longer and longer ones.
fn slivers(mesh: &[Triangle], cloud: &Cloud) -> Vec<Triangle> {
    let range = |axis: usize| {
        let values = || cloud.iter().map(|point| point[axis]);
        (values().max().unwrap() - values().min().unwrap() + 1) as i128
    };
    let limit = in_three_bits(100 * range(0) * range(1) / cloud.len() as i128);
    let at: BTreeMap<[[i64; 2]; 2], &Triangle> =
        mesh.iter().flat_map(|t| (0..3).map(move |i| ([t[i], t[(i + 1) % 3]], t))).collect();
    let square = |[a, b]: [[i64; 2]; 2]| (a[0] - b[0]).pow(2) as i128 + (a[1] - b[1]).pow(2) as i128;
    let flow = |t: &Triangle| {
        let edges = [0, 1, 2].map(|i| [t[i], t[(i + 1) % 3]]);
        let longest = edges.into_iter().max_by_key(|&edge| square(edge)).unwrap();
        let others: i128 = edges.into_iter().map(square).sum::<i128>() - square(longest);
        (square(longest) > others && square(longest) > limit).then_some(longest)
    };
    let mut ways: Vec<_> = mesh.iter().filter_map(|t| flow(t).map(|edge| (square(edge), edge, t))).collect();
    ways.sort_unstable_by_key(|&(length, ..)| Reverse(length));
    let mut found = BTreeSet::new();
    for (length, edge, triangle) in ways {
        let next = at.get(&[edge[1], edge[0]]);
        assert!(next.and_then(|next| flow(next)).is_none_or(|edge| square(edge) > length), "edges grow along a way");
        if next.is_none_or(|next| found.contains(*next)) {
            found.insert(*triangle);
        }
    }
    found.into_iter().collect()
}

/// Asserts that jobs of any tiles, threads and parts leave out the slivers of the definition, or none if they are most of the mesh.
/// Returns how many they leave out.
#[track_caller]
fn leaves_out_the_slivers(cloud: &Cloud, side: i64) -> usize {
    let folder = tempfile::tempdir().unwrap();
    let files = in_files(folder.path(), cloud, side);
    let whole = Job::on(&files).with("output", "hull = \"whole\"");
    let report = whole.report();
    assert_eq!((number(&report["cut_triangles"]), &report["hull_length"]), (0, &Value::Null));
    assert!(!whole.out().join("cut").exists());
    let (digest, mesh) = (whole.digest(), mesh_in(&whole, "tiles"));
    let mut expected = slivers(&mesh, cloud);
    if expected.len() > mesh.len() / 2 {
        expected.clear();
    }
    let jobs = [
        Job::on(&files),
        Job::on(&files).tiles_of(500).threads(1),
        Job::on(&files).tiles_of(90).threads(8).with("output", "format = \"glb\""),
        in_parts(&files, 4_000).threads(8),
        in_parts(&files, 900).threads(1),
    ];
    for (number_of_job, job) in jobs.into_iter().enumerate() {
        let report = job.report();
        assert!(mesh_in(&job, "cut") == expected, "job {number_of_job}");
        assert_eq!(job.digest(), digest, "job {number_of_job}");
        let count = expected.len() as u64;
        assert_eq!([number(&report["cut_triangles"]), number(&report["hull_triangles"])], [count; 2]);
        assert_eq!(number(&report["triangles"]), mesh.len() as u64 - count);
    }
    expected.len()
}

/// The spacing is that of all points, so a look at a small area first shows what the whole job will show.
#[test]
fn the_length_does_not_depend_on_the_bounds() {
    let folder = tempfile::tempdir().unwrap();
    let file = clouds::write(folder.path(), "cloud.csv", &clouds::uniform(20_000, 100_000, 3));
    let [whole, part] = [Job::on(&[&file]), Job::on(&[&file]).with("input", "bounds = [40000, 40000, 60000, 60000]")];
    let [whole, part] = [whole, part].map(|job| job.with("input", "resolution = 1").report());
    let [length, length_of_part] = [&whole, &part].map(|report| report["hull_length"].as_f64().unwrap());
    assert!((length - (in_three_bits(100 * 10_000_000_000 / 20_000) as f64).sqrt()).abs() < 1.0, "{length}");
    assert_eq!(length_of_part, length);
    assert!(number(&part["hull_triangles"]) * 100 < number(&part["triangles"]), "{part}");
}

/// Places that coincide on a coarse lattice are no closer to each other than its step.
#[test]
fn more_points_than_places_leave_out_no_small_triangles() {
    let folder = tempfile::tempdir().unwrap();
    let disc = (0..60i64)
        .flat_map(|x| (0..60i64).map(move |y| [x, y]))
        .filter(|[x, y]| (x - 30).pow(2) + (y - 30).pow(2) < 800);
    let cloud = clouds::with_heights(disc.flat_map(|place| [place; 3]));
    let file = clouds::write(folder.path(), "cloud.csv", &cloud);
    let report = Job::on(&[&file]).with("input", "resolution = 1").report();
    assert_eq!((number(&report["hull_triangles"]), number(&report["sites"]) * 3), (0, cloud.len() as u64));
}

/// Where nothing can be cut into parts, the job is one part.
#[test]
fn many_small_files_of_one_area_are_one_part() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = clouds::uniform(12_000, 100_000, 5);
    let write = |(i, points): (usize, &[[i64; 3]])| clouds::write(folder.path(), &format!("{i}.csv"), points);
    let files: Vec<PathBuf> = cloud.chunks(20).enumerate().map(write).collect();
    let job = Job::on(&files).tiles_of(200).with("triangulation", "max_points_per_part = 2000");
    assert_eq!(number(&job.report()["parts"]), 1);
    job.verified();
}

#[test]
fn a_bay_is_left_out() {
    assert!(leaves_out_the_slivers(&bay(9_000), 20_000) > 20);
}

#[test]
fn a_round_blob_that_thins_out() {
    assert!(leaves_out_the_slivers(&clouds::gaussian(8_000), 60_000) > 5);
}

#[test]
fn clusters_far_from_each_other() {
    assert!(leaves_out_the_slivers(&clouds::clusters(8_000), 60_000) > 50);
}

#[test]
fn a_square_lattice_and_exact_circles_have_no_slivers() {
    assert_eq!(leaves_out_the_slivers(&clouds::grid(80, 80), 13_000), 0);
    leaves_out_the_slivers(&clouds::exact_circle(5_525), 5_000);
}

#[test]
fn a_circle_and_a_noisy_line() {
    leaves_out_the_slivers(&clouds::circle(3_000), 5_000);
    leaves_out_the_slivers(&clouds::line(4_000, 3), 9_000);
}

#[test]
fn a_curve_keeps_all_triangles_and_a_warning_says_so() {
    let cloud = parabola();
    assert_eq!(leaves_out_the_slivers(&cloud, 1_000_000), 0);
    let folder = tempfile::tempdir().unwrap();
    let file = clouds::write(folder.path(), "cloud.csv", &cloud);
    let warns = |job: Job| job.report()["warnings"].to_string().contains("no slivers are left out along the hull");
    assert!(
        warns(Job::on(&[&file]))
            && warns(Job::on(&[&file]).tiles_of(300))
            && warns(in_parts(std::slice::from_ref(&file), 900))
    );
    assert!(!warns(Job::on(&[&file]).with("output", "hull = \"whole\"")));
}

/// Tells whether the exact tiles, and the coarsest one, cover the place.
fn is_covered(job: &Job, place: [i64; 2]) -> [bool; 2] {
    job.report();
    let offset = offset(job);
    let local = [0, 1].map(|axis| place[axis] as f64 - offset[axis]);
    let tiles = tiles(job);
    let exact = tiles.iter().filter(|tile| tile.json["children"].is_null());
    let covers = |tile: &Tile| triangles(job, tile).iter().any(|t| height(t, local).is_some());
    assert!(!tiles[0].json["children"].is_null());
    [exact.into_iter().any(covers), covers(&tiles[0])]
}

#[test]
fn lakes_and_rivers_stay_and_levels_do_not_show_slivers_either() {
    let folder = tempfile::tempdir().unwrap();
    let file = clouds::write(folder.path(), "cloud.csv", &bay(9_000));
    let trimmed = || Job::on(&[&file]).tiles_of(400).with("output", "max_points_per_level_tile = 400");
    for (job, bay) in [(trimmed(), false), (trimmed().with("output", "hull = \"whole\""), true)] {
        assert_eq!(is_covered(&job, LAKE), [true; 2], "the lake");
        assert_eq!(is_covered(&job, RIVER), [true; 2], "the river");
        assert_eq!(is_covered(&job, BAY), [bay; 2], "the bay");
    }
}

#[test]
fn what_hull_and_max_edge_leave_out_is_counted_apart() {
    let folder = tempfile::tempdir().unwrap();
    let file = clouds::write(folder.path(), "cloud.csv", &bay(9_000));
    let hull = number(&Job::on(&[&file]).report()["hull_triangles"]);
    let job = Job::on(&[&file]).tiles_of(500).with("output", "max_edge = 6000.0");
    let said = job.run_with(&["--verbose"]).succeeded();
    let report: Value = serde_json::from_slice(&fs::read(job.out().join("report.json")).unwrap()).unwrap();
    let cut = number(&report["cut_triangles"]);
    assert!(hull > 0 && number(&report["hull_triangles"]) == hull && cut > hull, "{hull}, {cut}");
    let length = report["hull_length"].as_f64().unwrap();
    assert!((length - (in_three_bits(100 * 10_000_000_000 / 9_000) as f64).sqrt()).abs() < 0.01 * length, "{length}");
    let line = |name: &str| said.out.lines().find(|line| line.contains(name)).unwrap().to_owned();
    assert!(
        line("left out (hull)").contains(&format!(" {hull}, with an edge longer than {length:.3}")),
        "{}",
        said.out
    );
    assert!(line("left out (max_edge)").ends_with(&format!(" {}", cut - hull)), "{}", said.out);
    job.verified();
    let none = Job::on(&[&file]).with("output", "max_edge = 1");
    none.run().refused(2, &["max_edge", "all", "besides", "slivers", "greater"]);
}

#[test]
fn one_file_has_no_slivers() {
    let folder = tempfile::tempdir().unwrap();
    let file = clouds::write(folder.path(), "cloud.csv", &bay(4_000));
    let job = Job::on(&[&file]).tiles_of(500);
    let report = job.report();
    let one = read_tile(&job.out().join("terrain.glb")).unwrap();
    let count: usize = one.parts.iter().map(|part| part.triangles.len()).sum();
    assert_eq!(count as u64, number(&report["triangles"]));
    assert!(number(&report["hull_triangles"]) > 5);
}

#[test]
fn tasks_leave_the_bytes_of_one_process() {
    let folder = tempfile::tempdir().unwrap();
    for cloud in [bay(6_000), parabola()] {
        let files = in_files(folder.path(), &cloud, 1_000_000);
        let bytes = |job: &Job| fs::read_to_string(job.out().join("XXH128SUMS")).unwrap();
        let one = in_parts(&files, 900);
        assert!(number(&one.report()["parts"]) > 3);
        let many = in_parts(&files, 900);
        let config: PathBuf = many.config();
        let arguments = ["submit", config.to_str().unwrap(), "--engine", "local", "--tasks", "3"];
        gdt_batch(many.folder(), &arguments).succeeded();
        assert_eq!(bytes(&many), bytes(&one));
        fs::remove_dir_all(folder.path()).unwrap();
        fs::create_dir(folder.path()).unwrap();
    }
}

#[test]
fn few_points_keep_their_triangles() {
    let folder = tempfile::tempdir().unwrap();
    let job = |name: &str, places: &[[i64; 2]]| {
        Job::on(&[clouds::write(folder.path(), name, &clouds::with_heights(places.iter().copied()))])
    };
    let flat = [[0, 0], [1_000_000, 0], [500_000, 1]];
    assert_eq!(number(&job("three.csv", &flat).report()["triangles"]), 1);
    let refused = |name: &str, places: &[[i64; 2]]| job(name, places).run().refused(3, &["make no triangle"]);
    refused("two.csv", &flat[..2]);
    refused("line.csv", &[[0, 0], [10, 10], [40, 40], [90_000, 90_000]]);
}
