//! `[output.terrain]`: the tiles are those of the mesh, in both schemes, whatever the tiles of the job, threads, parts and tasks.

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::fs;
use std::io::Read;
use std::path::Path;

use flate2::read::GzDecoder;
use proj4rs::{Proj, transform::transform};
use quantized_mesh::{DecodedTile, decode};
use serde_json::Value;
use tiles::gzip::gzipped_mesh;
use verify::{Conclusion, verify};

use crate::breaklines::{Survey, in_lake};
use crate::clouds;
use crate::levels::hills;
use crate::parts::{in_files, in_parts};
use crate::program::{Job, gdt_batch, number};
use crate::random::Random;
use crate::tileset::files_below;

const TERRAIN: &str = "terrain = { format = \"quantized-mesh\" }";

/// Hills on 625 m, in zone 33 of UTM. The tangent plane of a tileset is a centimetre off the globe at most.
pub(crate) fn hills_in_utm(count: usize) -> clouds::Cloud {
    let mut cloud = hills(count, 5);
    for point in &mut cloud {
        *point = [point[0] / 32 + 499_000, point[1] / 32 + 5_300_000, point[2] / 32];
    }
    cloud
}

/// Returns the bytes of all files in terrain/ by their names.
fn files(job: &Job) -> BTreeMap<String, Vec<u8>> {
    let folder = job.out().join("terrain");
    let name = |path: &Path| path.strip_prefix(&folder).unwrap().to_str().unwrap().to_owned();
    files_below(&folder).iter().map(|path| (name(path), fs::read(path).unwrap())).collect()
}

/// Returns the tiles by zoom, column and row.
fn tiles(files: &BTreeMap<String, Vec<u8>>) -> BTreeMap<[i64; 3], DecodedTile> {
    let tile = |(name, bytes): (&String, &Vec<u8>)| {
        let place: Vec<i64> = name.strip_suffix(".terrain")?.split('/').map(|part| part.parse().unwrap()).collect();
        let mut unpacked = Vec::new();
        GzDecoder::new(&bytes[..]).read_to_end(&mut unpacked).unwrap();
        Some((place.try_into().unwrap(), decode(&unpacked).unwrap()))
    };
    files.iter().filter_map(tile).collect()
}

/// The vertices of a side: where along it, and at which height.
fn side(tile: &DecodedTile, side: usize) -> Vec<(u16, f64)> {
    let along = if side.is_multiple_of(2) { 1 } else { 0 };
    tile.sides[side].iter().map(|&v| (tile.vertices[v as usize][along], tile.height(v as usize))).collect()
}

/// The tiling schemes, with the columns of their zoom 0.
const SCHEMES: [(&str, i64); 2] = [("geographic", 2), ("web-mercator", 1)];

/// The option for terrain tiles in a scheme.
fn terrain_in(scheme: &str) -> String {
    format!("terrain = {{ format = \"quantized-mesh\", scheme = \"{scheme}\" }}")
}

#[test]
fn terrain_tiles_do_not_depend_on_tiles_threads_and_parts() {
    for (scheme, columns) in SCHEMES {
        do_not_depend_on_tiles_threads_and_parts(scheme, columns);
    }
}

