//! Coarser levels and `tileset.json`: the rules of 3D Tiles, borders without gaps, errors that hold.

use std::collections::{BTreeSet, HashMap};
use std::path::Path;

use serde_json::Value;

use crate::clouds;
use crate::common::shared;
use crate::program::{Job, number};
use crate::random::Random;
use crate::tileset::{Tile, error, height, keeps_the_rules, tiles, triangles};

pub(crate) fn bits(point: [f64; 3]) -> [u64; 3] {
    point.map(|v| (v + 0.0).to_bits())
}

/// Returns the directed edges that have a triangle on one side only.
pub(crate) fn outline(triangles: &[[[f64; 3]; 3]]) -> BTreeSet<[[u64; 3]; 2]> {
    let mut edges = BTreeSet::new();
    for t in triangles {
        for i in 0..3 {
            let (a, b) = (bits(t[i]), bits(t[(i + 1) % 3]));
            if !edges.remove(&[b, a]) {
                assert!(edges.insert([a, b]), "an edge is used twice");
            }
        }
    }
    edges
}

pub(crate) fn hills(count: usize, seed: u64) -> clouds::Cloud {
    let mut random = Random(seed);
    let mut height = |x: f64, y: f64| {
        let hills = (x / 900.0).sin() * 300.0 + (y / 700.0).cos() * 250.0 + (x * y / 4e6).sin() * 80.0;
        (hills + 20.0 * random.unit()).round() as i64
    };
    let mut places = Random(seed + 1);
    (0..count)
        .map(|_| {
            let [x, y] = [0; 2].map(|_| places.below(20_000) as i64);
            [x, y, height(x as f64, y as f64)]
        })
        .collect()
}

fn small(cloud: &Path) -> Job {
    Job::on(&[cloud]).tiles_of(500).with("output", "max_points_per_level_tile = 500")
}

#[test]
fn levels_keep_the_rules_cover_their_ground_and_hold_their_errors() {
    let folder = tempfile::tempdir().unwrap();
    for (name, cloud) in [("hills.csv", hills(20_000, 5)), ("clusters.csv", clouds::clusters(12_000))] {
        let job = small(&clouds::write(folder.path(), name, &cloud));
        let report = job.report();
        job.verified();
        let tiles = tiles(&job);
        keeps_the_rules(&job, &tiles);
        assert!(tiles.iter().map(|tile| tile.above.len()).max().unwrap() >= 3, "{name}");
        let coarser = tiles.iter().filter(|tile| !tile.json["children"].is_null());
        assert_eq!(number(&report["levels"]["files"]), coarser.count() as u64);
        assert!(number(&report["levels"]["triangles"]) < number(&report["triangles"]), "{}", report["levels"]);
        coarser_tiles_cover_their_leaves(&job, &tiles);
        errors_are_true(&job, &tiles, name);
    }
}

/// A forest: every other return is from a crown. The greatest error is that of trees at every depth.
#[test]
fn errors_halve_from_depth_to_depth_also_in_a_forest() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(4);
    let forest: clouds::Cloud = hills(60_000, 2)
        .into_iter()
        .map(|[x, y, z]| [x, y, z / 10 + if random.unit() < 0.5 { 2_000 } else { 0 }])
        .collect();
    // With smaller levels, the error of the coarsest would be bounded by their width.
    let cloud = clouds::write(folder.path(), "forest.csv", &forest);
    let job = Job::on(&[&cloud]).tiles_of(500).with("output", "max_points_per_level_tile = 2000");
    job.report();
    let tiles = tiles(&job);
    let coarser = || tiles.iter().filter(|tile| !tile.json["children"].is_null());
    let means: Vec<[f64; 2]> = (0..3)
        .map(|depth| {
            let of_depth: Vec<_> = coarser().filter(|tile| tile.above.len() == depth).collect();
            let mean =
                |of: fn(&Value) -> f64| of_depth.iter().map(|tile| of(&tile.json)).sum::<f64>() / of_depth.len() as f64;
            [mean(error), mean(greatest_error)]
        })
        .collect();
    for pair in means.windows(2) {
        assert!(pair[0][0] > 1.5 * pair[1][0] && pair[0][1] < 1.5 * pair[1][1], "{means:?}");
    }
}

