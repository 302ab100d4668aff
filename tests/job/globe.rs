//! Wide areas follow the curve of the earth, tile by tile.

use std::collections::HashMap;
use std::fmt::Write;

use proj4rs::{Proj, transform::transform};
use serde_json::Value;

use crate::levels::greatest_error;
use crate::program::Job;
use crate::random::Random;
use crate::tileset::{Tile, applied, height, keeps_the_rules, numbers, tiles, triangles};

/// Source coordinates of the middle of the area.
const MIDDLE: [f64; 3] = [500_000.0, 4_000_000.0, 0.0];

/// Returns a LAS file in UTM zone 33 north. The points are in steps of 1 cm from [`MIDDLE`].
pub(crate) fn utm(points: &[[i32; 3]]) -> Vec<u8> {
    let keys: [u16; 12] = [1, 1, 0, 2, 1024, 0, 1, 1, 3072, 0, 1, 32633];
    let mut bytes = vec![0; 227];
    let mut put = |at: usize, value: &[u8]| bytes[at..at + value.len()].copy_from_slice(value);
    put(0, b"LASF");
    put(24, &[1, 2]);
    put(94, &227u16.to_le_bytes());
    put(96, &(227 + 54 + 24u32).to_le_bytes());
    put(100, &1u32.to_le_bytes());
    put(105, &20u16.to_le_bytes());
    put(107, &(points.len() as u32).to_le_bytes());
    for (axis, offset) in MIDDLE.into_iter().enumerate() {
        put(131 + 8 * axis, &0.01f64.to_le_bytes());
        put(155 + 8 * axis, &offset.to_le_bytes());
    }
    let mut record = [0; 54];
    record[2..17].copy_from_slice(b"LASF_Projection");
    record[18..20].copy_from_slice(&34735u16.to_le_bytes());
    record[20..22].copy_from_slice(&24u16.to_le_bytes());
    bytes.extend(record);
    bytes.extend(keys.iter().flat_map(|key| key.to_le_bytes()));
    for point in points {
        bytes.extend(point.iter().flat_map(|v| v.to_le_bytes()));
        bytes.extend([0, 0, 9, 2, 0, 0, 0, 0]);
    }
    bytes
}

/// Returns `side` times `side` points in a square. Its sides are `half` metres from `centre` and have points on them. Heights are
/// below 200 m.
pub(crate) fn square(side: i32, half: f64, centre: [f64; 2]) -> Vec<[i32; 3]> {
    let mut random = Random(7);
    let mut along = |i: i32, centre: f64| {
        let share = ((i as f64 + random.unit() * 1.5 - 0.75) / (side - 1) as f64).clamp(0.0, 1.0);
        ((centre + (2.0 * share - 1.0) * half) * 100.0).round() as i32
    };
    let places: Vec<[i32; 2]> =
        (0..side * side).map(|i| [along(i % side, centre[0]), along(i / side, centre[1])]).collect();
    places.into_iter().map(|[x, y]| [x, y, random.below(20_000) as i32]).collect()
}

pub(crate) fn georeference(job: &Job, name: &str) -> Value {
    let text = std::fs::read(job.out().join("georeference.json")).unwrap();
    serde_json::from_slice::<Value>(&text).unwrap()[name].take()
}

/// Computes earth-centred positions of source coordinates, not as the program does: with PROJ's own geocentric coordinates.
pub(crate) struct Truth {
    utm: Proj,
    geocentric: Proj,
}

impl Truth {
    pub(crate) fn new() -> Truth {
        let proj = |text: &str| Proj::from_proj_string(text).unwrap();
        Truth { utm: proj("+proj=utm +zone=33 +datum=WGS84"), geocentric: proj("+proj=geocent +datum=WGS84") }
    }