fn do_not_depend_on_tiles_threads_and_parts(scheme: &str, columns: i64) {
    let folder = tempfile::tempdir().unwrap();
    let points = hills_in_utm(20_000);
    let cloud = clouds::write(folder.path(), "cloud.csv", &points);
    let job = |job: Job| {
        let job = job.with("input", "crs = \"EPSG:32633\"").with("output", "height_offset = \"egm96\"");
        job.with("output", &terrain_in(scheme))
    };
    let first = job(Job::on(&[&cloud]).tiles_of(20_000));
    first.run();
    let expected = files(&first);
    for other in
        [job(Job::on(&[&cloud]).tiles_of(900).threads(1)), job(in_parts(&in_files(folder.path(), &points, 300), 4_000))]
    {
        other.run();
        assert!(files(&other) == expected);
    }

    let list: Value = serde_json::from_slice(&expected["layer.json"]).unwrap();
    let tiles = tiles(&expected);
    let report = first.report();
    assert_eq!(tiles.len() as u64, number(&report["terrain"]["tiles"]));
    assert_eq!(list["available"].as_array().unwrap().len() as u64, number(&list["maxzoom"]) + 1);
    assert!(number(&list["maxzoom"]) >= 8);
    for (zoom, rectangles) in list["available"].as_array().unwrap().iter().enumerate() {
        for rectangle in rectangles.as_array().unwrap() {
            for x in number(&rectangle["startX"])..=number(&rectangle["endX"]) {
                for y in number(&rectangle["startY"])..=number(&rectangle["endY"]) {
                    assert!(tiles.contains_key(&[zoom as i64, x as i64, y as i64]), "{zoom}/{x}/{y}");
                }
            }
        }
    }
    // Neighbours have the same vertices between them, at the same heights to the last bit.
    let mut pairs = 0;
    for (&[zoom, x, y], tile) in &tiles {
        assert_eq!((tile.fault(), &tile.water), (None, &None));
        let east = (x + 1) % (columns << zoom);
        for (beside, own, other) in [([zoom, east, y], 2, 0), ([zoom, x, y + 1], 3, 1)] {
            if let Some(beside) = tiles.get(&beside) {
                assert_eq!(side(tile, own), side(beside, other), "{zoom}/{x}/{y}");
                pairs += 1;
            }
        }
    }
    assert!(pairs > 4, "{pairs}");
    // The finest tiles have all triangles, cut along their borders.
    let finest = tiles.iter().filter(|([zoom, ..], _)| *zoom as u64 == number(&list["maxzoom"]));
    let triangles: usize = finest.map(|(_, tile)| tile.triangles.len()).sum();
    assert!(triangles as u64 > number(&report["triangles"]));
    first.verified();
}

/// Returns longitude and latitude of a place of the survey in radians: centimetres from its origin.
fn on_the_globe([x, y]: [i64; 2]) -> [f64; 2] {
    let proj = |text: &str| Proj::from_proj_string(text).unwrap();
    let mut point = (500_000.0 + x as f64 / 100.0, 4_000_000.0 + y as f64 / 100.0, 0.0);
    transform(&proj("+proj=utm +zone=33 +datum=WGS84"), &proj("+proj=longlat +datum=WGS84"), &mut point).unwrap();
    [point.0, point.1]
}

/// Returns what the water mask of the tile over a place has there.
fn water_at(tiles: &BTreeMap<[i64; 3], DecodedTile>, zoom: i64, columns: i64, place: [f64; 2]) -> u8 {
    let rows = (1i64 << zoom) as f64;
    // The latitude of a border of rows, and so the place between both.
    let border = |row: f64| match columns {
        2 => row / rows * PI - PI / 2.0,
        _ => ((2.0 * row / rows - 1.0) * PI).sinh().atan(),
    };
    let row = (0..zoom)
        .rev()
        .fold(0, |row, bit| row + if place[1] >= border((row + (1 << bit)) as f64) { 1 << bit } else { 0 });
    let share = (place[1] - border(row as f64)) / (border((row + 1) as f64) - border(row as f64));
    let column = (place[0] / PI + 1.0) / 2.0 * (columns << zoom) as f64;
    let mask = tiles[&[zoom, column as i64, row]].water.as_ref().unwrap();
    let cell = |along: f64| (along * 256.0) as usize;
    mask.get(cell(1.0 - share) * 256 + cell(column.fract())).copied().unwrap_or(mask[0])
}

