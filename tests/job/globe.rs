//! Wide areas follow the curve of the earth, and tiles of any depths meet.

use std::collections::{HashMap, HashSet};
use std::fmt::Write;

use proj4rs::{Proj, transform::transform};
use serde_json::Value;

use crate::levels::{bits, greatest_error, outline};
use crate::program::Job;
use crate::random::Random;
use crate::tileset::{Tile, applied, height, keeps_the_rules, numbers, tiles, triangles};
use tiles::frame::Extras;
use tiles::gltf::read::{TilePart, read_extras, read_tile};
use verify::SourceGrid;

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
    job_packed(points, tiles_of, "meshopt")
}

fn job_packed(points: &[[i32; 3]], tiles_of: u64, compression: &str) -> (Job, Vec<Tile>) {
    let levels = format!("max_points_per_level_tile = {}\nformat = \"3dtiles\"", tiles_of.max(100));
    job_with(points, tiles_of, &format!("{levels}\ncompression = \"{compression}\""))
}

fn job_with(points: &[[i32; 3]], tiles_of: u64, look: &str) -> (Job, Vec<Tile>) {
    let folder = tempfile::tempdir().unwrap();
    let cloud = folder.path().join("cloud.las");
    std::fs::write(&cloud, utm(points)).unwrap();
    let job = Job::on(&[&cloud]).tiles_of(tiles_of).with("output", look);
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

/// The lattice of a job as its tiles describe it.
pub(crate) struct Source {
    grid: SourceGrid,
    pub(crate) extras: Extras,
}

impl Source {
    pub(crate) fn of(job: &Job) -> Source {
        let extras = read_extras(&job.out().join("tiles/000000.glb")).unwrap();
        Source { grid: SourceGrid::new(&extras).unwrap(), extras }
    }

    /// Returns the lattice point of a vertex at `place` of the scene (x east, y north, z up) in a tile whose positions are whole numbers of
    /// `steps`.
    fn integers(&self, steps: [f64; 3], [x, y, z]: [f64; 3]) -> [i32; 3] {
        let world = [x, z, 0.0 - y];
        let is_plain = steps == [1.0; 3];
        let point = if is_plain { self.grid.integers(world) } else { self.grid.integers_on(world, steps) };
        point.expect("every vertex leads to a lattice point")
    }

    /// Returns the source coordinates of all corners of a tile, each with its place of the scene.
    pub(crate) fn corners(&self, job: &Job, tile: &Tile) -> Vec<([f64; 3], [f64; 3])> {
        let steps = steps(job, tile);
        let places = triangles(job, tile).into_iter().flatten();
        places.map(|place| (self.grid.coordinates(self.integers(steps, place)), place)).collect()
    }
}

/// Returns the metres of a step along the axes of a tile; of plain tiles 1.
fn steps(job: &Job, tile: &Tile) -> [f64; 3] {
    read_tile(&job.out().join(tile.json["content"]["uri"].as_str().unwrap())).unwrap().parts[0].scale
}

/// Returns the greatest distance between where a job puts a vertex of an exact tile and where it belongs, and the lowest place of the scene.
fn off_and_lowest(job: &Job, tiles: &[Tile]) -> [f64; 2] {
    let (source, truth) = (Source::of(job), Truth::new());
    let (mut off, mut lowest) = (0.0f64, 0.0f64);
    for tile in tiles.iter().filter(|tile| is_exact(tile)) {
        for (at, place) in source.corners(job, tile) {
            off = off.max(distance(applied(&tile.placed, place), truth.place([0.0; 3], at)));
            lowest = lowest.min(place[2]);
        }
    }
    [off, lowest]
}

#[test]
fn a_wide_area_follows_the_curve_of_the_earth() {
    let (job, tiles) = wide();
    assert!(tiles[1..].iter().all(|tile| tile.json["transform"].is_null()));
    let globe = georeference(&job, "globe");
    assert_eq!((&globe["curved"], &globe["per_tile"]), (&Value::Bool(true), &Value::Bool(false)));
    assert!(georeference(&job, "curvature").is_object());
    let promise = globe["distortion_m"].as_f64().unwrap();
    let [off, lowest] = off_and_lowest(&job, &tiles);
    // Rounding to steps, at most half the resolution along each axis, and the difference between the two computations.
    assert!(off <= promise + 0.01 && promise < 0.02, "{off}, {promise}");
    assert!(lowest < -300.0, "the ends of the area lie {lowest} m below the plane");
}

/// Programs that read plain and quantized tiles need no polynomial for x and y. What is left beside the earth is less than the metre within
/// which one transform places all tiles.
#[test]
fn x_and_y_stay_on_the_lattice_where_programs_read_them() {
    for compression in ["none", "quantized"] {
        let (job, tiles) = job_packed(&square(100, 12_000.0, [0.0; 2]), 500, compression);
        let globe = georeference(&job, "globe");
        assert_eq!((&globe["curved"], &globe["per_tile"]), (&Value::Bool(true), &Value::Bool(false)), "{compression}");
        let promise = globe["distortion_m"].as_f64().unwrap();
        let [off, lowest] = off_and_lowest(&job, &tiles);
        assert!(off <= promise + 0.01 && promise < 0.5 && lowest < -10.0, "{compression}: {off}, {promise}, {lowest}");
        let source = Source::of(&job);
        let Extras { offset, resolution, metres_per_unit, .. } = source.extras;
        for tile in &tiles {
            for (at, place) in source.corners(&job, tile) {
                for axis in 0..2 {
                    let steps = place[axis] / metres_per_unit / resolution;
                    let found = offset[axis] + steps.round() * resolution;
                    assert!((steps - steps.round()).abs() < 0.497, "{compression}: {steps}");
                    assert!((found - at[axis]).abs() < 1e-6, "{compression}: {found} {at:?}");
                }
            }
        }
    }
}

/// Returns how much further apart on the globe the places are that two tiles have for one x and y than their heights are, with the number of
/// such x and y on borders of several depths, and the most depths.
pub(crate) fn gaps(job: &Job, tiles: &[Tile]) -> (f64, usize, usize) {
    let source = Source::of(job);
    let mut known = HashMap::<[u64; 2], Vec<([f64; 3], f64, usize)>>::new();
    for tile in tiles {
        // Vertices inside a coarser tile stand for the surface around them, and no other tile shown at the same time has them.
        let on_border: HashSet<[u64; 3]> = outline(&triangles(job, tile)).into_iter().flatten().collect();
        for (at, place) in source.corners(job, tile).into_iter().filter(|(_, place)| on_border.contains(&bits(*place)))
        {
            let places = known.entry([at[0], at[1]].map(f64::to_bits)).or_default();
            let here = (applied(&tile.placed, place), at[2], tile.above.len());
            if !places.contains(&here) {
                places.push(here);
            }
        }
    }
    let depths = |places: &[([f64; 3], f64, usize)]| places.iter().map(|p| p.2).collect::<HashSet<_>>().len();
    let metres = source.extras.metres_per_unit_z;
    let apart = |places: &Vec<([f64; 3], f64, usize)>| {
        let (first, height, _) = places[0];
        // Where heights differ, x and y may be rounded to different steps of the files.
        let more = |&(place, other, _): &([f64; 3], f64, usize)| match metres * (other - height).abs() {
            0.0 => distance(place, first),
            apart => distance(place, first) - 1.01 * apart - 0.05,
        };
        places.iter().map(more).fold(0.0, f64::max)
    };
    let gap = known.values().map(apart).fold(0.0, f64::max);
    let shared = known.values().filter(|places| depths(places) > 1).count();
    (gap, shared, known.values().map(|places| depths(places)).max().unwrap())
}

/// Any two tiles that a viewer may show side by side have the vertices on their common border at the same place, whatever their depths.
#[test]
fn tiles_of_any_depths_meet_on_the_globe() {
    for (compression, half) in
        [("meshopt", 50_000.0), ("meshopt", 12_000.0), ("none", 12_000.0), ("quantized", 12_000.0)]
    {
        let (job, tiles) = job_packed(&square(200, half, [0.0; 2]), 500, compression);
        let (gap, shared, depths) = gaps(&job, &tiles);
        // Coarser tiles have few of the vertices of the exact ones on their borders.
        assert!(shared > 500 && depths >= 4, "{compression}: {shared} vertices at several depths, at most {depths}");
        assert_eq!(gap, 0.0, "{compression}, {half} m");
    }
}

/// A user who names neither a format nor a packing gets tiles that meet, and a terrain of one file beside them.
#[test]
fn tiles_of_a_wide_area_meet_without_any_option() {
    for half in [12_000.0, 50_000.0] {
        let (job, tiles) = job_with(&square(100, half, [0.0; 2]), 500, "max_points_per_level_tile = 500");
        let (gap, shared, _) = gaps(&job, &tiles);
        assert!(shared > 200, "{shared} vertices at borders");
        assert_eq!(gap, 0.0, "{half} m");
        assert_eq!(georeference(&job, "globe")["per_tile"], false);
        assert!(job.out().join("terrain.glb").exists());
    }
}

/// Where x and y stay on the lattice and the terrain is very wide, tiles have transforms of their own. They differ sideways alone.
#[test]
fn plain_tiles_of_a_very_wide_area_are_placed_one_by_one() {
    let (job, tiles) = job_packed(&square(200, 100_000.0, [0.0; 2]), 500, "none");
    assert!(tiles.iter().all(|tile| numbers::<16>(&tile.json["transform"]).is_some()));
    let globe = georeference(&job, "globe");
    assert_eq!((&globe["curved"], &globe["per_tile"]), (&Value::Bool(true), &Value::Bool(true)));
    let promise = globe["distortion_m"].as_f64().unwrap();
    let [off, lowest] = off_and_lowest(&job, &tiles);
    assert!(off <= promise + 0.01 && promise < 0.7 && lowest < -1000.0, "{off}, {promise}, {lowest}");
    // A tile of the whole area is as far off as one transform for all would be.
    let (gap, ..) = gaps(&job, &tiles);
    let exact: Vec<Tile> = tiles.into_iter().filter(is_exact).collect();
    let (gap_of_exact, ..) = gaps(&job, &exact);
    eprintln!("off {off} m, promised {promise} m, gaps of {gap} m, between exact tiles of {gap_of_exact} m");
    assert!(gap_of_exact > 0.0 && gap_of_exact < 2.0 * promise && gap < 30.0, "{gap}, {gap_of_exact}");
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
                let over = meshes[above].iter().find_map(|t| Some((height(t, [exact[0], exact[1]])?, t)));
                let Some((coarse, triangle)) = over else { continue };
                let off = (coarse - exact[2]).abs();
                let promised = greatest_error(&tiles[above].json);
                // Coarse triangles are flat across the curve between their corners, up to 25 km here. A point in a triangle is at most so
                // far from a corner as the longest side divided by the root of 3.
                let side = (0..3).map(|k| distance(triangle[k], triangle[(k + 1) % 3])).fold(0.0, f64::max);
                let flat = side * side / 3.0 / (2.0 * 6_371_000.0);
                assert!(off <= promised + flat + 0.5, "{off} of {promised}, {side} m wide");
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
    let [off, lowest] = off_and_lowest(&job, &tiles);
    assert!(off < 0.03 && lowest < -60.0, "{off} m, {lowest} m");
}

/// One file is for viewers that know no globe: its scene is the plane of the source, also where the tiles are bent.
#[test]
fn one_file_stays_flat() {
    let folder = tempfile::tempdir().unwrap();
    let (wide, small) = (folder.path().join("wide.las"), folder.path().join("small.las"));
    std::fs::write(&wide, utm(&square(40, 12_000.0, [0.0; 2]))).unwrap();
    std::fs::write(&small, utm(&square(40, 1_000.0, [0.0; 2]))).unwrap();
    let mut flat = Vec::new();
    for (cloud, format, compression, is_curved) in [
        (&wide, "glb", "quantized", false),
        (&wide, "auto", "quantized", true),
        (&wide, "auto", "meshopt", true),
        (&wide, "auto", "none", true),
        (&wide, "3dtiles", "quantized", true),
        (&small, "auto", "quantized", false),
    ] {
        let look = format!("format = \"{format}\"\ncompression = \"{compression}\"");
        let job = Job::on(&[cloud]).with("output", &look).tiles_of(500);
        job.report();
        job.verified();
        assert_eq!(Source::of(&job).extras.curvature.is_some(), is_curved, "{format}");
        assert_eq!(georeference(&job, "curvature").is_object(), is_curved, "{format}");
        let terrain = job.out().join("terrain.glb");
        assert_eq!(terrain.exists(), format != "3dtiles");
        if terrain.exists() && cloud == &wide {
            let file = read_tile(&terrain).unwrap();
            assert!(file.extras.curvature.is_none(), "{format}, {compression}");
            let grid = SourceGrid::new(&file.extras).unwrap();
            let point = |part: &TilePart, v: u32| {
                let world = part.world(v as usize);
                if part.scale == [1.0; 3] { grid.integers(world) } else { grid.integers_on(world, part.scale) }
            };
            let triangles =
                |part: &TilePart| part.triangles.iter().map(|t| t.map(|v| point(part, v).unwrap())).collect();
            let mut all: Vec<[[i32; 3]; 3]> =
                file.parts.iter().flat_map(|part| -> Vec<_> { triangles(part) }).collect();
            all.iter_mut().for_each(|corners| corners.sort_unstable());
            all.sort_unstable();
            flat.push(all);
        }
    }
    // One mesh on the lattice, the heights included.
    assert!(flat[0].len() > 3_000 && flat.iter().all(|mesh| *mesh == flat[0]));
}

/// The text of a system may give it another unit than its code has.
#[test]
fn coordinates_in_feet_are_where_they_belong_although_the_code_means_metres() {
    const FOOT: f64 = 1200.0 / 3937.0;
    let system = |metres: f64| {
        format!(
            r#"PROJCS["UTM",GEOGCS["NAD83",DATUM["North_American_Datum_1983",SPHEROID["GRS 1980",6378137,298.257222101]],
            PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]],PROJECTION["Transverse_Mercator"],
            PARAMETER["latitude_of_origin",0],PARAMETER["central_meridian",-93],PARAMETER["scale_factor",0.9996],
            PARAMETER["false_easting",{}],PARAMETER["false_northing",0],UNIT["unit",{metres}],AUTHORITY["EPSG","26915"]]"#,
            500_000.0 / metres
        )
    };
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
        let job = Job::on(&[&cloud]).with("input", &format!("crs = '''{}'''\nunit = \"{unit}\"", system(metres)));
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
    assert_eq!((&globe["curved"], &globe["per_tile"]), (&Value::Bool(false), &Value::Bool(false)));
    assert!(Source::of(&job).extras.curvature.is_none());
}