/// A field on the left, a wood on the right: all tiles have as many points.
#[test]
fn a_wood_gets_more_triangles_than_the_field_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(6);
    let cloud: clouds::Cloud = hills(20_000, 3)
        .into_iter()
        .map(|[x, y, z]| [x, y, z / 100 + if x > 10_000 && random.unit() < 0.5 { 2_000 } else { 0 }])
        .collect();
    let job = small(&clouds::write(folder.path(), "edge.csv", &cloud));
    job.report();
    job.verified();
    let tiles = tiles(&job);
    let is_exact = |tile: &Value| tile["children"].is_null();
    let exact = tiles.iter().filter(|tile| is_exact(&tile.json));
    let xs: Vec<f64> = exact.flat_map(|tile| triangles(&job, tile)).map(|t| t[0][0]).collect();
    let middle = (xs.iter().copied().fold(f64::MAX, f64::min) + xs.iter().copied().fold(f64::MIN, f64::max)) / 2.0;
    let lowest = tiles
        .iter()
        .filter(|tile| !is_exact(&tile.json) && tile.json["children"].as_array().unwrap().iter().all(is_exact));
    // On each side the triangles of the finest coarser tiles, and those of the exact tiles below.
    let mut sides = [[0usize; 2]; 2];
    for tile in lowest {
        let own = triangles(&job, tile);
        let x: f64 = own.iter().map(|t| t[0][0]).sum::<f64>() / own.len() as f64;
        let exact: usize = tile.leaves.iter().map(|&leaf| triangles(&job, &tiles[leaf]).len()).sum();
        let side = &mut sides[usize::from(x > middle)];
        *side = [side[0] + own.len(), side[1] + exact];
    }
    let [field, wood] = sides.map(|[own, exact]| own as f64 / exact as f64);
    assert!(wood > 2.0 * field && (0.15..0.25).contains(&((wood + field) / 2.0)), "{sides:?}");
}

/// Asserts that coarser tiles cover the ground of their leaves and little more, and that there is no gap between them and what is around them:
/// only the lower ends of their skirts have nothing beside them.
pub(crate) fn coarser_tiles_cover_their_leaves(job: &Job, tiles: &[Tile]) {
    let mut random = Random(11);
    let area = |mesh: &[[[f64; 3]; 3]]| {
        let twice = |[a, b, c]: &[[f64; 3]; 3]| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        mesh.iter().map(twice).sum::<f64>()
    };
    for tile in tiles.iter().filter(|tile| !tile.json["children"].is_null()) {
        let below: Vec<_> = tile.leaves.iter().flat_map(|&leaf| triangles(job, &tiles[leaf])).collect();
        let own = triangles(job, tile);
        assert!(own.len() < below.len());
        let more = area(&own) / area(&below);
        assert!((1.0 - 1e-9..1.1).contains(&more), "{more} of the ground");
        let outer: Vec<[[f64; 3]; 2]> =
            outline(&below).into_iter().map(|edge| edge.map(|p| p.map(f64::from_bits))).collect();
        for _ in 0..300 {
            let [a, b, c] = below[random.below(below.len() as u64) as usize];
            let [d, e] = outer[random.below(outer.len() as u64) as usize];
            let middle = [0, 1].map(|k| (a[k] + b[k] + c[k]) / 3.0);
            // A little inside, because of rounding.
            let near_border = [0, 1].map(|k| (d[k] + e[k]) / 2.0 + 1e-6 * [d[1] - e[1], e[0] - d[0]][k]);
            for place in [middle, near_border] {
                assert!(own.iter().any(|t| height(t, place).is_some()), "{place:?} is not covered");
            }
        }
        let ends = outline(&own);
        if ends == outline(&below) {
            continue;
        }
        let mut highest = HashMap::<[u64; 2], f64>::new();
        for corner in own.as_flattened() {
            let known = highest.entry([corner[0], corner[1]].map(f64::to_bits)).or_insert(corner[2]);
            *known = known.max(corner[2]);
        }
        let is_lower = |p: &[u64; 3]| f64::from_bits(p[2]) < highest[&[p[0], p[1]]];
        assert!(ends.iter().flatten().all(is_lower), "the border has a gap");
    }
}

/// Returns the greatest vertical distance to the exact mesh that a tile admits.
pub(crate) fn greatest_error(tile: &Value) -> f64 {
    tile["extras"]["maxError"].as_f64().unwrap()
}

/// Asserts that no coarser tile is off by more than it admits, at random places of the exact mesh: ten thousand for each depth.
pub(crate) fn errors_are_true(job: &Job, tiles: &[Tile], name: &str) {
    let meshes: Vec<_> = tiles.iter().map(|tile| triangles(job, tile)).collect();
    let mut random = Random(9);
    let (mut looked, mut greatest) = (vec![0; tiles.iter().map(|tile| tile.above.len()).max().unwrap()], 0.0f64);
    let leaves: Vec<usize> = (0..tiles.len()).filter(|&i| tiles[i].json["children"].is_null()).collect();
    for _ in 0..12_000 {
        let leaf = leaves[random.below(leaves.len() as u64) as usize];
        let t = meshes[leaf][random.below(meshes[leaf].len() as u64) as usize];
        let (u, v) = (random.unit(), random.unit());
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        let [x, y, z] = [0, 1, 2].map(|k| t[0][k] + u * (t[1][k] - t[0][k]) + v * (t[2][k] - t[0][k]));
        for &above in &tiles[leaf].above {
            // Rounding may put a place on an edge outside both triangles.
            let Some(coarse) = meshes[above].iter().find_map(|t| height(t, [x, y])) else { continue };
            let off = (coarse - z).abs();
            let promised = greatest_error(&tiles[above].json);
            assert!(off <= promised + 1e-6, "{name}: {off} at {x}, {y}");
            greatest = greatest.max(off / promised);
            looked[tiles[above].above.len()] += 1;
        }
    }
    assert!(looked.iter().take(3).all(|&looked| looked > 10_000), "{name}: {looked:?} places by depth");
    assert!(greatest > 0.05, "{name}: {greatest} of the error");
}