/// The water masks have the lake and not its island, at all zooms where a cell is small beside them, whatever the tiles of the job, threads, parts and tasks.
#[test]
fn lakes_are_in_the_water_masks_of_all_zooms() {
    let survey = Survey::new(6_000);
    for (scheme, columns) in SCHEMES {
        let job = || survey.job().with("output", "height_offset = 0.0").with("output", &terrain_in(scheme));
        let first = job();
        first.run().succeeded();
        first.verified();
        let expected = files(&first);
        let parts = || job().tiles_of(400).with("triangulation", "max_points_per_part = 1500");
        let one = parts().threads(1);
        one.run().succeeded();
        assert!(files(&one) == expected);
        let tasks = parts();
        let config = tasks.config();
        gdt_batch(tasks.folder(), &["submit", config.to_str().unwrap(), "--engine", "local", "--tasks", "3"])
            .succeeded();
        assert!(files(&tasks) == expected);

        let list: Value = serde_json::from_slice(&expected["layer.json"]).unwrap();
        assert_eq!(list["extensions"], serde_json::json!(["octvertexnormals", "watermask"]));
        let tiles = tiles(&expected);
        assert!(tiles.values().all(|tile| tile.water.is_some() && tile.fault().is_none()));
        let finest = number(&list["maxzoom"]) as i64;
        let mut random = Random(7);
        for back in 0..3 {
            // Metres: farther than a cell from the shore there is no doubt.
            let cell = 40_000_000.0 / 256.0 / (columns << (finest - back)) as f64;
            let mut counts = [0; 2];
            for _ in 0..6_000 {
                let place = [0; 2].map(|_| random.below(16_000) as i64);
                let near = [[-1, -1], [1, -1], [-1, 1], [1, 1], [0, 0]].map(|offset: [i64; 2]| {
                    let beside = [0, 1].map(|axis: usize| place[axis] + (offset[axis] as f64 * cell * 100.0) as i64);
                    in_lake(beside)
                });
                if near.iter().all(|beside| *beside == near[4]) {
                    let found = water_at(&tiles, finest - back, columns, on_the_globe(place));
                    assert_eq!(found == 255, near[4], "{scheme} {back}: {place:?}");
                    counts[usize::from(near[4])] += 1;
                }
            }
            assert!(counts.iter().all(|count| *count > 100), "{counts:?}");
        }
    }
}

/// Web mercator ends before the pole.
#[test]
fn a_terrain_beyond_web_mercator_is_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let north: clouds::Cloud = hills_in_utm(800).into_iter().map(|[x, y, z]| [x, y + 4_200_000, z]).collect();
    let cloud = clouds::write(folder.path(), "cloud.csv", &north);
    let job =
        |scheme: &str| Job::on(&[&cloud]).with("input", "crs = \"EPSG:32633\"").with("output", &terrain_in(scheme));
    let told = ["the terrain reaches 85.", "web mercator ends at 85.05 degrees", "fix: scheme = \"geographic\""];
    job("web-mercator").run().refused(2, &told);
    job("web-mercator").run_with(&["check"]).refused(2, &told);
    job("geographic").run().succeeded();
}

/// A few points beyond it are refused as early as many.
#[test]
fn a_terrain_partly_beyond_web_mercator_is_refused_before_it_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let at = |north: i64| hills_in_utm(400).into_iter().map(move |[x, y, z]| [x, y + north, z]);
    let cloud = clouds::write(folder.path(), "cloud.csv", &at(4_100_000).chain(at(4_200_000)).collect::<Vec<_>>());
    let job = |scheme: &str, bounds: &str| {
        let job = Job::on(&[&cloud]).with("input", &format!("crs = \"EPSG:32633\"\n{bounds}"));
        job.with("output", &terrain_in(scheme))
    };
    let told = ["the terrain reaches 85.", "web mercator ends at 85.05 degrees", "fix: scheme = \"geographic\""];
    job("web-mercator", "").run_with(&["check"]).refused(2, &told);
    job("web-mercator", "").run().refused(2, &told);
    job("web-mercator", "bounds = [400000.0, 9000000.0, 600000.0, 9420000.0]").run_with(&["check"]).succeeded();
    job("geographic", "").run_with(&["check"]).succeeded();
}