/// Steps of x and y may be a thousand times as long as those of z, or a thousandth. Those are made finer that are in the way.
#[test]
fn steps_of_other_lengths_upwards_are_no_reason_to_fail() {
    for (resolution, resolution_z) in [("1", "0.001"), ("0.01", "10")] {
        let folder = tempfile::tempdir().unwrap();
        let cloud = folder.path().join("cloud.las");
        std::fs::write(&cloud, utm(&square(60, 12_000.0, [0.0; 2]))).unwrap();
        let steps = format!("resolution = {resolution}\nresolution_z = {resolution_z}");
        for compression in ["meshopt", "none"] {
            let look = format!("format = \"3dtiles\"\ncompression = \"{compression}\"");
            let job = Job::on(&[&cloud]).tiles_of(500).with("input", &steps).with("output", &look);
            job.report();
            job.verified();
            let globe = georeference(&job, "globe");
            assert_eq!(globe["curved"], true, "{resolution}, {resolution_z}, {compression}");
        }
    }
}

/// No polynomial follows the whole earth: such a scene stays flat, and the job ends well.
#[test]
fn what_is_too_wide_to_be_bent_stays_flat() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = folder.path().join("cloud.las");
    let mut points = square(30, 5_000.0, [0.0; 2]);
    points.extend(square(30, 5_000.0, [400_000.0, 1_000_000.0]));
    std::fs::write(&cloud, utm(&points)).unwrap();
    let job = Job::on(&[&cloud]).tiles_of(500).with("output", "format = \"3dtiles\"\nhull = \"whole\"");
    job.report();
    job.verified();
}
