//! Wide areas follow the curve of the earth, tile by tile.

use std::collections::{HashMap, HashSet};
use std::fmt::Write;

use proj4rs::{Proj, transform::transform};
use serde_json::Value;

use crate::levels::{bits, greatest_error, outline};
use crate::program::Job;
use crate::random::Random;
use crate::tileset::{Tile, applied, height, keeps_the_rules, numbers, tiles, triangles};
use gdt_batch::output::frame::Extras;
use gdt_batch::output::gltf::read::{read_extras, read_tile};
use gdt_batch::verify::SourceGrid;

/// Source coordinates of the middle of the area.
const MIDDLE: [f64; 3] = [500_000.0, 4_000_000.0, 0.0];

/// Returns a LAS file in UTM zone 33 north. The points are in steps of 1 cm from [`MIDDLE`].
fn utm(points: &[[i32; 3]]) -> Vec<u8> {
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
fn square(side: i32, half: f64, centre: [f64; 2]) -> Vec<[i32; 3]> {
    let mut random = Random(7);
    let mut along = |i: i32, centre: f64| {
        let share = ((i as f64 + random.unit() * 1.5 - 0.75) / (side - 1) as f64).clamp(0.0, 1.0);
        ((centre + (2.0 * share - 1.0) * half) * 100.0).round() as i32
    };
    let places: Vec<[i32; 2]> =
        (0..side * side).map(|i| [along(i % side, centre[0]), along(i / side, centre[1])]).collect();
    places.into_iter().map(|[x, y]| [x, y, random.below(20_000) as i32]).collect()
}

fn georeference(job: &Job, name: &str) -> Value {
    let text = std::fs::read(job.out().join("georeference.json")).unwrap();
    serde_json::from_slice::<Value>(&text).unwrap()[name].take()
}

/// Computes earth-centred positions of source coordinates, not as the program does: with PROJ's own geocentric coordinates.
struct Truth {
    utm: Proj,
    geocentric: Proj,
}

impl Truth {
    fn new() -> Truth {
        let proj = |text: &str| Proj::from_proj_string(text).unwrap();
        Truth { utm: proj("+proj=utm +zone=33 +datum=WGS84"), geocentric: proj("+proj=geocent +datum=WGS84") }
    }

    /// Returns the position of a place of the scene. The scene's origin is at `offset` in the source.
    fn place(&self, offset: [f64; 3], place: [f64; 3]) -> [f64; 3] {
        let [x, y, z] = [0, 1, 2].map(|k| offset[k] + place[k]);
        let mut point = (x, y, z);
        transform(&self.utm, &self.geocentric, &mut point).unwrap();
        [point.0, point.1, point.2]
    }
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
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

fn is_exact(tile: &Tile) -> bool {
    tile.json["children"].is_null()
}

/// Returns the lattice of a job as its tiles describe it, and the source coordinates of a place of the scene (x east, y north, z up).
fn lattice(job: &Job) -> (SourceGrid, Extras) {
    let extras = read_extras(&job.out().join("tiles/000000.glb")).unwrap();
    (SourceGrid::new(&extras).unwrap(), extras)
}

/// Returns the source coordinates of the vertex at `place` of the scene (x east, y north, z up), which is a whole number of steps.
fn source(grid: &SourceGrid, steps: [f64; 3], [x, y, z]: [f64; 3]) -> [f64; 3] {
    grid.coordinates(grid.integers_on([x, z, 0.0 - y], steps).expect("every vertex leads to a lattice point"))
}

/// Returns the metres of a step along the axes of a tile.
fn steps(job: &Job, tile: &Tile) -> [f64; 3] {
    read_tile(&job.out().join(tile.json["content"]["uri"].as_str().unwrap())).unwrap().parts[0].scale
}

#[test]
fn a_wide_area_follows_the_curve_of_the_earth() {
    let (job, tiles) = wide();
    assert!(tiles[1..].iter().all(|tile| tile.json["transform"].is_null()));
    let globe = georeference(&job, "globe");
    assert_eq!(globe["curved"], true);
    let promise = globe["distortion_m"].as_f64().unwrap();
    let (grid, extras) = lattice(&job);
    assert!(extras.curvature.is_some());
    let truth = Truth::new();
    let (mut off, mut sag, mut seen) = (0.0f64, 0.0f64, 0);
    for tile in tiles.iter().filter(|tile| is_exact(tile)) {
        let steps = steps(&job, tile);
        for place in triangles(&job, tile).into_iter().flatten() {
            let belongs = truth.place([0.0; 3], source(&grid, steps, place));
            off = off.max(distance(applied(&tile.placed, place), belongs));
            (sag, seen) = (sag.min(place[2]), seen + 1);
        }
    }
    eprintln!("{seen} corners, promised {promise} m, off {off} m, lowest {sag} m");
    // Rounding to steps, at most half the resolution along each axis, and the difference between the two computations.
    assert!(off <= promise + 0.01 && promise < 0.02, "{off}, {promise}");
    assert!(sag < -300.0, "the ends of the area lie {sag} m below the plane");
}

/// Any two tiles that a viewer may show side by side have the vertices on their common border at the same place, whatever their depths.
#[test]
fn tiles_of_any_depths_meet_on_the_globe() {
    let (job, tiles) = wide();
    let (grid, _) = lattice(&job);
    let (mut first, mut depths) =
        (HashMap::<[u64; 2], ([f64; 3], usize)>::new(), HashMap::<[u64; 2], Vec<usize>>::new());
    for tile in &tiles {
        let (steps, mesh) = (steps(&job, tile), triangles(&job, tile));
        // Vertices inside a coarser tile stand for the surface around them, and no other tile shown at the same time has them.
        let on_border: HashSet<[u64; 3]> = outline(&mesh).into_iter().flatten().collect();
        for place in mesh.into_iter().flatten().filter(|&place| on_border.contains(&bits(place))) {
            let [x, y, _] = source(&grid, steps, place);
            let site = [x, y].map(f64::to_bits);
            let on_globe = applied(&tile.placed, place);
            let known = first.entry(site).or_insert((on_globe, tile.above.len()));
            assert_eq!(known.0, on_globe, "{x}, {y} at depths {} and {}", known.1, tile.above.len());
            let depths = depths.entry(site).or_default();
            if !depths.contains(&tile.above.len()) {
                depths.push(tile.above.len());
            }
        }
    }
    let shared = depths.values().filter(|depths| depths.len() > 1).count();
    let most = depths.values().map(Vec::len).max().unwrap();
    assert!(shared > 2_000 && most >= 4, "{shared} vertices at several depths, at most {most}");
}

/// Coarser tiles are bent as the exact ones are: their error is that of heights alone.
#[test]
fn errors_of_wide_tiles_hold_on_the_globe() {
    let (job, tiles) = wide();
    let meshes: Vec<_> = tiles.iter().map(|tile| triangles(&job, tile)).collect();
    let mut random = Random(3);
    let mut looked = 0;
    for (leaf, tile) in tiles.iter().enumerate().filter(|(_, tile)| is_exact(tile)) {
        for _ in 0..20 {
            let exact = meshes[leaf][random.below(meshes[leaf].len() as u64) as usize][0];
            for &above in &tile.above {
                let Some(coarse) = meshes[above].iter().find_map(|t| height(t, [exact[0], exact[1]])) else { continue };
                let off = (coarse - exact[2]).abs();
                let promised = greatest_error(&tiles[above].json);
                // Coarse triangles are flat across the curve between their corners, up to 20 km here.
                assert!(off <= promised + 10.0, "{off} of {promised}");
                looked += 1;
            }
        }
    }
    assert!(looked > 3_000, "{looked} places");
}

/// Triangles across a void 60 km wide do not pull anything away from the ground.
#[test]
fn long_triangles_do_not_move_the_ground() {
    let fields = [square(60, 2_000.0, [-30_000.0, 0.0]), square(60, 2_000.0, [30_000.0, 0.0])].concat();
    let (job, tiles) = job(&fields, 500);
    let (grid, _) = lattice(&job);
    let truth = Truth::new();
    let (mut worst, mut count) = (0.0f64, 0);
    for tile in tiles.iter().filter(|tile| is_exact(tile)) {
        let steps = steps(&job, tile);
        for place in triangles(&job, tile).into_iter().flatten() {
            let belongs = truth.place([0.0; 3], source(&grid, steps, place));
            (worst, count) = (worst.max(distance(applied(&tile.placed, place), belongs)), count + 1);
        }
    }
    assert!(count > 40_000 && worst < 0.03, "{count} corners, {worst} m");
}

/// One file is for viewers that know no globe: its scene is the plane of the source.
#[test]
fn one_file_stays_flat() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = folder.path().join("cloud.las");
    std::fs::write(&cloud, utm(&square(40, 12_000.0, [0.0; 2]))).unwrap();
    for (format, is_curved) in [("glb", false), ("auto", true)] {
        let job = Job::on(&[&cloud]).with("output", &format!("format = \"{format}\""));
        job.report();
        job.verified();
        assert_eq!(lattice(&job).1.curvature.is_some(), is_curved, "{format}");
        assert_eq!(georeference(&job, "curvature").is_object(), is_curved, "{format}");
    }
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
    assert_eq!(globe["curved"], false);
    assert!(lattice(&job).1.curvature.is_none());
}