/// The boxes of files show it, or a sample of the points where these are cut.
#[test]
fn a_terrain_around_too_much_of_the_globe_is_refused_before_it_is_read() {
    let folder = tempfile::tempdir().unwrap();
    // 96 degrees of longitude, and 48 of latitude.
    let wide: clouds::Cloud = hills(900, 5).into_iter().map(|[x, y, z]| [x * 530 - 5_300_000, y * 265, z]).collect();
    let cloud = clouds::write(folder.path(), "cloud.csv", &wide);
    let job = |bounds: &str| {
        let job = Job::on(&[&cloud]).with("input", &format!("crs = \"EPSG:3395\"\n{bounds}"));
        job.with("output", TERRAIN)
    };
    let told = ["degrees of longitude; 90 degrees is the limit", "fix: smaller [input] bounds"];
    for bounds in ["", "bounds = [-5350000.0, 0.0, 5350000.0, 5000000.0]"] {
        job(bounds).run_with(&["check"]).refused(2, &told);
        let refused = job(bounds);
        refused.run().refused(2, &told);
        assert!(!refused.out().join("tiles").exists());
    }
    job("bounds = [-4000000.0, 0.0, 4000000.0, 5000000.0]").run_with(&["check"]).succeeded();
}

/// Corners of the box around some points may lie far nearer to the pole than any of them, and so at other longitudes: each point decides.
#[test]
fn a_terrain_near_a_pole_is_as_wide_as_its_points() {
    let folder = tempfile::tempdir().unwrap();
    // Three pieces of 15 km on 50 degrees of longitude. The corners of the box around them are 116 degrees apart.
    let piece = |[east, north]: [i64; 2]| {
        (0..225)
            .map(move |i| [east + i % 15 * 1_000 + i * i % 7 * 50, north + i / 15 * 1_000 + i * 3 % 5 * 60, i * i % 40])
    };
    let cloud: clouds::Cloud =
        [[-280_000, -600_000], [265_000, -600_000], [-7_000, -190_000]].into_iter().flat_map(piece).collect();
    let file = clouds::write(folder.path(), "pole.csv", &cloud);
    let job = Job::on(&[&file]).with("input", "crs = \"EPSG:3413\"");
    let job = job.with("output", &format!("max_edge = 20000.0\n{TERRAIN}"));
    job.run_with(&["check"]).succeeded();
    let terrain = &job.report()["terrain"];
    assert!(number(&terrain["tiles"]) > 20, "{terrain}");
}

/// Returns a sparse terrain of 20 km with places that have so many points each, on 900 m.
fn crowded(places: &[[i64; 2]], points: usize) -> clouds::Cloud {
    let mut random = Random(11);
    let mut cloud: clouds::Cloud = (0..5_000)
        .map(|_| {
            [500_000 + random.below(20_000) as i64, 5_300_000 + random.below(20_000) as i64, random.below(40) as i64]
        })
        .collect();
    for [east, north] in places {
        let mut seen = std::collections::HashSet::new();
        while seen.len() < points {
            seen.insert([0, 1].map(|_| random.below(900) as i64));
        }
        cloud.extend(seen.into_iter().map(|[x, y]| [500_000 + east + x, 5_300_000 + north + y, (x + y) % 7]));
    }
    cloud
}

fn crowded_job(cloud: &Path, memory: &str) -> Job {
    let job = Job::on(&[cloud]).with("input", "crs = \"EPSG:32633\"").with("output", &terrain_in("geographic"));
    job.with("limits", &format!("memory = \"{memory}\""))
}

#[track_caller]
fn stays_within(report: &Value, mebibytes: u64) {
    if let Some(peak) = report["peak_memory"].as_u64() {
        assert!(peak < mebibytes << 20, "{} MiB of {mebibytes} MiB", peak >> 20);
    }
}

#[test]
fn a_tile_without_room_is_refused_at_once_and_the_limit_that_is_named_suffices() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = clouds::write(folder.path(), "cloud.csv", &crowded(&[[9_000, 9_000]], 600_000));
    let told = ["[output.terrain] takes up to about", "for one terrain tile", "fix: [limits] memory = \""];
    crowded_job(&cloud, "128 MiB").run_with(&["check"]).refused(2, &told);
    let said = crowded_job(&cloud, "128 MiB").run();
    said.refused(2, &told);
    let (_, limit) = said.err.rsplit_once("memory = \"").unwrap();
    let limit = limit.split_once('"').unwrap().0;
    let job = crowded_job(&cloud, limit);
    stays_within(&job.report(), limit.strip_suffix(" MiB").unwrap().parse().unwrap());
    // The tile takes more than a thread's share of that, and has room alone.
    gdt_batch(job.folder(), &["verify", "out", "--memory", "128 MiB"]).succeeded();
    job.verified();
}