    /// Returns the position of a place of the scene. The scene's origin is at `offset` in the source.
    pub(crate) fn place(&self, offset: [f64; 3], place: [f64; 3]) -> [f64; 3] {
        let [x, y, z] = [0, 1, 2].map(|k| offset[k] + place[k]);
        let mut point = (x, y, z);
        transform(&self.utm, &self.geocentric, &mut point).unwrap();
        [point.0, point.1, point.2]
    }
}

pub(crate) fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
}

/// Runs a job on these points. Returns it with its tiles, which are packed with meshopt and keep the rules of 3D Tiles.
fn job(points: &[[i32; 3]], tiles_of: u64) -> (Job, Vec<Tile>) {
    let folder = tempfile::tempdir().unwrap();
    let cloud = folder.path().join("cloud.las");
    std::fs::write(&cloud, utm(points)).unwrap();
    let levels = format!("max_points_per_level_tile = {}\nformat = \"3dtiles\"", tiles_of.max(100));
    let job = Job::on(&[&cloud]).tiles_of(tiles_of).with("output", &levels);
    job.report();
    job.verified();
    let tiles = tiles(&job);
    keeps_the_rules(&job, &tiles);
    (job, tiles)
}

/// Runs a job on an area 100 km wide.
pub(crate) fn wide() -> (Job, Vec<Tile>) {
    job(&square(200, 50_000.0, [0.0; 2]), 500)
}

/// Runs a job on the same area, with so many tiles that the tileset is several files.
pub(crate) fn wide_in_many_tiles() -> (Job, Vec<Tile>) {
    job(&square(200, 50_000.0, [0.0; 2]), 24)
}

pub(crate) fn is_exact(tile: &Tile) -> bool {
    tile.json["children"].is_null()
}

#[test]
fn a_wide_area_follows_the_curve_of_the_earth() {
    let (job, tiles) = wide();
    assert!(tiles.iter().all(|tile| numbers::<16>(&tile.json["transform"]).is_some()));
    let globe = georeference(&job, "globe");
    assert_eq!(globe["per_tile"], true);
    let promise = globe["distortion_m"].as_f64().unwrap();
    let offset: [f64; 3] = numbers(&georeference(&job, "offset")).unwrap();
    let truth = Truth::new();
    let (mut off, mut gap, mut flat) = (0.0f64, 0.0f64, 0.0f64);
    let mut places = HashMap::new();
    for tile in tiles.iter().filter(|tile| is_exact(tile)) {
        for place in triangles(&job, tile).into_iter().flatten() {
            let belongs = truth.place(offset, place);
            let found = applied(&tile.placed, place);
            off = off.max(distance(found, belongs));
            flat = flat.max(distance(applied(&tiles[0].placed, place), belongs));
            let first = *places.entry(place.map(f64::to_bits)).or_insert(found);
            gap = gap.max(distance(first, found));
        }
    }
    eprintln!("promised {promise} m, off {off} m, gap {gap} m, with one transform {flat} m");
    // Rounding to steps, at most half the resolution, and the difference between the two computations.
    let rounding = 0.01;
    assert!(off <= promise + rounding && gap <= 2.0 * promise, "{off}, {gap}, {promise}");
    assert!(promise < 1.5 * off, "the promise of {promise} m is too loose: the greatest error is {off} m");
    assert!(gap > 0.0 && flat > 300.0 && off < flat / 20.0, "{off} of {flat}, {gap}");
}

