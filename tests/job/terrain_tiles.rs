//! `[output.terrain]`: the tiles are those of the mesh, whatever the tiles of the job, threads and parts.

use std::collections::BTreeMap;
use std::fs;
use std::io::Read;
use std::path::Path;

use flate2::read::GzDecoder;
use quantized_mesh::{DecodedTile, decode};
use serde_json::Value;

use crate::clouds;
use crate::levels::hills;
use crate::parts::{in_files, in_parts};
use crate::program::{Job, number};
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

#[test]
fn terrain_tiles_do_not_depend_on_tiles_threads_and_parts() {
    let folder = tempfile::tempdir().unwrap();
    let points = hills_in_utm(20_000);
    let cloud = clouds::write(folder.path(), "cloud.csv", &points);
    let job = |job: Job| {
        let job = job.with("input", "crs = \"EPSG:32633\"").with("output", "height_offset = \"egm96\"");
        job.with("output", TERRAIN)
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
        for (beside, own, other) in [([zoom, x + 1, y], 2, 0), ([zoom, x, y + 1], 3, 1)] {
            if let Some(beside) = tiles.get(&beside).filter(|_| zoom > 0) {
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
}

#[test]
fn a_terrain_without_a_place_on_the_globe_is_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = clouds::write(folder.path(), "cloud.csv", &hills_in_utm(500));
    let told = ["[output.terrain] needs the place of the terrain on the globe", "fix: [input] crs = \"EPSG:...\""];
    Job::on(&[&cloud]).with("output", TERRAIN).run_with(&[]).refused(2, &told);
    Job::on(&[&cloud]).with("output", TERRAIN).run_with(&["check"]).refused(2, &told);
}