/// What `check` lets pass does not stop when the mesh is done, and a limit is not refused that would have been enough by far.
#[test]
fn the_least_limit_that_check_lets_pass_suffices() {
    let folder = tempfile::tempdir().unwrap();
    let places = [[2_000, 2_000], [9_000, 2_000], [16_000, 2_000], [2_000, 14_000], [16_000, 14_000]];
    let cloud = clouds::write(folder.path(), "cloud.csv", &crowded(&places, 150_000));
    let limits = (8..).map(|sixteens| 16 * sixteens);
    let passes = |limit: &u64| {
        let said = crowded_job(&cloud, &format!("{limit} MiB")).run_with(&["check"]);
        said.code == 0
    };
    let least = limits.take(40).find(passes).unwrap();
    assert!((128..=224).contains(&least), "{least} MiB");
    stays_within(&crowded_job(&cloud, &format!("{least} MiB")).threads(2).report(), least);
}

/// Without a budget for all threads, four of them would join four great tiles at the same time.
#[test]
fn great_tiles_of_many_threads_keep_to_the_limit() {
    let folder = tempfile::tempdir().unwrap();
    let places = [[2_000, 2_000], [14_000, 2_000], [2_000, 14_000], [14_000, 14_000]];
    let cloud = clouds::write(folder.path(), "cloud.csv", &crowded(&places, 180_000));
    let job = |memory: &str, threads: usize| crowded_job(&cloud, memory).threads(threads).tiles_of(20_000);
    let tight = job("192 MiB", 4).processors(4);
    stays_within(&tight.report(), 192);
    let wide = job("2 GiB", 1);
    wide.report();
    assert!(files(&tight) == files(&wide));
}

/// Returns the bytes of a tile in which the steps of its vertices along an axis (2 is the height) are changed.
fn forged(bytes: &[u8], axis: usize, change: impl Fn(&mut Vec<u16>)) -> Vec<u8> {
    let mut unpacked = Vec::new();
    GzDecoder::new(bytes).read_to_end(&mut unpacked).unwrap();
    const COUNT_AT: usize = 88;
    let count = u32::from_le_bytes(unpacked[COUNT_AT..][..4].try_into().unwrap()) as usize;
    let mut values: Vec<u16> = decode(&unpacked).unwrap().vertices.iter().map(|vertex| vertex[axis]).collect();
    change(&mut values);
    let mut last = 0;
    for (i, value) in values.into_iter().enumerate() {
        let difference = i32::from(value) - last;
        last = i32::from(value);
        let coded = ((difference << 1) ^ (difference >> 31)) as u16;
        unpacked[COUNT_AT + 4 + 2 * (axis * count + i)..][..2].copy_from_slice(&coded.to_le_bytes());
    }
    gzipped_mesh(&unpacked)
}