#[test]
fn format_decides_which_files_are_written() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = clouds::write(folder.path(), "cloud.csv", &hills(3_000, 1));
    let there = |settings: &str| {
        let job = small(&cloud).with("output", settings);
        job.report();
        job.verified();
        let is_there = |name: &str| job.out().join(name).exists();
        if is_there("tileset.json") {
            keeps_the_rules(&job, &tiles(&job));
        }
        ["terrain.glb", "tileset.json", "levels"].map(is_there)
    };
    assert_eq!(there(""), [true, true, true]);
    assert_eq!(there("format = \"glb\""), [true, false, false]);
    assert_eq!(there("format = \"3dtiles\""), [false, true, true]);
    assert_eq!(there("format = \"3dtiles\"\nlevels = false"), [false, true, false]);
}

#[test]
fn a_coordinate_system_places_the_tileset_on_the_globe() {
    let Some(data) = shared().map(|shared| shared.join("data")) else { return };
    for (name, longitude, latitude) in [
        ("autzen_trim.las", -123.0719, 44.0503),
        ("Topography.laz", -70.917, 47.61),
        ("append-bug.laz", 3.0, 43.4),
        ("1.2-with-color.las", f64::NAN, f64::NAN),
    ] {
        let job = Job::on(&[data.join(name)]);
        job.report();
        let root = &tiles(&job)[0].json;
        if f64::is_nan(longitude) {
            assert!(root["transform"].is_null(), "{name}");
            continue;
        }
        let t: Vec<f64> = root["transform"].as_array().unwrap().iter().map(|n| n.as_f64().unwrap()).collect();
        let found = [
            t[13].atan2(t[12]).to_degrees(),
            (t[14] / (t[12].hypot(t[13]) * (1.0 - 0.006_694_38))).atan().to_degrees(),
        ];
        assert!((found[0] - longitude).abs() < 0.2 && (found[1] - latitude).abs() < 0.2, "{name}: {found:?}");
        let radius = (t[12] * t[12] + t[13] * t[13] + t[14] * t[14]).sqrt();
        assert!((6.35e6..6.39e6).contains(&radius), "{name}: {radius}");
        // The columns are east, north and up, right-handed, each a metre long apart from the projection's scale.
        let column = |k: usize| [t[4 * k], t[4 * k + 1], t[4 * k + 2]];
        for k in 0..3 {
            let length = column(k).iter().map(|v| v * v).sum::<f64>().sqrt();
            assert!((length - 1.0).abs() < 2e-3, "{name}: {length}");
        }
        let ([a, b, c], [d, e, f], [g, h, i]) = (column(0), column(1), column(2));
        assert!(a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) > 0.99, "{name}");
        let georeference: Value =
            serde_json::from_slice(&std::fs::read(job.out().join("georeference.json")).unwrap()).unwrap();
        assert!(georeference["globe"]["distortion_m"].as_f64().unwrap() < 0.2, "{name}");
    }
}

/// Of every triangle that stays, all vertices are on the boundary, so coarser tiles are as large as the finer ones together.
#[test]
fn a_terrain_of_scraps_has_only_the_levels_that_fit_the_memory() {
    let scraps = (0..120_000i64).flat_map(|i| {
        let [x, y] = [i % 400, i / 400].map(|k| 500 * k);
        [[x, y, i % 7], [x + 100, y + 20, i % 5], [x + 30, y + 90, i % 3]]
    });
    let folder = tempfile::tempdir().unwrap();
    let cloud = clouds::write(folder.path(), "cloud.csv", &scraps.collect::<Vec<_>>());
    let levels = |memory: &str| {
        let job = Job::on(&[&cloud]).tiles_of(10_000).with("limits", memory);
        let job = job.with("output", "max_edge = 150\nmax_points_per_level_tile = 10000");
        let report = job.report();
        job.verified();
        let tiles = tiles(&job);
        let inner: Vec<&Value> =
            tiles.iter().map(|tile| &tile.json).filter(|tile| !tile["children"].is_null()).collect();
        let with_mesh = inner.iter().filter(|tile| !tile["content"].is_null()).count();
        assert_eq!(number(&report["levels"]["files"]), with_mesh as u64);
        assert_eq!(report["warnings"].to_string().contains("coarser tiles are left out"), with_mesh < inner.len());
        (inner.len(), with_mesh)
    };
    let ((inner, all), (_, some)) = (levels(""), levels("memory = \"256 MiB\""));
    assert_eq!(inner, all);
    assert!(0 < some && some < all, "{some} of {all}");
}