/// Coarser tiles are flat where the earth is curved: their error includes that.
#[test]
fn errors_of_wide_tiles_hold_on_the_globe() {
    let (job, tiles) = wide();
    let meshes: Vec<_> = tiles.iter().map(|tile| triangles(&job, tile)).collect();
    let mut random = Random(3);
    let (mut looked, mut vertical) = (0, 0);
    for (leaf, tile) in tiles.iter().enumerate().filter(|(_, tile)| is_exact(tile)) {
        for _ in 0..20 {
            let exact = meshes[leaf][random.below(meshes[leaf].len() as u64) as usize][0];
            for &above in &tile.above {
                let Some(coarse) = meshes[above].iter().find_map(|t| height(t, [exact[0], exact[1]])) else { continue };
                let shown = applied(&tiles[above].placed, [exact[0], exact[1], coarse]);
                let off = distance(shown, applied(&tile.placed, exact));
                assert!(off <= greatest_error(&tiles[above].json) + 1e-6, "{off} of {}", tiles[above].json["extras"]);
                looked += 1;
                // Heights alone are never off by more than their whole range.
                vertical += usize::from(off <= 200.0);
            }
        }
    }
    assert!(
        looked > 3_000 && vertical < looked,
        "{looked} places, {vertical} of them off by no more than the range of heights"
    );
}

/// Triangles across a void 60 km wide do not pull their tiles away from the ground.
#[test]
fn long_triangles_do_not_move_the_ground() {
    let fields = [square(60, 2_000.0, [-30_000.0, 0.0]), square(60, 2_000.0, [30_000.0, 0.0])].concat();
    let (job, tiles) = job(&fields, 500);
    let offset: [f64; 3] = numbers(&georeference(&job, "offset")).unwrap();
    let truth = Truth::new();
    // For every vertex the error in the tile that places it best.
    let mut best = HashMap::new();
    for tile in tiles.iter().filter(|tile| is_exact(tile)) {
        for place in triangles(&job, tile).into_iter().flatten() {
            let off = distance(applied(&tile.placed, place), truth.place(offset, place));
            best.entry(place.map(f64::to_bits)).and_modify(|best: &mut f64| *best = best.min(off)).or_insert(off);
        }
    }
    let worst = best.values().copied().fold(0.0, f64::max);
    let promise = georeference(&job, "globe")["distortion_m"].as_f64().unwrap();
    assert!(best.len() > 7_000 && worst < 0.2 && promise > 50.0, "{} places, {worst} m, {promise}", best.len());
}

/// A file may say another unit than the code that it names, and a user may say it of a text.
#[test]
fn coordinates_in_feet_are_where_they_belong_although_the_code_means_metres() {
    const FOOT: f64 = 1200.0 / 3937.0;
    let placed = |unit: &str, metres: f64| {
        let folder = tempfile::tempdir().unwrap();
        let mut random = Random(7);
        let mut text = String::new();
        for _ in 0..200 {
            let [x, y, z] = [500_300.0, 5_000_000.0, 100.0].map(|from| (from + 100.0 * random.unit()) / metres);
            writeln!(text, "{x:.3},{y:.3},{z:.3}").unwrap();
        }
        let cloud = folder.path().join("cloud.csv");
        std::fs::write(&cloud, text).unwrap();
        let job = Job::on(&[&cloud]).with("input", &format!("crs = \"EPSG:26915\"\nunit = \"{unit}\""));
        let job = job.with("output", "format = \"3dtiles\"");
        job.report();
        (numbers::<16>(&georeference(&job, "globe")["transform"]).unwrap(), job)
    };
    let [(metres, _metre_job), (feet, _foot_job)] = [placed("metre", 1.0), placed("us-foot", FOOT)];
    // Both have their origin near the middle of the area.
    let apart = distance([metres[12], metres[13], metres[14]], [feet[12], feet[13], feet[14]]);
    assert!(apart < 100.0, "{apart} m");
    for (metres, feet) in metres[..12].iter().zip(&feet[..12]) {
        assert!((metres - feet).abs() < 1e-4, "{metres} {feet}");
    }
}

#[test]
fn a_small_area_has_one_transform() {
    let (job, tiles) = job(&square(70, 1_000.0, [0.0; 2]), 500);
    let globe = georeference(&job, "globe");
    assert_eq!(Some(tiles[0].placed), numbers(&globe["transform"]));
    assert!(tiles.len() > 5 && tiles[1..].iter().all(|tile| tile.json["transform"].is_null()));
    assert_eq!(globe["per_tile"], false);
}