/// Without the list of checksums too, `verify` finds what does not fit together.
#[test]
fn forged_terrain_tiles_are_found_without_checksums() {
    let survey = Survey::new(6_000);
    for (scheme, _) in SCHEMES {
        let job = survey.job().with("output", "height_offset = 0.0").with("output", &terrain_in(scheme));
        job.run().succeeded();
        fs::remove_file(job.out().join("XXH128SUMS")).unwrap();
        let whole = files(&job);
        // The finest tile with the most vertices, and one of its vertices on the east side.
        let (place, tile) =
            tiles(&whole).into_iter().max_by_key(|(place, tile)| (place[0], tile.vertices.len())).unwrap();
        let name = format!("{}/{}/{}.terrain", place[0], place[1], place[2]);
        let path = job.out().join("terrain").join(&name);
        let on_side = tile.sides[2][tile.sides[2].len() / 2] as usize;
        let found = |what: &str, words: &str| {
            let verdict = verify(&job.out(), 1 << 28).unwrap();
            let said = verdict.failures.join("\n");
            assert!(verdict.verdict == Conclusion::Failed && said.contains(words), "{scheme} {what}: {verdict}");
        };
        assert_ne!(verify(&job.out(), 1 << 28).unwrap().verdict, Conclusion::Failed);
        let triangle = tile.triangles.iter().max_by_key(|corners| {
            let [a, b, c] = corners.map(|v| tile.vertices[v as usize].map(i64::from));
            (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        });
        let [a, b, _] = triangle.unwrap().map(|v| v as usize);
        // What is done, to which axis, and what `verify` writes of it.
        type Forgery<'a> = (&'a str, usize, &'a dyn Fn(&mut Vec<u16>), &'a str);
        let changes: [Forgery; 4] = [
            ("a vertex in the place of another", 0, &|u| u[a] = u[b].abs_diff(1), "is no terrain tile"),
            (
                "heights five steps off",
                2,
                &|h| h.iter_mut().for_each(|h| *h = h.abs_diff(5)),
                "do not have the same vertices",
            ),
            ("one height on a border", 2, &|h| h[on_side] = h[on_side].abs_diff(1), "do not have the same vertices"),
            ("a vertex moved along a border", 1, &|v| v[on_side] = v[on_side].abs_diff(1), ""),
        ];
        for (what, axis, change, words) in changes {
            fs::write(&path, forged(&whole[&name], axis, change)).unwrap();
            found(what, words);
        }
        let mut unpacked = Vec::new();
        GzDecoder::new(&whole[&name][..]).read_to_end(&mut unpacked).unwrap();
        *unpacked.last_mut().unwrap() = 7;
        fs::write(&path, gzipped_mesh(&unpacked)).unwrap();
        found("a mask of other numbers", "its water mask is none");
        fs::remove_file(&path).unwrap();
        found("a tile less", &format!("terrain/{name} is gone"));
        fs::write(&path, &whole[&name]).unwrap();
        let list = job.out().join("terrain/layer.json");
        let mut layer: Value = serde_json::from_slice(&whole["layer.json"]).unwrap();
        layer["available"].as_array_mut().unwrap().pop();
        fs::write(&list, layer.to_string()).unwrap();
        found("a list without the finest zoom", "where layer.json lists");
        fs::write(&list, &whole["layer.json"]).unwrap();
        assert_ne!(verify(&job.out(), 1 << 28).unwrap().verdict, Conclusion::Failed);
    }
}

/// A terrain across the 180th meridian is in both ends of the one tile of zoom 0 in web mercator.
#[test]
fn a_terrain_across_the_180th_meridian_is_whole() {
    let folder = tempfile::tempdir().unwrap();
    let wide: clouds::Cloud = hills(4_000, 5).into_iter().map(|[x, y, z]| [x + 160_000, y + 1_000_000, z]).collect();
    let cloud = clouds::write(folder.path(), "cloud.csv", &wide);
    for (scheme, columns) in SCHEMES {
        let job = Job::on(&[&cloud]).with("input", "crs = \"EPSG:32601\"").with("output", &terrain_in(scheme));
        job.run().succeeded();
        job.verified();
        let tiles = tiles(&files(&job));
        for (name, tile) in &tiles {
            assert_eq!(tile.fault(), None, "{scheme} {name:?}");
        }
        let ends =
            |zoom: i64| tiles.keys().filter(|[z, x, _]| *z == zoom && [0, (columns << zoom) - 1].contains(x)).count();
        assert!((1..8).all(|zoom| ends(zoom) >= 2), "{scheme}");
        assert_eq!(ends(0) as i64, columns);
    }
}

#[test]
fn a_terrain_without_a_place_on_the_globe_is_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = clouds::write(folder.path(), "cloud.csv", &hills_in_utm(500));
    let told = ["[output.terrain] needs the place of the terrain on the globe", "fix: [input] crs = \"EPSG:...\""];
    Job::on(&[&cloud]).with("output", TERRAIN).run_with(&[]).refused(2, &told);
    Job::on(&[&cloud]).with("output", TERRAIN).run_with(&["check"]).refused(2, &told);
}
